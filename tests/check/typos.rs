//! One slip in a good graph: the fault stands at the slip, and the first suggestion is what was meant.

use std::collections::BTreeMap;
use std::ops::Range;

use warploom_core::diag::{Fault, Place};
use warploom_core::schema::{PortShape, shown};
use warploom_tests::Random;
use warploom_tests::graphs::{Gives, Good, Piece, Role};

use crate::{NODES, faults_of};

/// Sorts of slips.
const SORTS: usize = 11;

/// A graph with one slip, and what is to be said of it.
struct Slip {
    what: &'static str,
    text: String,
    /// Where the fault must stand, in bytes.
    at: usize,
    /// Characters that must be underlined.
    length: usize,
    code: &'static str,
    /// One of these must be in the hint, or in the message if the code is `syntax`.
    mend: Vec<String>,
}

/// A name with one letter left out, doubled, exchanged with the next or with another.
fn typo(name: &str, random: &mut Random) -> String {
    let mut letters: Vec<char> = name.chars().collect();
    let places: Vec<usize> = (1..letters.len()).filter(|&at| letters[at].is_alphabetic()).collect();
    let at = *random.pick(&places);
    match random.below(4) {
        0 => drop(letters.remove(at)),
        1 => letters.insert(at, letters[at]),
        2 => letters.swap(at - 1, at),
        _ => letters[at] = if letters[at] == 'q' { 'k' } else { 'q' },
    }
    letters.into_iter().collect()
}

impl Slip {
    fn new(
        good: &Good,
        what: &'static str,
        span: &Range<usize>,
        by: &str,
        code: &'static str,
        mend: &[String],
    ) -> Option<Self> {
        let mut text = good.text.clone();
        text.replace_range(span.clone(), by);
        Some(Self { what, text, at: span.start, length: by.chars().count(), code, mend: mend.to_vec() })
    }

    /// A slip of some sort in a piece of its choice, if the graph has one that fits.
    fn of(good: &Good, sort: usize, random: &mut Random) -> Option<Self> {
        let mut fitting = |fits: &dyn Fn(&Piece) -> bool| {
            let pieces: Vec<&Piece> = good.pieces.iter().filter(|piece| fits(piece)).collect();
            if pieces.is_empty() { None } else { Some(*random.pick(&pieces)) }
        };
        let named = |piece: &Piece, role: &Role| piece.role == *role && piece.span.len() >= 4;
        let chosen = |piece: &Piece| matches!(piece.role, Role::Variant(_));
        let (what, code, piece) = match sort {
            0 => ("typo in a type", "unknown_type", fitting(&|piece| named(piece, &Role::Type))?),
            1 => ("typo in a parameter", "unknown_parameter", fitting(&|piece| named(piece, &Role::Parameter))?),
            2 => ("typo in an output", "unknown_output", fitting(&|piece| named(piece, &Role::Output))?),
            3 => ("typo in a choice", "mistyped", fitting(&|piece| chosen(piece) && piece.span.len() >= 4)?),
            4 => ("typo in a reference", "unknown_node", fitting(&|piece| matches!(piece.role, Role::Reference(_)))?),
            5 => ("wrong type", "mistyped", fitting(&|piece| matches!(piece.role, Role::Number(..)))?),
            6 => ("choice in quotes", "mistyped", fitting(&chosen)?),
            7 => ("missing comma", "syntax", fitting(&|piece| piece.role == Role::Comma)?),
            8 => ("swapped port", "wrong_kind", fitting(&|piece| matches!(piece.role, Role::Reference(_)))?),
            10 => ("cycle", "cycle", fitting(&|piece| matches!(piece.role, Role::Reference(_)))?),
            _ => {
                let has_end = |piece: &Piece| matches!(piece.role, Role::Number(min, max) if min.or(max).is_some());
                ("out of range", "out_of_range", fitting(&has_end)?)
            }
        };
        let said = good.said(piece).to_owned();
        let slip = |by: &str, mend: &[String]| Self::new(good, what, &piece.span, by, code, mend);
        match (sort, &piece.role) {
            (0..=4, role) => {
                let by = typo(&said, random);
                let is_a_choice = matches!(role, Role::Variant(names) if names.contains(&by));
                let is_a_name = by == said || is_a_choice || good.made.iter().any(|made| made.id == by);
                if is_a_name { None } else { slip(&by, &[format!("did you mean `{said}`?")]) }
            }
            (5, _) => slip("true", &["left out, `".into(), format!("write {}: ", piece.param)]),
            (6, _) => slip(&format!("\"{said}\""), &[format!("without quotes: {said}")]),
            // The next token takes the comma's place but for the blank between.
            (7, _) => {
                let mut slip = slip("", &[format!("found `{}`", piece.param)])?;
                slip.at += 1;
                slip.length = piece.param.chars().count();
                Some(slip)
            }
            (8, Role::Reference(port)) => swapped(good, piece, port, random),
            (10, _) => turned(good, piece, random),
            (_, Role::Number(min, max)) => {
                let under = min.map(|min| (min - 1.0, min));
                let over = max.map(|max| (max + 1.0, max));
                let (number, nearest) = if random.below(2) == 0 { under.or(over) } else { over.or(under) }?;
                slip(&number.to_string(), &[format!("the nearest allowed is {}", shown(nearest))])
            }
            _ => None,
        }
    }
}

/// Another node made before, whose first output does not fit; any node that fits may be suggested.
fn swapped(good: &Good, piece: &Piece, port: &PortShape, random: &mut Random) -> Option<Slip> {
    // A reference with an output would be an unknown output first.
    if good.text[piece.span.end..].starts_with('.') {
        return None;
    }
    let is_wrong = |node: &usize| good.made[*node].gives.first().is_some_and(|gives| !gives.fits(port));
    let wrong: Vec<usize> = (0..piece.node).filter(is_wrong).collect();
    if wrong.is_empty() {
        return None;
    }
    let other = &good.made[*random.pick(&wrong)];
    let fits = |gives: &&Gives| gives.fits(port);
    let better = other.gives.iter().find(fits).map(|gives| format!("did you mean \"{}.{}\"?", other.id, gives.name));
    let others = good.made.iter().filter(|made| made.gives.iter().any(|gives| gives.fits(port)));
    let mend = better.map_or_else(|| others.map(|made| format!("`{}", made.id)).collect(), |better| vec![better]);
    Slip::new(good, "swapped port", &piece.span, &other.id, "wrong_kind", &mend)
}

/// What feeds each node, by number.
fn feeds(good: &Good) -> Vec<Vec<usize>> {
    let mut feeds = vec![Vec::new(); good.made.len()];
    for piece in good.pieces.iter().filter(|piece| matches!(piece.role, Role::Reference(_))) {
        feeds[piece.node].extend(good.made.iter().position(|made| made.id == good.said(piece)));
    }
    feeds
}

/// An edge turned round: a node takes from one that it feeds, directly or not, or from itself. The cycle is to be told at
/// the type of its first node in the file, with all its nodes in the order in which they feed each other.
fn turned(good: &Good, piece: &Piece, random: &mut Random) -> Option<Slip> {
    if good.text[piece.span.end..].starts_with('.') {
        return None;
    }
    let mut feeds = feeds(good);
    let reaches = |from: usize, feeds: &[Vec<usize>]| {
        let (mut seen, mut open) = (vec![from], vec![from]);
        while let Some(node) = open.pop() {
            for &next in &feeds[node] {
                if !seen.contains(&next) {
                    seen.push(next);
                    open.push(next);
                }
            }
        }
        seen
    };
    let downstream = |node: &usize| !good.made[*node].gives.is_empty() && reaches(*node, &feeds).contains(&piece.node);
    let below: Vec<usize> = (0..good.made.len()).filter(downstream).collect();
    if below.is_empty() {
        return None;
    }
    let end = *random.pick(&below);
    let mut slip = Slip::new(good, "cycle", &piece.span, &good.made[end].id, "cycle", &[])?;
    // What the other references of the node feed is as it was; one of them may name the same.
    let was = good.made.iter().position(|made| made.id == good.said(piece))?;
    let at = feeds[piece.node].iter().position(|&node| node == was)?;
    feeds[piece.node][at] = end;
    let in_cycle = |node: &usize| feeds[*node].iter().any(|&from| reaches(from, &feeds).contains(node));
    let type_at = |node: usize| good.pieces.iter().find(|piece| piece.node == node && piece.role == Role::Type);
    let first =
        (0..good.made.len()).filter(in_cycle).min_by_key(|&node| type_at(node).map(|piece| piece.span.start))?;
    let start = type_at(first)?.span.clone();
    let shift =
        if start.start > piece.span.start { good.made[end].id.len() as isize - piece.span.len() as isize } else { 0 };
    slip.at = start.start.checked_add_signed(shift)?;
    slip.length = start.len();
    slip.mend = vec![format!("cycle: `{}` -> ", good.made[first].id)];
    Some(slip)
}

/// Line and column of a byte, counted the plain way.
fn position(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at];
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    (before.matches('\n').count() + 1, before[start..].chars().count() + 1)
}

/// Where the slip must be underlined, in bytes: a reference from quote to quote, its output with it.
fn underlined(slip: &Slip) -> Range<usize> {
    let (before, behind) = slip.text.split_at(slip.at);
    if !matches!(slip.code, "unknown_node" | "wrong_kind" | "unknown_output") {
        return slip.at..slip.at + behind.chars().take(slip.length).map(char::len_utf8).sum::<usize>();
    }
    before.rfind('"').unwrap_or_default()..slip.at + behind.find('"').unwrap_or_default() + 1
}

fn is_told(slip: &Slip, fault: &Fault) -> bool {
    let expected = underlined(slip);
    let (start, end) = (position(&slip.text, expected.start), position(&slip.text, expected.end));
    let in_message = matches!(slip.code, "syntax" | "cycle");
    let words = if in_message { Some(&fault.message) } else { fault.hint.as_ref() };
    let stands = |place: &Place| (place.line, place.column) == start && place.column + place.length == end.1;
    fault.code.name() == slip.code
        && fault.place.as_ref().is_some_and(stands)
        && words.is_some_and(|words| slip.mend.iter().any(|mend| words.contains(mend.as_str())))
}

/// So many slips, how many of them are told, and the others in words.
fn slips(count: usize, seed: u64) -> (usize, BTreeMap<&'static str, usize>, String) {
    let mut random = Random(seed);
    let (mut told, mut missed) = (0, String::new());
    let mut sorts: BTreeMap<&str, usize> = BTreeMap::new();
    for seed in seed * 1000.. {
        let good = Good::new(seed, &NODES);
        let Some(slip) = Slip::of(&good, seed as usize % SORTS, &mut random) else { continue };
        let checked = faults_of(&slip.text);
        assert!(!checked.faults.is_empty(), "{}\n{}", slip.what, slip.text);
        *sorts.entry(slip.what).or_default() += 1;
        if checked.faults.iter().any(|fault| is_told(&slip, fault)) {
            told += 1;
        } else {
            let line = slip.text.lines().nth(position(&slip.text, slip.at).0 - 1).unwrap_or_default();
            missed += &format!("{}, {:?}: {line}\n{:#?}\n", slip.what, slip.mend, checked.faults);
        }
        if sorts.values().sum::<usize>() == count {
            break;
        }
    }
    (told, sorts, missed)
}

/// Other slips, and more, by `WARPLOOM_SLIPS=COUNT` and `WARPLOOM_SEED=NUMBER`.
#[test]
fn two_hundred_slips_are_told_where_they_are() {
    let number =
        |name: &str, otherwise| std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise);
    let (count, seed) = (number("WARPLOOM_SLIPS", 200), number("WARPLOOM_SEED", 3));
    let (told, sorts, missed) = slips(count as usize, seed);
    println!("{told} of {count}: {sorts:?}\n{missed}");
    assert_eq!(sorts.len(), SORTS, "{sorts:?}");
    assert!(told as u64 * 100 >= count * 95, "{told} of {count}\n{missed}");
}

/// The words a person gets wrong, and what they meant, among all names of the house.
#[test]
fn the_nearest_name_is_what_was_meant() {
    let hint = |line: &str| {
        let text = format!(
            "Graph(version: 1, nodes: {{\"plate\": Constant(), \"plate_bg\": Constant(), \"mask\": Threshold(image: \
             \"plate\", channel: \"A\"), \"parts\": Components(mask: \"mask\"), {line}, \"out\": Save(image: \"plate\", \
             path: \"o.exr\")}})"
        );
        let checked = faults_of(&text);
        assert!(!checked.faults.is_empty(), "{line}");
        checked.faults.into_iter().filter_map(|fault| fault.hint).collect::<Vec<_>>().join("\n")
    };
    let suggests = |line: &str, meant: &str| {
        let hint = hint(line);
        assert!(hint.contains(&format!("did you mean `{meant}`?")), "{line}: {hint}");
    };
    for (wrong, meant) in [
        ("constant", "Constant"),
        ("Resmaple", "Resample"),
        ("FeatureWrap", "FeatureWarp"),
        ("Featurefactor", "FeatureFactor"),
        ("Drawgrid", "DrawGrid"),
        ("Treshold", "Threshold"),
        ("Component", "Components"),
        ("Ovr", "Over"),
        ("Framehold", "FrameHold"),
        ("Latice", "Lattice"),
        ("Sawe", "Save"),
    ] {
        suggests(&format!("\"x\": {wrong}()"), meant);
    }
    for (wrong, meant) in [("colour: 1", "color"), ("sizes: 1", "size"), ("Size: 1", "size"), ("clor: 1", "color")] {
        suggests(&format!("\"x\": Constant({wrong})"), meant);
    }
    for (wrong, meant) in [("plaet", "plate"), ("plate_gb", "plate_bg"), ("Plate", "plate"), ("plat", "plate")] {
        suggests(&format!("\"x\": Over(images: [\"{wrong}\"])"), meant);
    }
    suggests("\"x\": Grow(mask: \"mask.msk\", by: 1)", "mask");
    suggests("\"x\": Grow(mask: \"mask\", by: \"parts.conut\")", "count");
    for (wrong, meant) in
        [("Uniom", "Union"), ("union", "Union"), ("Intersect", "Intersection"), ("Diff", "Difference")]
    {
        suggests(&format!("\"x\": Combine(masks: [\"mask\"], mode: {wrong})"), meant);
        suggests(&format!("\"x\": Combine(masks: [\"mask\"], mode: \"{wrong}\")"), meant);
    }
}
