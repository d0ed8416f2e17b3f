//! Wrong graphs that say themselves what is wrong with them.
//!
//! Every `faults/NAME.ron` holds its expected faults and warnings, and the set must be exact. A comment whose first
//! sign is `^` speaks of the line above it (other such comments aside), at its own column:
//!
//! ```text
//!         "bend": Arc(grid: "grid", angle: 400.0),
//!         //                               ^ out_of_range bend.angle | is 400 deg; it must be | nearest
//! ```
//!
//! that is code, node and parameter (`-` for neither), a part of the message and a part of the hint; no third part
//! means no hint. `//@ 3:1 code ..` names line and column itself, `//@ --set:1:6 code ..` a flag's text. `//+ set`,
//! `//+ target`, `//+ frames`, `//+ env` and `//+ plugins` stand for flags.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use warploom_core::diag::Fault;
use warploom_core::graph::frames::parse_frames;
use warploom_core::graph::{Options, check};
use warploom_tests::graphs::files;

/// A fault as a fixture tells it.
#[derive(Debug)]
struct Expected {
    /// `LINE:COLUMN`, after a flag's name if it stands there.
    place: String,
    code: String,
    subject: String,
    message: String,
    hint: Option<String>,
}

/// A fixture and its flags.
#[derive(Default)]
struct Fixture {
    expected: Vec<Expected>,
    set: Vec<String>,
    targets: Vec<String>,
    frames: Option<Vec<i64>>,
    variables: Vec<(String, String)>,
    plugins: Vec<PathBuf>,
}

impl Fixture {
    fn read(text: &str) -> Self {
        let mut fixture = Self::default();
        let mut above = 0;
        for (index, line) in text.lines().enumerate() {
            let comment = line.trim_start().strip_prefix("//");
            if let Some(told) = comment.and_then(|comment| comment.trim_start().strip_prefix('^')) {
                let column = line.chars().take_while(|&c| c != '^').count() + 1;
                fixture.expected.push(Expected::read(format!("{above}:{column}"), told));
                continue;
            }
            above = index + 1;
            if let Some(told) = comment.and_then(|comment| comment.strip_prefix('@')) {
                let (place, told) = told.trim_start().split_once(' ').expect("a place and a code");
                fixture.expected.push(Expected::read(place.to_owned(), told));
            } else if let Some(flag) = comment.and_then(|comment| comment.strip_prefix('+')) {
                fixture.flag(flag.trim_start());
            }
        }
        fixture
    }

    fn flag(&mut self, flag: &str) {
        let (name, value) = flag.split_once(' ').expect("a flag has a value");
        let value = value.to_owned();
        match name {
            "set" => self.set.push(value),
            "target" => self.targets.push(value),
            "frames" => self.frames = Some(parse_frames(&value).expect("frames")),
            "env" => self.variables.extend(value.split_once('=').map(|(k, v)| (k.to_owned(), v.to_owned()))),
            "plugins" => self.plugins.push(value.into()),
            _ => panic!("there is no flag {name}"),
        }
    }
}

impl Expected {
    fn read(place: String, told: &str) -> Self {
        let mut parts = told.split(" | ").map(str::trim);
        let (code, subject) = parts.next().and_then(|head| head.split_once(' ')).expect("code and subject");
        Self {
            place,
            code: code.to_owned(),
            subject: subject.trim().to_owned(),
            message: parts.next().expect("a part of the message").to_owned(),
            hint: parts.next().map(str::to_owned),
        }
    }

    fn is(&self, fault: &Fault, file: &Path) -> bool {
        let hint = match (&self.hint, &fault.hint) {
            (None, None) => true,
            (Some(part), Some(hint)) => hint.contains(part.as_str()),
            _ => false,
        };
        self.place == place_of(fault, file)
            && self.code == fault.code.name()
            && self.subject == subject_of(fault)
            && fault.message.contains(&self.message)
            && hint
    }
}

fn place_of(fault: &Fault, file: &Path) -> String {
    match &fault.place {
        Some(place) if place.file == file => format!("{}:{}", place.line, place.column),
        Some(place) => place.to_string(),
        None => "nowhere".into(),
    }
}

fn subject_of(fault: &Fault) -> String {
    match (&fault.node, &fault.parameter) {
        (Some(node), Some(parameter)) => format!("{node}.{parameter}"),
        (Some(node), None) if node.is_empty() => "\"\"".into(),
        (Some(node), None) => node.clone(),
        (None, Some(parameter)) => format!("?.{parameter}"),
        (None, None) => "-".into(),
    }
}

/// The fault in the form of a fixture, to be read, judged and copied.
fn told(fault: &Fault, file: &Path) -> String {
    let hint = fault.hint.as_ref().map_or(String::new(), |hint| format!(" | {hint}"));
    let said = format!("{} {} | {}{hint}", fault.code.name(), subject_of(fault), fault.message);
    match &fault.place {
        Some(place) if place.file == file && place.column > 2 => {
            format!("{:4}: //{}^ {said}", place.line, " ".repeat(place.column - 3))
        }
        _ => format!("      //@ {} {said}", place_of(fault, file)),
    }
}

/// What is not as the fixture tells it, in words; nothing if all is.
fn compare(name: &str, text: &str) -> Option<String> {
    let fixture = Fixture::read(text);
    let file = PathBuf::from(name);
    let variable = |name: &str| fixture.variables.iter().find(|(k, _)| k == name).map(|(_, value)| value.clone());
    let options = Options {
        set: &fixture.set,
        targets: &fixture.targets,
        frames: fixture.frames.clone(),
        plugins: &fixture.plugins,
        variable: &variable,
        ..Options::new(&file)
    };
    let checked = check(text, &crate::NODES, &options);
    assert_eq!(checked.plan.is_some(), checked.faults.is_empty(), "{name}: a plan stands for no fault");
    let mut found: Vec<&Fault> = checked.faults.iter().chain(&checked.warnings).collect();
    let mut missing = Vec::new();
    for expected in &fixture.expected {
        match found.iter().position(|fault| expected.is(fault, &file)) {
            Some(at) => {
                found.remove(at);
            }
            None => missing.push(expected),
        }
    }
    if missing.is_empty() && found.is_empty() {
        return None;
    }
    let mut words = format!("\n==== {name}\n");
    missing.iter().for_each(|expected| writeln!(words, "expected {expected:?}").expect("a string takes all"));
    found.iter().for_each(|fault| writeln!(words, "{}", told(fault, &file)).expect("a string takes all"));
    Some(words)
}

#[test]
fn every_fault_stands_where_its_fixture_says() {
    let fixtures = files("check/faults");
    assert!(fixtures.len() >= 75, "only {} fixtures found", fixtures.len());
    let wrong: String = fixtures.iter().filter_map(|(name, text)| compare(name, text)).collect();
    assert!(wrong.is_empty(), "{wrong}");
}

/// Line ends are no part of a column.
#[test]
fn line_ends_of_other_systems_change_nothing() {
    let other = |(name, text): &(String, String)| compare(name, &text.replace('\n', "\r\n"));
    let wrong: String = files("check/faults").iter().filter_map(other).collect();
    assert!(wrong.is_empty(), "{wrong}");
}
