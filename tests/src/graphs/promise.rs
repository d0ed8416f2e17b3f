//! What holds of every answer of a check, whatever was asked.

use std::path::Path;

use warploom_core::diag::{Code, Fault};
use warploom_core::graph::Checked;

/// The first promise that the answer breaks of a check of `graph.ron`, in words.
pub fn broken(text: &str, checked: &Checked) -> Option<String> {
    if checked.plan.is_some() != checked.faults.is_empty() {
        return Some("a plan stands for no fault".to_owned());
    }
    let lines: Vec<&str> = text.split('\n').collect();
    let told = checked.faults.iter().chain(&checked.warnings);
    let wrong = |fault: &Fault| Some(format!("{}: {fault:?}", of_fault(&lines, fault)?));
    if let Some(wrong) = told.clone().find_map(wrong) {
        return Some(wrong);
    }
    let place = |fault: &Fault| fault.place.as_ref().filter(|place| is_graph(&place.file)).cloned();
    let places = checked.faults.iter().filter_map(place).map(|place| (place.line, place.column));
    (!places.is_sorted()).then(|| "faults stand in file order".to_owned())
}

fn is_graph(file: &Path) -> bool {
    file == Path::new("graph.ron")
}

/// What a fault lacks.
fn of_fault(lines: &[&str], fault: &Fault) -> Option<&'static str> {
    let Some(place) = &fault.place else { return Some("every fault has a place") };
    if is_graph(&place.file) {
        let Some(line) = lines.get(place.line - 1) else { return Some("the line is there") };
        if place.column == 0 || place.column > line.chars().count() + 1 {
            return Some("the column is there");
        }
    }
    if fault.message.is_empty() || fault.code != Code::Syntax && fault.hint.is_none() {
        return Some("every fault has a message and a hint");
    }
    let human = fault.render(false, false, 100);
    let shown = place.file.to_string_lossy().contains(char::is_control) || human.contains(&place.to_string());
    if !shown || human.contains(|c: char| c.is_control() && c != '\n' && c != '\t') {
        return Some("a person reads the place, and no codes of a terminal");
    }
    let json = serde_json::to_value(fault).ok();
    let column = json.as_ref().and_then(|json| json["column"].as_u64());
    (column != Some(place.column as u64)).then_some("a program reads the place")
}
