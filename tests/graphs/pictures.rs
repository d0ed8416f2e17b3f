//! The pictures in the documents are those that their graphs draw.

use std::collections::BTreeSet;
use std::path::Path;

use warploom_core::engine::{Engine, Job, Report, Settings};

use super::root;

/// Runs a graph; its files go to `folder`.
fn run(graph: &Path, folder: &Path) -> Report {
    let plan = super::determinism::plan(graph, folder);
    let report = Engine::new(Settings { threads: 2, ..Settings::default() }).run(&plan, &Job::default());
    assert!(report.faults.is_empty(), "{}: {:#?}", graph.display(), report.faults);
    report
}

/// Names of the pictures that documents show: those of figures, or all others.
fn kept(of_figures: bool) -> BTreeSet<String> {
    let entries = std::fs::read_dir(root().join("core/docs/pictures")).expect("a folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    names.filter(|name| document_of(name).is_some() == of_figures).collect()
}

/// The document that shows a figure, by its paper; none for other pictures.
fn document_of(name: &str) -> Option<&'static str> {
    let papers = [("figure", "figures.md"), ("similar", "similarity.md")];
    papers.into_iter().find(|(paper, _)| name.starts_with(paper)).map(|(_, document)| document)
}

/// Names of the files that a run wrote.
fn names(report: &Report) -> impl Iterator<Item = String> {
    report.outputs.iter().map(|output| output.path.file_name().expect("a file").to_string_lossy().into_owned())
}

fn is_shown(document: &str, name: &str) -> bool {
    let text = std::fs::read_to_string(root().join("core/docs").join(document)).expect("readable");
    text.contains(&format!("](pictures/{name})"))
}

#[test]
fn pictures_of_warps_are_drawn_by_their_graph_and_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = run(&root().join("graphs/warps/pictures.ron"), folder.path());
    for name in names(&report) {
        let kept = std::fs::read(root().join("core/docs/pictures").join(&name)).expect("readable");
        let drawn = std::fs::read(folder.path().join(&name)).expect("it is written");
        assert!(kept == drawn, "core/docs/pictures/{name} is not what graphs/warps/pictures.ron draws");
        assert!(is_shown("warps.md", &name), "core/docs/warps.md shows {name}");
    }
    assert_eq!(kept(false), names(&report).collect(), "every picture has a sink");
}

/// Features are solved for in a library that picks instructions by processor: a rounding may go the other way.
#[test]
fn pictures_of_figures_are_drawn_by_their_graphs_and_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let entries = std::fs::read_dir(root().join("graphs/figures")).expect("the figures");
    let mut graphs: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    graphs.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    let mut drawn = BTreeSet::new();
    for graph in &graphs {
        for name in names(&run(graph, folder.path())) {
            let open = |path: &Path| image::open(path).expect("a picture").to_rgb8();
            let (kept, new) = (open(&root().join("core/docs/pictures").join(&name)), open(&folder.path().join(&name)));
            assert_eq!(kept.dimensions(), new.dimensions(), "{name}");
            let worst = kept.iter().zip(new.iter()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(worst <= Some(2), "copy graphs/out/{name} to core/docs/pictures: it differs by {worst:?} of 255");
            let document = document_of(&name).expect("figures are of a paper");
            assert!(is_shown(document, &name), "core/docs/{document} shows {name}");
            drawn.insert(name);
        }
    }
    assert_eq!(kept(true), drawn, "every figure has a graph");
}
