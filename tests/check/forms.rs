//! How a fault reads: to a program, and to a person.

use std::path::Path;

use warploom_core::diag::{Code, Fault};
use warploom_core::graph::{Options, check};

use crate::{NODES, faults_of};

const KEYS: [&str; 9] = ["code", "node", "parameter", "frame", "file", "line", "column", "message", "hint"];

fn keys(fault: &Fault) -> Vec<String> {
    let json = serde_json::to_value(fault).expect("a fault is JSON");
    json.as_object().expect("an object").keys().cloned().collect()
}

#[test]
fn a_fault_is_a_flat_object() {
    let checked = faults_of("Graph(version: 1, nodes: {\n  \"é\u{1}\": Arc(angle: 400),\n})");
    assert!(checked.faults.len() > 2);
    checked.faults.iter().for_each(|fault| assert_eq!(keys(fault), KEYS));
    assert_eq!(keys(&Fault::new(Code::Panic, "nowhere")), KEYS);
    let range = checked.faults.iter().find(|fault| fault.code == Code::OutOfRange).expect("the angle");
    let json = serde_json::to_value(range).expect("a fault is JSON");
    let expected = serde_json::json!({
        "code": "out_of_range", "node": "é\u{1}", "parameter": "angle", "frame": null, "line": 2,
        "file": std::path::absolute("graph.ron").expect("a working folder"),
        "column": 20, "message": "`angle` is 400 deg; it must be a number from -360 to 360 deg",
        "hint": "the nearest allowed is 360",
    });
    assert_eq!(json, expected);
    let nowhere = serde_json::to_value(Fault::new(Code::Panic, "nowhere")).expect("a fault is JSON");
    assert!(["file", "line", "column", "node", "hint"].iter().all(|key| nowhere[*key].is_null()));
}

fn rendered(text: &str) -> String {
    let faults = faults_of(text).faults;
    faults.iter().map(|fault| fault.render(false, false, 100) + "\n").collect()
}

#[test]
fn a_person_reads_what_where_and_the_mend() {
    let text = r#"Graph(
    version: 1,
    nodes: {
        "plate": Constant(),
        "größe": Constant(),  "grid": Lattice(domain: "plaet", cell: 0.05),
		"tab":	Threshold(image: "plate",	chanel: "A"),
        "out": Save(image: "plate", path: "out.exr")
        "loop": Over(images: ["plate", "loop"]),
    },
)
"#;
    assert_eq!(rendered(text), include_str!("rendered/graph.txt"));
}

#[test]
fn a_flag_is_shown_like_a_file() {
    let text = "Graph(version: 1, nodes: {\"card\": Checker(), \"out\": Save(image: \"card\", path: \"out.exr\")})";
    let set = ["card.cell=0".to_owned(), "crad.cell=1".to_owned()];
    let checked = check(text, &NODES, &Options { set: &set, ..Options::new(Path::new("graph.ron")) });
    let rendered: String = checked.faults.iter().map(|fault| fault.render(false, false, 100) + "\n").collect();
    assert_eq!(rendered, include_str!("rendered/flags.txt"));
}

/// What is known of a link only when its value arrives is told with value, range and unit, where the link stands.
#[test]
fn a_linked_number_is_held_to_its_range() {
    let text = r#"Graph(version: 1, frames: "1-2", nodes: {
        "card": Checker(),
        "mask": Threshold(image: "card", channel: "A"),
        "parts": Components(mask: "mask"),
        "grid": Lattice(domain: "card", cell: "parts.count"),
        "bend": Arc(grid: "grid", angle: Keys([(1, 0.0), (2, 60.0)])),
        "warped": Resample(image: "card", warp: "bend"),
        "out": Save(image: "warped", path: "out.####.exr"),
    })"#;
    let plan = faults_of(text).plan.expect("no fault");
    let grid = plan.node("grid").expect("it is there");
    assert!(plan.nodes[grid].is_static && !plan.nodes[plan.node("bend").expect("it is there")].is_static);
    assert!(plan.params_at(grid, None, &[Some(5.0)]).is_ok());
    for (value, code, message) in [
        (0.0, Code::OutOfRange, "`cell` comes to 0 px here; it must be 0.1 to 65536 px"),
        (f64::NAN, Code::NotFinite, "`cell` comes to NaN px here; it must be 0.1 to 65536 px"),
    ] {
        let fault = plan.params_at(grid, None, &[Some(value)]).expect_err("out of range");
        assert_eq!((fault.code, fault.message.as_str()), (code, message));
        let place = fault.place.expect("a place");
        assert_eq!((place.line, place.column), (5, 47));
    }
}

/// `#` in the name of the graph's own folder is no frame number.
#[test]
fn a_folder_may_be_named_with_a_number_sign() {
    let text = r#"Graph(version: 1, frames: "1-2", nodes: {
        "card": Load(path: "card.##.exr"),
        "out": Save(image: "card", path: "out.exr"),
        "last": Save(image: "card", path: "out.#.exr"),
    })"#;
    let file = Path::new("/shots/take#3/graph.ron");
    let faults = check(text, &NODES, &Options::new(file)).faults;
    assert_eq!(faults.len(), 1, "{faults:#?}");
    assert_eq!((faults[0].code, faults[0].node.as_deref()), (Code::NeedsFramePattern, Some("out")));
    let good = text.replace("out.exr", "one.#.exr");
    let plan = check(&good, &NODES, &Options::new(file)).plan.expect("no fault");
    let paths: Vec<String> = (0..3)
        .map(|node| plan.params_at(node, Some(7), &[]).expect("constant")["path"].as_str().expect("a path").to_owned())
        .collect();
    assert_eq!(paths, ["/shots/take#3/card.07.exr", "/shots/take#3/one.7.exr", "/shots/take#3/out.7.exr"]);
}
