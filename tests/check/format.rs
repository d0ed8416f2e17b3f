//! Formatting says what was said: over all graphs of the repository, and over generated ones with comments all over.

use std::path::{Path, PathBuf};

use warploom_core::graph::{format, read};
use warploom_core::registry::Registry;
use warploom_tests::Random;
use warploom_tests::graphs::Good;

use crate::NODES;

/// All RON files of the repository that people write.
fn files() -> Vec<PathBuf> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = ["../graphs", "golden", "check/good", "check/faults"].map(|name| tests.join(name)).to_vec();
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(extension) if extension == "ron" => files.push(path),
                _ => {}
            }
        }
    }
    files
}

/// The tree of a text, without places; none if it has syntax faults.
fn meaning(text: &str) -> Option<String> {
    let reading = read::read(text);
    let tree = format!("{:?}", reading.tree.filter(|_| reading.faults.is_empty())?);
    let mut pieces = tree.split("span: Span {");
    let first = pieces.next()?.to_owned();
    Some(pieces.fold(first, |tree, piece| tree + piece.split_once('}').map_or("", |(_, rest)| rest)))
}

fn formatted(text: &str) -> String {
    let once = format(Path::new("graph.ron"), text).unwrap_or_else(|faults| panic!("{faults:?}\n{text}"));
    assert_eq!(meaning(text), meaning(&once), "{once}");
    let twice = format(Path::new("graph.ron"), &once).expect("it can be read");
    if let Some(pair) = once.lines().zip(twice.lines()).find(|(once, twice)| once != twice) {
        panic!("formatted twice: {pair:?}\n{text}");
    }
    assert_eq!(once, twice);
    once
}

/// The line comments of a text that has no `//` in its literals.
fn line_comments(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| Some(line[line.find("//")?..].trim_end())).collect()
}

#[test]
fn graphs_of_the_repository_say_the_same() {
    let (mut sound, mut faulty) = (0, 0);
    for path in files() {
        let text = std::fs::read_to_string(&path).expect("it is text");
        if meaning(&text).is_none() {
            assert!(format(&path, &text).is_err(), "{}", path.display());
            faulty += 1;
            continue;
        }
        for text in [text.clone(), text.replace('\n', "\r\n"), text.replace("    ", "\t")] {
            let once = formatted(&text);
            assert_eq!(line_comments(&text), line_comments(&once), "{}", path.display());
            assert_eq!(text.contains("\r\n"), once.contains("\r\n"), "{}", path.display());
        }
        sound += 1;
    }
    assert!(sound > 100 && faulty > 3, "{sound} sound files, {faulty} faulty ones");
}

#[test]
fn graphs_that_are_shown_are_formatted() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    for path in files().iter().filter(|path| path.starts_with(tests.join("../graphs"))) {
        let text = std::fs::read_to_string(path).expect("it is text");
        assert_eq!(formatted(&text), text, "run `warploom fmt {}`", path.display());
    }
}

#[test]
fn comments_anywhere_stay_in_their_order() {
    for seed in 1..=40 {
        let mut random = Random(seed);
        let (text, count) = commented(&Good::new(seed, &NODES as &Registry).text, &mut random);
        let once = formatted(&text);
        let mut rest = once.as_str();
        for number in 0..count {
            let at = rest.find(&format!("<{number}>")).unwrap_or_else(|| panic!("comment {number} is lost\n{once}"));
            rest = &rest[at..];
        }
        assert_eq!(once.matches('<').count(), count);
    }
}

/// The text with white space and numbered comments behind one in four marks, and how many comments there are.
fn commented(text: &str, random: &mut Random) -> (String, usize) {
    let (mut commented, mut count, mut quoted) = (String::new(), 0, false);
    for c in text.chars() {
        commented.push(c);
        quoted ^= c == '"';
        if quoted || !"([{,:)".contains(c) || random.below(4) > 0 {
            continue;
        }
        let comment = match random.below(8) {
            0 => format!(" // <{count}>\n"),
            1 => format!("\n\n\n// <{count}>\n"),
            2 => format!("/* <{count}> */"),
            3 => format!("\n/* <{count}>\n */"),
            4 => format!("\n   /* /* <{count}> */ */ "),
            _ => random.pick(&["\n", "\n\n\n", "  \t "]).to_string(),
        };
        count += comment.matches('<').count();
        commented += &comment;
    }
    (commented, count)
}
