//! Small texts as they come out, and what holds for every text.

use std::path::Path;

use proptest::prelude::*;

use super::{format, same_tokens};
use crate::graph::read::tests::arbiter::cases;
use crate::graph::read::tests::dice::Dice;
use crate::graph::read::{Ron, Spanned, read};

fn formatted(text: &str) -> String {
    format(Path::new("graph.ron"), text).unwrap_or_else(|faults| panic!("{text}\n{faults:?}"))
}

/// Checks that `text` comes out as `expected`, which stays as it is.
#[track_caller]
fn becomes(text: &str, expected: &str) {
    assert_eq!(formatted(text), expected);
    assert_eq!(formatted(expected), expected);
}

#[test]
fn one_node_a_line_and_values_in_a_column() {
    becomes(
        "Graph(version:1,nodes:{\"a\":Load(path:\"a.png\"),\"longer\" : Over( images : [\"a\",\"a\",] )})",
        "Graph(\n    version: 1,\n    nodes: {\n        \"a\":      Load(path: \"a.png\"),\n        \
         \"longer\": Over(images: [\"a\", \"a\"]),\n    },\n)\n",
    );
}

#[test]
fn blank_lines_part_blocks() {
    becomes(
        "{\n\n\n1:a,\n22:b,\n\n\n333:c,\n// of 4\n4:d,\n\n// alone\n\n55555:e\n\n}",
        "{\n    1:  a,\n    22: b,\n\n    333: c,\n    // of 4\n    4:   d,\n\n    // alone\n\n    55555: e,\n}\n",
    );
}

#[test]
fn a_very_long_key_stands_for_itself() {
    let long = "k".repeat(40);
    becomes(&format!("{{a:1,bb:2,{long}:3}}"), &format!("{{\n    a:  1,\n    bb: 2,\n    {long}: 3,\n}}\n"));
}

#[test]
fn long_calls_have_a_parameter_a_line() {
    let long = "x".repeat(60);
    becomes(
        &format!("{{\"a\": Call(one: \"{long}\", two: \"{long}\")}}"),
        &format!("{{\n    \"a\": Call(\n        one: \"{long}\",\n        two: \"{long}\",\n    ),\n}}\n"),
    );
    // 120 columns fit, 121 do not.
    let exact = "x".repeat(120 - "    \"a\": Call(one: \"\"),".len());
    becomes(&format!("{{\"a\":Call(one:\"{exact}\")}}"), &format!("{{\n    \"a\": Call(one: \"{exact}\"),\n}}\n"));
    becomes(
        &format!("{{\"a\":Call(one:\"{exact}x\")}}"),
        &format!("{{\n    \"a\": Call(\n        one: \"{exact}x\",\n    ),\n}}\n"),
    );
}

#[test]
fn items_fill_lines() {
    let points: Vec<String> = (100..120).map(|n| format!("({n}.5, 1.0)")).collect();
    let text = format!("Polygon(points: [{}])", points.join(", "));
    let lines = [&points[..8], &points[8..16], &points[16..]].map(|line| format!("    {},\n", line.join(", ")));
    becomes(&text, &format!("Polygon(points: [\n{}])\n", lines.concat()));
}

#[test]
fn what_was_opened_stays_open() {
    becomes("Call(\na: 1, b: 2)", "Call(\n    a: 1,\n    b: 2,\n)\n");
    becomes("Call(a: 1,\n\n b: 2,\n)", "Call(a: 1, b: 2)\n");
    becomes("[\n1, 2,\n3]", "[\n    1, 2,\n    3,\n]\n");
    becomes("Keys(\n[(1, 2.0)\n,(3,4.0)])", "Keys([(1, 2.0), (3, 4.0)])\n");
    becomes("Keys(\n[\n(1, 2.0)\n,(3,4.0)])", "Keys([\n    (1, 2.0), (3, 4.0),\n])\n");
    becomes("Some (\n( 1 , ) )", "Some((1))\n");
    becomes("( \n )", "()\n");
}

#[test]
fn comments_stay_with_what_they_are_about() {
    becomes(
        "// first\n\nGraph( // the graph\n version: 1, // one\n frames: \"1-2\" // two\n, /* nodes */ nodes: { // none\n} // last\n)\n// end",
        "// first\n\nGraph( // the graph\n    version: 1,    // one\n    frames: \"1-2\", // two\n    /* nodes */ nodes: { // none\n    \
         }, // last\n)\n// end\n",
    );
    becomes("[1/*a*/,2,/*b*/3,/*c*/]//d", "[1 /*a*/, 2, /*b*/ 3 /*c*/] //d\n");
    becomes("[1,//a\n//b\n2\n//c\n,//d\n]", "[\n    1, //a\n    //b\n    2,\n    //c\n    //d\n]\n");
    becomes("[1\n//a\n, 2]", "[\n    1,\n    //a\n    2,\n]\n");
    becomes("{a: // why\nb(\nc: 1)}", "{\n    a: // why\n        b(\n            c: 1,\n        ),\n}\n");
    becomes("Call(/*none*/)", "Call(/*none*/)\n");
    becomes(
        "{a /*1*/ : /*2*/ b, c: // why\nd(e: 1)}",
        "{\n    a /*1*/: /*2*/ b,\n    c:       // why\n        d(e: 1),\n}\n",
    );
}

#[test]
fn comments_behind_stand_in_a_column_while_there_is_room() {
    becomes("{a:1,//x\nbb:22,//y\n\nc:3,//z\n}", "{\n    a:  1,  //x\n    bb: 22, //y\n\n    c: 3, //z\n}\n");
    let long = "y".repeat(80);
    let text = format!("[\n    1, //{long}\n    \"{long}\", //y\n]\n");
    becomes(&text, &text);
}

#[test]
fn literals_stay_as_they_are_written() {
    let said = "[1_000, 0x10, 1e-3, +3, -.5, 0..b'a', ..=5, r#\"a \"b\"\"#, \"\\x41\\u{e9}\", '\\'', b\"\\xff\", r#type, inf, -NaN]";
    becomes(said, &format!("{said}\n"));
    becomes("[\"two\nlines\",1]", "[\n    \"two\nlines\",\n    1,\n]\n");
    becomes("/* two\n   lines */ 1", "/* two\n   lines */ 1\n");
    becomes(
        "#![enable(implicit_some)]#![type = \"a]\"]\nSome  5",
        "#![enable(implicit_some)]\n#![type = \"a]\"]\nSome 5\n",
    );
}

#[test]
fn a_text_keeps_its_line_ends() {
    becomes("{a:1,//x\r\nb:\"\n\"}", "{\r\n    a: 1, //x\r\n    b: \"\n\",\r\n}\r\n");
}

#[test]
fn faults_are_told_and_nothing_else_happens() {
    let faults = format(Path::new("graph.ron"), "Graph(\n    version 1,\n)").expect_err("the colon is missing");
    let places: Vec<_> =
        faults.iter().map(|fault| fault.place.as_ref().map(|place| (place.line, place.column))).collect();
    assert_eq!(places, [Some((2, 13))]);
    assert!(format(Path::new("graph.ron"), "\u{FEFF}Graph()").is_err());
    assert!(format(Path::new("graph.ron"), "// nothing").is_err());
}

#[test]
fn a_change_of_what_is_said_is_noticed() {
    assert!(same_tokens("[1,\n2,] // a", "[1, 2] // a\n"));
    for other in ["[1, 3] // a", "[1, 2]", "[1 2] // a", "[2, 1] // a", "[1, 0x2] // a", "[1, 2] // b"] {
        assert!(!same_tokens("[1, 2] // a", other), "{other}");
    }
}

/// The tree without places.
fn meaning(value: &Spanned<Ron>) -> String {
    let shown = format!("{value:?}");
    let mut pieces = shown.split("span: Span {");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |text, piece| text + piece.split_once('}').map_or("", |(_, rest)| rest))
}

fn holds(text: &str) -> Result<(), TestCaseError> {
    let reading = read(text);
    let Ok(once) = format(Path::new("graph.ron"), text) else {
        prop_assert!(!reading.faults.is_empty());
        return Ok(());
    };
    let again = read(&once);
    prop_assert!(reading.faults.is_empty() && again.faults.is_empty(), "{text}\n{once}");
    prop_assert_eq!(reading.tree.as_ref().map(meaning), again.tree.as_ref().map(meaning), "{}\n{}", text, once);
    prop_assert!(same_tokens(text, &once));
    prop_assert_eq!(&format(Path::new("graph.ron"), &once).expect("it has no fault"), &once, "{}", text);
    let ends = |line: &str| line.ends_with(' ');
    prop_assert!(text.contains(['"', '*']) || !once.lines().any(ends), "white space ends a line of {once:?}");
    Ok(())
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn every_text_keeps_what_it_says(tape in prop::collection::vec(any::<u32>(), 0..160)) {
        holds(&Dice::new(&tape).document())?;
        holds(&Dice::new(&tape).text())?;
    }

    #[test]
    fn no_text_upsets_it(text in "[ \n\r\t(){},:/*\"'#!rb\\[\\]a1.-]{0,40}") {
        holds(&text)?;
    }
}
