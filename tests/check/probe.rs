//! Forms of parameters that plugins may have and the house's nodes have not: fields, choices with content, optional
//! ports, whole numbers that change over frames.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::diag::Fault;
use warploom_core::graph::{Checked, Options, check};
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, WritePath};
use warploom_core::registry::{Registry, def};
use warploom_core::value::{Image, Kind};

/// Takes everything.
#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
struct Probe {
    back: Option<In<Image>>,
    number: Option<In<f64>>,
    corner: Corner,
    shape: Brush,
    #[schemars(range(min = 0, max = 9), extend("x-animatable" = true))]
    count: i32,
    #[schemars(range(min = 0.0), extend("x-unit" = "px"))]
    least: f64,
    big: u64,
    names: Vec<String>,
    path: WritePath,
}

#[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
struct Corner {
    #[schemars(range(min = 0.0, max = 1.0))]
    x: f64,
    #[schemars(extend("x-required" = true))]
    name: String,
}

#[derive(Serialize, Deserialize, JsonSchema, Default)]
enum Brush {
    #[default]
    Point,
    Disc(f64),
    Box {
        width: f64,
        height: f64,
    },
}

impl Node for Probe {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image), Output::new("number", Kind::Number)];
    const SINK: bool = true;
    fn compute(&self, _: &Context) -> Result<Outputs, NodeError> {
        Err(NodeError::refused("it is only checked"))
    }
}

fn checked(params: &str) -> Checked {
    let text = format!(
        "Graph(version: 1, frames: \"1-2\", nodes: {{\"a\": Probe(path: \"a.#\"), \"b\": Probe(\n{params}\n)}})"
    );
    let registry = Registry::new(&[def::<Probe>("Probe")]);
    check(&text, &registry, &Options::new(Path::new("graph.ron")))
}

/// "column code: message (hint)" of each fault in the parameters' line.
fn faults(params: &str) -> Vec<String> {
    let told = |fault: &Fault| {
        let place = fault.place.as_ref().expect("a place");
        assert_eq!((fault.node.as_deref(), place.line), (Some("b"), 2), "{fault:#?}");
        let hint = fault.hint.as_deref().unwrap_or_default();
        format!("{} {}: {} ({hint})", place.column, fault.code.name(), fault.message)
    };
    checked(params).faults.iter().map(told).collect()
}

#[test]
fn every_form_is_taken() {
    for params in [
        "path: \"b.#\"",
        "path: \"b.#\", back: None, number: Some(\"a.number\"), corner: (name: \"x\"), shape: Point, names: []",
        "path: \"b.#\", back: \"a\", corner: (x: 0.5, name: \"x\"), shape: Disc(2), names: [\"x\", \"y\"]",
        "path: \"b.#\", shape: Box(width: 1, height: 2.0), count: Keys([(1, 0), (2, 9)]), big: 18446744073709551615",
        "path: \"b.#\", shape: Disc(Keys([(1, 0.5), (2, 1.5)])), count: \"a.number\", corner: (x: \"a.number\", name: \"\")",
    ] {
        assert_eq!(checked(params).faults, [], "{params}");
    }
}

#[test]
fn faults_inside_fields_and_choices() {
    let one = |params: &str, expected: &[&str]| {
        assert_eq!(faults(&format!("path: \"b.#\", {params}")), expected, "{params}");
    };
    one(
        r#"corner: (nme: "x", x: 2, x: inf)"#,
        &[
            r#"22 missing_parameter: `corner` needs a field `name` (write name: "..")"#,
            "23 unknown_parameter: `corner` has no field `nme` (did you mean `name`?)",
            "39 duplicate_parameter: `x` is given twice (keep one of them)",
            r#"42 not_finite: `corner.x` is inf; it must be finite: a number from 0 to 1 (write corner: (x: 1, name: ".."))"#,
        ],
    );
    one("corner: ()", &[r#"22 missing_parameter: `corner` needs a field `name` (write name: "..")"#]);
    one(
        "corner: [1, 2]",
        &[
            r#"22 mistyped: `corner` takes fields in parentheses: x, name, found a list of 2 (write corner: (x: 1, name: ".."))"#,
        ],
    );
    one(
        "shape: Dsc(1.0)",
        &["21 mistyped: `shape` takes one of `Point`, `Disc`, `Box`, found `Dsc` (did you mean `Disc`?)"],
    );
    one("shape: Disc", &["21 mistyped: `shape` takes one of `Point`, `Disc`, `Box`, found `Disc` (write Disc(1))"]);
    one(
        "shape: Disc(1, 2)",
        &["21 mistyped: `shape` takes one of `Point`, `Disc`, `Box`, found `Disc(..)` (write Disc(1))"],
    );
    one(
        "shape: Point(1)",
        &["21 mistyped: `shape` takes one of `Point`, `Disc`, `Box`, found `Point(..)` (without parentheses: Point)"],
    );
    one(
        r#"shape: "Point""#,
        &[
            r#"21 mistyped: `shape` takes one of `Point`, `Disc`, `Box`, found the text "Point" (without quotes: Point)"#,
        ],
    );
    one(
        "shape: Box(width: true, heigt: 1)",
        &[
            "32 mistyped: `shape.Box.width` takes a number, found `true` (left out, `shape` is Point)",
            "38 unknown_parameter: `shape.Box` has no field `heigt` (did you mean `height`?)",
        ],
    );
    one(
        "count: Keys([(1, 10), (2, 5.5)])",
        &[
            "31 out_of_range: `count` is 10; it must be a whole number from 0 to 9 (the nearest allowed is 9)",
            "40 mistyped: `count` takes a whole number from 0 to 9, found `5.5` (give a whole number, without a point)",
        ],
    );
    one(
        "count: 10",
        &["21 out_of_range: `count` is 10; it must be a whole number from 0 to 9 (the nearest allowed is 9)"],
    );
    one(
        r#"count: "a""#,
        &[
            r#"21 wrong_kind: `count` takes a number, or a node that gives Number; `a` gives Image (did you mean "a.number"?)"#,
        ],
    );
    one(
        "least: -1",
        &["21 out_of_range: `least` is -1 px; it must be a number, at least 0 px (the nearest allowed is 0)"],
    );
    one(
        "least: NaN",
        &["21 not_finite: `least` is NaN; it must be finite: a number, at least 0 px (left out, `least` is 0)"],
    );
    one("big: -1", &["19 out_of_range: `big` is -1; it must be a whole number, at least 0 (the nearest allowed is 0)"]);
    one(
        r#"names: ("x",)"#,
        &[
            "21 mistyped: `names` takes a list in brackets, each item text in double quotes, found one value in parentheses (use brackets: [\"..\", ..])",
        ],
    );
    one(
        r#"names: ["x", 5, y]"#,
        &[
            "27 mistyped: `names` takes text in double quotes, found `5` (left out, `names` is [])",
            r#"30 mistyped: `names` takes text in double quotes, found `y` (put it in double quotes: "y")"#,
        ],
    );
    one(
        r#"back: ["a"]"#,
        &["20 mistyped: `back` takes a node that gives Image, found a list of 1 (connect one node, without brackets)"],
    );
    one(
        "back: Some(5)",
        &[
            r#"25 mistyped: `back` takes a node that gives Image, found `5` (name the node in double quotes: "node" or "node.port")"#,
        ],
    );
    one(
        "back: nope",
        &[
            r#"20 mistyped: `back` takes a node that gives Image, found `nope` (nodes are named in double quotes: "nope")"#,
        ],
    );
    one(
        r#"number: "a""#,
        &[r#"22 wrong_kind: `number` takes a node that gives Number; `a` gives Image (did you mean "a.number"?)"#],
    );
    one(
        r#"number: "a.image""#,
        &[
            r#"22 wrong_kind: `number` takes a node that gives Number; `a.image` gives Image (did you mean "a.number"?)"#,
        ],
    );
}
