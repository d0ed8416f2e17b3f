//! Good graphs have no fault, and no mutation of one upsets the check.

use std::collections::BTreeSet;
use std::path::Path;

use warploom_core::diag::{Code, Fault};
use warploom_core::graph::{Checked, Options, check};

use crate::fixtures::graphs;
use warploom_tests::Random;

use crate::generate::Good;
use crate::{NODES, faults_of};

#[test]
fn sixty_graphs_check_clean() {
    let mut used = BTreeSet::new();
    for seed in 1..=60 {
        let good = Good::new(seed, &NODES);
        let checked = faults_of(&good.text);
        assert!(checked.faults.is_empty(), "{}\n{:#?}", good.text, checked.faults);
        assert!(checked.warnings.iter().all(|warning| warning.code == Code::Unreached), "{:#?}", checked.warnings);
        let plan = checked.plan.expect("a graph without faults has a plan");
        assert_eq!(plan.nodes.len(), good.made.len());
        used.extend(plan.nodes.iter().map(|node| node.node_type.name.to_string()));
    }
    let all: BTreeSet<String> = NODES.iter().map(|node_type| node_type.name.to_string()).collect();
    assert_eq!(used, all, "sixty graphs use every node type");
}

#[test]
fn graphs_of_the_folder_check_clean() {
    let good = graphs("good");
    assert!(good.len() >= 2);
    for (name, text) in good {
        for text in [text.clone(), text.replace('\n', "\r\n"), text.replace("    ", "\t")] {
            let checked = faults_of(&text);
            assert!(checked.faults.is_empty() && checked.warnings.is_empty(), "{name}\n{:#?}", checked.faults);
        }
    }
}

/// What must hold of every answer, whatever the text.
fn hold(text: &str, checked: &Checked) {
    assert_eq!(checked.plan.is_some(), checked.faults.is_empty(), "{text}");
    for fault in checked.faults.iter().chain(&checked.warnings) {
        let place = fault.place.as_ref().expect("every fault has a place");
        let line = text.split('\n').nth(place.line - 1).expect("the line is there");
        assert!(place.column >= 1 && place.column <= line.chars().count() + 1, "{place}\n{text}");
        assert!(fault.code == Code::Syntax || fault.hint.is_some(), "{fault:#?} has no hint\n{text}");
        assert!(!fault.message.is_empty());
        let place_shown = format!("graph.ron:{}:{}", place.line, place.column);
        let rendered = fault.render(false, false, 100);
        assert!(rendered.contains(&place_shown), "{place_shown}\n{rendered}");
    }
    let places: Vec<(usize, usize)> = checked.faults.iter().map(at).collect();
    assert!(places.is_sorted(), "faults stand in file order: {places:?}\n{text}");
}

fn at(fault: &Fault) -> (usize, usize) {
    fault.place.as_ref().map_or((0, 0), |place| (place.line, place.column))
}

/// Tokens, roughly: words, texts, numbers, single signs.
fn tokens(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    for (at, c) in text.char_indices() {
        let before = text[..at].chars().next_back();
        match found.last_mut() {
            Some(last) if is_word(c) && before.is_some_and(is_word) => last.end = at + c.len_utf8(),
            _ if c.is_whitespace() => {}
            _ => found.push(at..at + c.len_utf8()),
        }
    }
    found
}

/// One to three tokens deleted, doubled, replaced by another or moved.
fn token_mutation(text: &str, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..1 + random.below(3) {
        let tokens = tokens(&text);
        if tokens.is_empty() {
            break;
        }
        let (at, other) = (random.pick(&tokens).clone(), random.pick(&tokens).clone());
        let foreign =
            *random.pick(&["NaN", "\"", "Keys([(1, 2)])", "'", "(", "[", "{", "}", ",", "-1e400", "Some(1)", "é"]);
        let other = text[other].to_owned();
        match random.below(5) {
            0 => text.replace_range(at, ""),
            1 => text.insert_str(at.end, &other),
            2 => text.replace_range(at, &other),
            3 => text.insert_str(at.start, foreign),
            _ => text.replace_range(at, foreign),
        }
    }
    text
}

/// One to three bytes deleted, inserted, replaced or doubled; what is no UTF-8 then becomes a sign of its own.
fn byte_mutation(text: &str, random: &mut Random) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..1 + random.below(3) {
        let at = random.below(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        match random.below(4) {
            0 => drop(bytes.remove(at)),
            1 => bytes.insert(at, random.next() as u8),
            2 => bytes[at] = random.next() as u8,
            _ => {
                let end = (at + 1 + random.below(20)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn thousands_of_mutations_panic_nowhere() {
    let mut texts: Vec<String> = (1..=30).map(|seed| Good::new(seed, &NODES).text).collect();
    texts.extend(graphs("good").into_iter().map(|(_, text)| text));
    let mut random = Random(7);
    let mut wrong = 0;
    for case in 0..4000 {
        let text = random.pick(&texts);
        let text = if case % 2 == 0 { token_mutation(text, &mut random) } else { byte_mutation(text, &mut random) };
        let checked = faults_of(&text);
        hold(&text, &checked);
        wrong += usize::from(!checked.faults.is_empty());
    }
    assert!(wrong > 3000, "mutations do harm: {wrong}");
}

#[test]
fn mutated_flags_panic_nowhere() {
    let good = Good::new(5, &NODES);
    let id = &good.made[0].id;
    let flags = [format!("{id}.size=(64, Keys([(1, 2)]))"), format!("{id}.size = [\"é\", 'x', r#\"a\"#]")];
    let mut random = Random(11);
    for case in 0..1000 {
        let flag = random.pick(&flags);
        let flag = if case % 2 == 0 { token_mutation(flag, &mut random) } else { byte_mutation(flag, &mut random) };
        let set = [flag];
        let checked = check(&good.text, &NODES, &Options { set: &set, ..Options::new(Path::new("graph.ron")) });
        assert_eq!(checked.plan.is_some(), checked.faults.is_empty());
        for fault in &checked.faults {
            let place = fault.place.as_ref().expect("every fault has a place");
            let text = if place.file == Path::new("--set") { set[0].as_str() } else { good.text.as_str() };
            assert!(place.line <= text.split('\n').count(), "{place}: {text}");
            assert!(!fault.render(false, false, 100).is_empty());
        }
    }
}
