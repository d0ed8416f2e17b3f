//! One slip in a good graph: the fault stands at the slip, and the first suggestion is what was meant.

use std::collections::BTreeMap;
use std::ops::Range;

use warploom_core::diag::Fault;
use warploom_core::schema::PortShape;
use warploom_tests::Random;
use warploom_tests::graphs::{Gives, Good, Piece, Role};

use crate::{NODES, faults_of};

/// A graph with one slip, and what is to be said of it.
struct Slip {
    what: &'static str,
    text: String,
    /// Where the fault must stand, in bytes.
    at: usize,
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
    ) -> Self {
        let mut text = good.text.clone();
        text.replace_range(span.clone(), by);
        Self { what, text, at: span.start, code, mend: mend.to_vec() }
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
            _ => {
                let has_end = |piece: &Piece| matches!(piece.role, Role::Number(min, max) if min.or(max).is_some());
                ("out of range", "out_of_range", fitting(&has_end)?)
            }
        };
        let said = good.said(piece).to_owned();
        let slip = |by: &str, mend: &[String]| Some(Self::new(good, what, &piece.span, by, code, mend));
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
                Some(slip)
            }
            (8, Role::Reference(port)) => swapped(good, piece, port, random),
            (_, Role::Number(min, max)) => {
                let (min, max) = (min.map(|min| min - 1.0), max.map(|max| max + 1.0));
                let number = if random.below(2) == 0 { min.or(max) } else { max.or(min) }?;
                let nearest = if min == Some(number) { number + 1.0 } else { number - 1.0 };
                slip(&number.to_string(), &[format!("the nearest allowed is {nearest}")])
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
    Some(Slip::new(good, "swapped port", &piece.span, &other.id, "wrong_kind", &mend))
}

/// Line and column of a byte, counted the plain way.
fn position(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at];
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    (before.matches('\n').count() + 1, before[start..].chars().count() + 1)
}

fn is_told(slip: &Slip, fault: &Fault) -> bool {
    // A reference stands at its quote.
    let quotes = usize::from(matches!(slip.code, "unknown_node" | "wrong_kind"));
    let mut expected = position(&slip.text, slip.at);
    expected.1 -= quotes;
    if slip.code == "unknown_output" {
        expected.1 -= slip.text[..slip.at].chars().rev().take_while(|&c| c != '"').count() + 1;
    }
    let words = if slip.code == "syntax" { Some(&fault.message) } else { fault.hint.as_ref() };
    fault.code.name() == slip.code
        && fault.place.as_ref().is_some_and(|place| (place.line, place.column) == expected)
        && words.is_some_and(|words| slip.mend.iter().any(|mend| words.contains(mend.as_str())))
}

#[test]
fn two_hundred_slips_are_told_where_they_are() {
    let mut random = Random(3);
    let (mut told, mut missed) = (0, String::new());
    let mut sorts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut count = 0;
    for seed in 1000.. {
        let good = Good::new(seed, &NODES);
        let Some(slip) = Slip::of(&good, seed as usize % 10, &mut random) else { continue };
        let checked = faults_of(&slip.text);
        assert!(!checked.faults.is_empty(), "{}\n{}", slip.what, slip.text);
        *sorts.entry(slip.what).or_default() += 1;
        if checked.faults.iter().any(|fault| is_told(&slip, fault)) {
            told += 1;
        } else {
            let line = slip.text.lines().nth(position(&slip.text, slip.at).0 - 1).unwrap_or_default();
            missed += &format!("{}, {:?}: {line}\n{:#?}\n", slip.what, slip.mend, checked.faults);
        }
        count += 1;
        if count == 200 {
            break;
        }
    }
    assert_eq!(sorts.len(), 10, "{sorts:?}");
    assert!(told >= 190, "{told} of 200\n{missed}");
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
