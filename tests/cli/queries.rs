//! `check`, `nodes` and `graph`: what is told without running.

use serde_json::{Value as Json, json};

use crate::desk::{Desk, SMALL_JOB, keys, small_job, text};

fn parsed(stdout: &str) -> Json {
    serde_json::from_str(stdout).unwrap_or_else(|error| panic!("{error}: {stdout}"))
}

#[test]
fn check_opens_no_input() {
    let desk = Desk::new();
    desk.graph("job.ron", SMALL_JOB);
    let ended = desk.run("check job.ron").says(0, &["10 nodes", "1 target"]);
    assert_eq!(ended.stdout, "");
    let ended = desk.run("check job.ron --format json").expect(0);
    assert_eq!(parsed(&ended.stdout), json!({ "schema": 1, "faults": [], "warnings": [] }));
    assert_eq!(desk.files(""), ["job.ron"], "and writes nothing");
}

#[test]
fn check_takes_the_flags_of_run() {
    let desk = small_job();
    desk.run("check job.ron --set bend.angle=30.0 --target bend --frames 1-3").says(0, &["3 of them needed"]);
    desk.run("check job.ron --set bend.angle=\"wide\"").says(2, &["--set:1:"]);
    desk.run("check job.ron --set curve.angle=1.0").says(2, &["curve"]);
    desk.run("check job.ron --target nothing").says(2, &["nothing"]);
    desk.run("check job.ron --frames 1-").says(2, &["1-"]);
    desk.run("check job.ron --set bend.angle=Keys([(1,2.0),(2,3.0)])").says(2, &["no_frames"]);
    desk.run("check job.ron --set bend.angle=Keys([(1,2.0),(2,3.0)]) --frames 1").expect(0);
}

#[test]
fn check_gives_faults_and_warnings_as_json() {
    let desk = Desk::new();
    desk.graph(
        "bad.ron",
        "\"lone\": Checker(),\n\"é\": Checker(),\n\"a\": Checker(cel: 3.0),\n\"out\": Save(image: \"a\", path: \"a.png\")",
    );
    let ended = desk.run("check bad.ron --format json").expect(2);
    assert_eq!(ended.stderr, "");
    let found = parsed(&ended.stdout);
    assert_eq!(keys(&found), ["schema", "faults", "warnings"]);
    let fault =
        found["faults"].as_array().expect("a list").iter().find(|fault| fault["node"] == "a").expect("it is wrong");
    let form = ["code", "node", "parameter", "frame", "file", "line", "column", "message", "hint"];
    assert_eq!(keys(fault), form);
    assert_eq!(
        json!([fault["code"], fault["parameter"], fault["frame"], fault["file"], fault["line"], fault["column"]]),
        json!(["unknown_parameter", "cel", null, desk.path("bad.ron"), 4, 14])
    );
    assert!(text(&fault["hint"]).contains("`cell`"), "{fault}");

    desk.graph("lone.ron", r#""lone": Checker(), "a": Checker(), "out": Save(image: "a", path: "a.png")"#);
    let found = parsed(&desk.run("check lone.ron --format json").expect(0).stdout);
    let warning = &found["warnings"][0];
    assert_eq!(
        (keys(warning), &warning["code"], &warning["node"]),
        (form.to_vec(), &json!("unreached"), &json!("lone"))
    );
    desk.run("check lone.ron").says(0, &["warning[unreached]"]);
    desk.run("run lone.ron --no-cache").says(0, &["warning[unreached]"]);
}

#[test]
fn nodes_are_listed_and_described() {
    let desk = Desk::new();
    let list = desk.run("nodes").expect(0).stdout;
    let names: Vec<&str> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.is_sorted() && ["Arc", "Load", "Save", "FeatureWarp"].iter().all(|name| names.contains(name)));
    assert!(list.lines().all(|line| line.split_whitespace().count() > 2), "each says what it does: {list}");
    let human = desk.run("nodes Lattice").expect(0).stdout;
    assert!(["domain", "cell", "overscan", "px", "Grid"].iter().all(|word| human.contains(word)), "{human}");
    desk.run("nodes Latice").says(2, &["did you mean `Lattice`?"]);
    for name in names {
        let table = desk.run(&format!("nodes {name} --format markdown")).expect(0).stdout;
        assert!(table.starts_with(&format!("# {name}\n")), "{table}");
        let bars = |line: &str| line.replace("\\|", "").matches('|').count();
        let mut columns = 0;
        for line in table.lines() {
            let is_row = line.starts_with('|');
            assert!(!is_row || columns == 0 || columns == bars(line), "{line}");
            columns = if is_row { bars(line) } else { 0 };
        }
    }
}

#[test]
fn node_types_as_json_are_their_manifest() {
    let desk = Desk::new();
    let all = parsed(&desk.run("nodes --format json").expect(0).stdout);
    for node_type in all.as_array().expect("a list") {
        assert_eq!(keys(node_type), ["name", "version", "outputs", "sink", "reads_frame", "schema"]);
        let properties = node_type["schema"]["properties"].as_object().expect("it has parameters");
        for (name, property) in properties {
            let is_required =
                property["x-required"] == true || property["x-port"].is_array() && property["type"] == "string";
            assert!(!is_required || property.get("default").is_none(), "{name} has no default: {property}");
        }
        let one = parsed(&desk.run(&format!("nodes {} --format json", text(&node_type["name"]))).expect(0).stdout);
        assert_eq!(&one, node_type);
    }
    let lattice = parsed(&desk.run("nodes Lattice --format json").expect(0).stdout);
    let properties = &lattice["schema"]["properties"];
    assert!(properties["domain"]["x-port"].as_array().is_some_and(|kinds| kinds.contains(&json!("Image"))));
    assert_eq!(properties["cell"]["x-unit"], "px");
    assert!(properties["overscan"]["default"].is_f64() && properties["cell"].get("default").is_none());
    let arc = parsed(&desk.run("nodes Arc --format json").expect(0).stdout);
    assert!(arc["schema"]["properties"]["angle"]["x-soft"].is_array(), "{arc}");
    assert_eq!(lattice["outputs"], json!([{ "name": "grid", "kind": "Grid" }]));
}

#[test]
fn graphs_are_drawn() {
    let desk = Desk::new();
    desk.graph("job.ron", SMALL_JOB);
    let dot = desk.run("graph job.ron --format dot").expect(0).stdout;
    assert!(dot.starts_with("digraph {\n") && dot.ends_with("}\n"), "{dot}");
    assert_eq!((dot.matches("label=\"").count() - 2 * 11, dot.matches(" -> ").count()), (10, 11), "{dot}");
    let mermaid = desk.run("graph job.ron --format mermaid").expect(0).stdout;
    assert!(mermaid.starts_with("flowchart LR\n"), "{mermaid}");
    assert_eq!((mermaid.matches("<br>").count(), mermaid.matches(" --> ").count()), (10, 11), "{mermaid}");
    let json = parsed(&desk.run("graph job.ron --format json").expect(0).stdout);
    assert_eq!(keys(&json), ["schema", "nodes", "edges", "targets"]);
    assert_eq!((json["nodes"].as_array().map(Vec::len), &json["targets"]), (Some(10), &json!(["out"])));
    let edge = json!({ "from": "parts", "output": "labels", "to": "factor", "port": "features", "linked": false });
    assert!(json["edges"].as_array().is_some_and(|edges| edges.len() == 11 && edges.contains(&edge)), "{json}");
}

#[test]
fn what_writes_and_what_is_asked_for_has_a_form_of_its_own() {
    let desk = Desk::new();
    desk.graph("job.ron", SMALL_JOB);
    let dot = desk.run("graph job.ron --target keep --target out").expect(0).stdout;
    let shape = |id: &str| dot.lines().find(|line| line.contains(&format!("\"{id}\\n"))).map(str::to_owned);
    assert!(shape("out").is_some_and(|line| line.ends_with(", shape=cylinder]")), "{dot}");
    assert!(shape("keep").is_some_and(|line| line.ends_with(", peripheries=2]")), "{dot}");
    assert_eq!((dot.matches("cylinder").count(), dot.matches("peripheries").count()), (1, 1), "{dot}");
    let mermaid = desk.run("graph job.ron --target keep --target out --format mermaid").expect(0).stdout;
    assert!(mermaid.contains("[(\"out<br>Save\")]") && mermaid.contains("[[\"keep<br>FeatureWarp\"]]"), "{mermaid}");
}

#[test]
fn links_are_edges_too() {
    let desk = Desk::new();
    let linked = SMALL_JOB.replace("angle: 60.0", "angle: \"parts.count\"");
    desk.graph("job.ron", &linked);
    let json = parsed(&desk.run("graph job.ron --format json").expect(0).stdout);
    let edge = json!({ "from": "parts", "output": "count", "to": "bend", "port": "angle", "linked": true });
    assert!(json["edges"].as_array().is_some_and(|edges| edges.contains(&edge)), "{json}");
    let dot = desk.run("graph job.ron").expect(0).stdout;
    let line = |text: &str, piece: &str| text.lines().find(|line| line.contains(piece)).map(str::to_owned);
    let linked = line(&dot, "headlabel=\"angle\"").expect("an edge");
    assert!(linked.contains("taillabel=\"count\"") && linked.ends_with("style=dashed]"), "{linked}");
    assert_eq!(dot.matches("style=dashed").count(), 1, "{dot}");
    let mermaid = desk.run("graph job.ron --format mermaid").expect(0).stdout;
    assert_eq!((mermaid.matches(" .-> ").count(), mermaid.matches(" --> ").count()), (1, 11), "{mermaid}");
    assert!(mermaid.contains("-. \"count to angle\" .->"), "{mermaid}");
    desk.graph("bad.ron", r#""a": Chekcer()"#);
    let ended = desk.run("graph bad.ron --format dot").says(2, &["Checker"]);
    assert_eq!(ended.stdout, "");
}
