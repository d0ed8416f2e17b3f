//! What ron accepts we accept, and conversely; what a literal means to ron it means to us.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use serde::de::IgnoredAny;

use super::super::{Int, Ron, Span, Spanned, has_broken, read};
use super::dice::{Dice, GRAPHS};

/// The same cases every time, unless the environment asks for others or more (`PROPTEST_RNG_SEED`, `PROPTEST_CASES`).
pub(in crate::graph) fn cases(count: u32) -> ProptestConfig {
    let asked = ProptestConfig::default();
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() { asked.cases } else { count };
    let rng_seed = if let RngSeed::Random = asked.rng_seed { RngSeed::Fixed(7) } else { asked.rng_seed };
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..asked }
}

fn tape() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(any::<u32>(), 0..120)
}

fn agrees(text: &str) -> Result<(), String> {
    let rons = ron::from_str::<IgnoredAny>(text).map(|_| ()).map_err(|fault| fault.to_string());
    let reading = read(text);
    if reading.faults.is_empty() == rons.is_ok() { Ok(()) } else { Err(format!("ron: {rons:?}\nwe: {reading:#?}")) }
}

/// Spans lie in the text and in their parents, in order; `Broken` stands where there is a fault, and nowhere else.
fn is_sound(text: &str) -> Result<(), String> {
    let reading = read(text);
    let spans = reading.faults.iter().flat_map(|fault| [Some(fault.span), fault.opened]).flatten();
    for span in spans {
        lies_in(text, span, Span::new(0, text.len()))?;
    }
    if let Some(fault) = reading.faults.iter().find(|fault| fault.span.start == fault.span.end) {
        expect(fault.span.start as usize == text.len(), || format!("nothing is underlined: {fault:?}"))?;
    }
    expect(reading.faults.is_sorted_by_key(|fault| fault.span.start), || "faults out of order".to_owned())?;
    let Some(tree) = reading.tree else { return expect(!reading.faults.is_empty(), || "no tree, no fault".to_owned()) };
    lies_in(text, tree.span, Span::new(0, text.len()))?;
    nests(text, &tree)?;
    let inside = |span: Span| tree.span.start <= span.start && span.start < tree.span.end;
    let fault_inside = reading.faults.iter().any(|fault| inside(fault.span));
    expect(!fault_inside || has_broken(&tree), || format!("not marked: {:#?} {tree:#?}", reading.faults))?;
    expect(has_broken(&tree) <= !reading.faults.is_empty(), || format!("broken without a fault: {tree:#?}"))
}

fn nests(text: &str, value: &Spanned<Ron>) -> Result<(), String> {
    let mut within = value.span;
    let mut next = |span: Span| {
        lies_in(text, span, within)?;
        within.start = span.end;
        Ok::<(), String>(())
    };
    match &value.value {
        Ron::List(items) | Ron::Tuple { name: None, items } => {
            for item in items {
                next(item.span)?;
                nests(text, item)?;
            }
        }
        Ron::Tuple { name: Some(name), items } => {
            next(name.span)?;
            for item in items {
                next(item.span)?;
                nests(text, item)?;
            }
        }
        Ron::Map(entries) => {
            for (key, value) in entries {
                next(key.span)?;
                next(value.span)?;
                nests(text, key)?;
                nests(text, value)?;
            }
        }
        Ron::Struct { name, fields } => {
            let names = name.iter().map(|name| name.span);
            names.into_iter().try_for_each(&mut next)?;
            for (name, value) in fields {
                next(name.span)?;
                next(value.span)?;
                nests(text, value)?;
            }
        }
        _ => {}
    }
    Ok(())
}

fn lies_in(text: &str, span: Span, parent: Span) -> Result<(), String> {
    let ends = [span.start as usize, span.end as usize];
    let sound = parent.start <= span.start && span.start <= span.end && span.end <= parent.end;
    expect(sound && ends.iter().all(|&at| text.is_char_boundary(at)), || format!("{span:?} not in {parent:?}"))
}

fn expect(holds: bool, message: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(message()) }
}

fn both(text: &str) -> Result<(), TestCaseError> {
    let verdict = agrees(text).and_then(|()| is_sound(text));
    verdict.map_err(|message| TestCaseError::fail(format!("{text:?}\n{message}")))
}

proptest! {
    #![proptest_config(cases(4000))]

    #[test]
    fn ron_and_we_accept_the_same(tape in tape()) {
        both(&Dice::new(&tape).text())?;
    }

    #[test]
    fn ron_and_we_accept_the_same_numbers(tape in prop::collection::vec(any::<u32>(), 0..8)) {
        let number = Dice::new(&tape).number();
        both(&number)?;
        both(&format!("[{number}..{number}]"))?;
        same_number(&number)?;
    }

    #[test]
    fn quoted_text_means_the_same(tape in prop::collection::vec(any::<u32>(), 0..8)) {
        let text = Dice::new(&tape).quoted();
        both(&text)?;
        same_text(&text)?;
    }

    #[test]
    fn any_text_is_read_to_its_end(text in prop::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&text);
        both(&text)?;
    }

    #[test]
    fn ascii_soup_is_read_to_its_end(text in "[\\[\\](){}\"',:/*#\\\\ra-c1. \n]{0,80}") {
        both(&text)?;
    }
}

fn value_of(text: &str) -> Option<Ron> {
    let reading = read(text);
    reading.tree.filter(|_| reading.faults.is_empty()).map(|tree| tree.value)
}

fn same_number(text: &str) -> Result<(), TestCaseError> {
    let ours = value_of(text);
    let float = match ours {
        Some(Ron::Int(int)) => Some(int.as_f64()),
        Some(Ron::Float(float)) => Some(float),
        _ => None,
    };
    if let Ok(theirs) = ron::from_str::<f64>(text) {
        let same = float.is_some_and(|ours| ours.to_bits() == theirs.to_bits() || (ours.is_nan() && theirs.is_nan()));
        prop_assert!(same, "{text}: {ours:?}, ron {theirs}");
    }
    if let Ok(ron::Value::Number(theirs)) = ron::from_str(text) {
        let theirs = theirs.into_f64();
        let same = float.is_some_and(|ours| ours == theirs || (ours.is_nan() && theirs.is_nan()));
        prop_assert!(same, "{text}: {ours:?}, ron {theirs}");
    }
    let int = if let Some(Ron::Int(int)) = ours { Some(int.value()) } else { None };
    if let Ok(theirs) = ron::from_str::<u64>(text) {
        prop_assert_eq!(int, Some(theirs.into()), "{}", text);
    }
    if let Ok(theirs) = ron::from_str::<i64>(text) {
        prop_assert_eq!(int, Some(theirs.into()), "{}", text);
    }
    Ok(())
}

fn same_text(text: &str) -> Result<(), TestCaseError> {
    let ours = value_of(text);
    if let Ok(theirs) = ron::from_str::<String>(text) {
        prop_assert_eq!(&ours, &Some(Ron::Text(theirs)));
    }
    if let Ok(theirs) = ron::from_str::<char>(text) {
        prop_assert_eq!(&ours, &Some(Ron::Char(theirs)));
    }
    if let Ok(ron::Value::Bytes(theirs)) = ron::from_str(text) {
        prop_assert_eq!(&ours, &Some(Ron::Bytes(theirs)));
    }
    Ok(())
}

/// Half of the texts the dice make would prove little if ron refused, or took, nearly all of them.
#[test]
fn the_dice_make_both() {
    let mut state = 1_u32;
    let mut roll = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let accepted = (0..1000).filter(|_| {
        let tape: Vec<u32> = (0..60).map(|_| roll()).collect();
        read(&Dice::new(&tape).text()).faults.is_empty()
    });
    let accepted = accepted.count();
    assert!((250..750).contains(&accepted), "{accepted}");
}

#[test]
fn graphs_are_ron() {
    for graph in GRAPHS {
        assert_eq!(read(graph).faults, []);
        assert_eq!(agrees(graph), Ok(()));
    }
}

#[test]
fn what_long_runs_found() {
    for text in ["(inf..=inf)", "(inf..)", "(inf..inf)", "(a = 1)", "(a..: 1)", "F(\"a\" = 1)", "Some(inf..=1)"] {
        assert_eq!(agrees(text), Ok(()), "{text}");
    }
}

#[test]
fn the_raw_value_of_ron_accepts_the_same_but_for_the_last_line() {
    let raw = |text: &str| ron::from_str::<&ron::value::RawValue>(text).is_ok();
    for text in ["(a: 1)", "[1, 2,]", "{\"a\": Some(()), 'b': b\"x\"}", "1 2", "(a: )", "Some()", "'", "r#a-b"] {
        assert_eq!(read(text).faults.is_empty(), raw(text), "{text}");
    }
    assert!(read("1 // end").faults.is_empty() && !raw("1 // end") && raw("1 // end\n"));
}

#[test]
fn integers_keep_all_digits() {
    let int = |text: &str| if let Some(Ron::Int(int)) = value_of(text) { Some(int) } else { None };
    assert_eq!(int("18446744073709551615"), Some(Int { negative: false, magnitude: u64::MAX }));
    assert_eq!(int("9007199254740993").map(Int::value), Some(9_007_199_254_740_993));
    assert_eq!(int("-9223372036854775808").map(Int::value), Some(i64::MIN.into()));
    assert_eq!(int("0xFFFF_FFFF_FFFF_FFFF").map(|int| int.magnitude), Some(u64::MAX));
    assert_eq!(int("b'\\xff'").map(Int::value), Some(255));
    assert_eq!(int("-0").map(|int| int.as_f64().is_sign_negative()), Some(true));
    assert_eq!(value_of("18446744073709551616"), Some(Ron::Float(18446744073709551616.0)));
    assert_eq!(value_of("0.1f32"), Some(Ron::Float(f64::from(0.1_f32))));
    assert_eq!(value_of("300u8"), None);
}

#[test]
fn nesting_ends_where_ron_ends_it() {
    for depth in 20..140 {
        for (open, inner, close) in
            [("[", "", "]"), ("[", "1", "]"), ("(a:", "( )", ")"), ("Some(", "1", ")"), ("{", "()", ":1}")]
        {
            let text = open.repeat(depth) + inner + &close.repeat(depth);
            assert_eq!(agrees(&text), Ok(()), "{depth} {open}");
        }
    }
    assert_eq!(read(&"[".repeat(100_000)).faults.len(), 1);
    assert_eq!(read(&"Some(".repeat(100_000)).faults.len(), 1);
}
