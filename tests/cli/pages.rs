//! `core/docs/nodes`: a page of each node type. `UPDATE_DOCS=1` writes them anew.

use std::path::{Path, PathBuf};

use warploom::nodes::{Folders, pages};
use warploom_core::graph::{Options, check};
use warploom_core::registry::Registry;

use crate::desk::Desk;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("it lies in the repository").to_owned()
}

fn registry() -> Registry {
    Registry::new(warploom_nodes::NODES)
}

fn made() -> Vec<(String, String)> {
    let [out, examples, pictures] =
        ["core/docs/nodes", "tests/golden", "core/docs/pictures"].map(|name| repository().join(name));
    pages(&registry(), &Folders { out: &out, examples: Some(&examples), pictures: Some(&pictures) })
}

#[test]
fn the_pages_are_current() {
    let folder = repository().join("core/docs/nodes");
    let pages = made();
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        pages.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).expect("a file"));
    }
    let entries = std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut there: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    let mut expected: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    there.sort();
    expected.sort_unstable();
    assert_eq!(there, expected, "UPDATE_DOCS=1 writes the pages anew");
    for (name, text) in &pages {
        let written = std::fs::read_to_string(folder.join(name)).expect("it is there");
        assert!(written == *text, "{name} is not what the declarations say; UPDATE_DOCS=1 writes the pages anew");
    }
}

#[test]
fn examples_check_clean_and_pictures_are_there() {
    let (registry, folder) = (registry(), repository().join("core/docs/nodes"));
    for (name, text) in made() {
        let links = text.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next());
        let shown = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.chain(shown) {
            assert!(link.ends_with(".md") || folder.join(link).is_file(), "{name} shows {link}");
        }
        if name == "README.md" {
            continue;
        }
        let example = text.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next());
        let example = example.unwrap_or_else(|| panic!("{name} has no example"));
        let type_name = name.trim_end_matches(".md");
        assert!(example.contains(&format!(" {type_name}(")), "{name} shows another node:\n{example}");
        let variable = |_: &str| Some("out".to_owned());
        let (file, targets) = (folder.join("graph.ron"), ["out".to_owned()]);
        let options = Options { targets: &targets, variable: &variable, ..Options::new(&file) };
        let checked = check(example, &registry, &options);
        assert!(checked.faults.is_empty(), "{name}: {:?}", checked.faults);
    }
}

#[test]
fn pages_go_where_they_are_asked_to() {
    let desk = Desk::new();
    let ended = desk.run("nodes --format markdown --out pages").expect(0);
    let names: Vec<String> = ended.stdout.lines().map(str::to_owned).collect();
    assert_eq!(names.len(), warploom_nodes::NODES.len() + 1);
    assert!(names.iter().all(|name| Path::new(name).is_file()), "{names:?}");
    let page = String::from_utf8(desk.read("pages/Swirl.md")).expect("UTF-8");
    assert!(page.starts_with("# Swirl\n") && page.contains("| `angle` |") && !page.contains("<img"), "{page}");
    desk.run("nodes --out pages").says(2, &["--format markdown"]);
    desk.write("file", "");
    desk.run("nodes --format markdown --out file/pages").expect(6);
}
