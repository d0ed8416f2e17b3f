//! Each slip a person makes gives one fault, where that person would look, and costs the other nodes nothing.

use super::super::{Lines, Reading, Ron, has_broken, read};
use super::dice::GRAPHS;

/// A graph with these node lines, the first of them line 4, and behind them a node with a fault, in which reading
/// must have found its feet again.
fn graph(lines: &str) -> String {
    format!("Graph(\n    version: 1,\n    nodes: {{\n{lines}\n        \"last\": Blur(radius: ),\n    }},\n)\n")
}

fn faults(text: &str) -> Vec<String> {
    let lines = Lines::new(text);
    let place = |at| lines.position(at);
    let shown = read(text).faults.into_iter().map(|fault| {
        let (line, column) = place(fault.span.start);
        let hint = fault.hint.map_or(String::new(), |hint| format!(" ({hint})"));
        format!("{line}:{column} {}{hint}", fault.message)
    });
    shown.collect()
}

/// The faults of `lines` in a graph, the last node's being there too.
fn slips(lines: &str) -> Vec<String> {
    let text = graph(lines);
    let mut found = faults(&text);
    let line = text.lines().count() - 2;
    assert_eq!(
        found.pop(),
        Some(format!("{line}:30 a parameter needs a value after `:`, found `)`")),
        "{text}\n{found:#?}"
    );
    found
}

/// The nodes of a graph and whether each was read whole.
fn nodes(reading: &Reading) -> Vec<(String, bool)> {
    let Some(Ron::Struct { fields, .. }) = reading.tree.as_ref().map(|tree| &tree.value) else { return Vec::new() };
    let maps =
        fields.iter().filter_map(|(_, value)| if let Ron::Map(entries) = &value.value { Some(entries) } else { None });
    let texts = maps.flatten().filter_map(|(key, value)| match &key.value {
        Ron::Text(id) => Some((id.clone(), !has_broken(value))),
        _ => None,
    });
    texts.collect()
}

#[test]
fn one_slip_is_one_fault() {
    let slip = |lines: &str, expected: &str| assert_eq!(slips(lines), [expected], "{lines}");
    slip(r#""a": Blur(x: ),"#, "4:14 a parameter needs a value after `:`, found `)`");
    slip(r#""a": Foo(y: 1 z: 2),"#, "4:15 expected `,` or `)` after this value, found `z`");
    slip(r#""a": Foo(y: 1, 2),"#, "4:16 expected a parameter's name, found `2`");
    slip(r#""a": Foo(y: 1,5),"#, "4:15 expected a parameter's name, found `5` (use a decimal point, not a comma)");
    slip(r#""a": Foo(y = 1),"#, "4:12 expected `:` after `y`, found `=` (a name and its value are joined by `:`)");
    slip(r#""a": Foo(x: 1, y 2),"#, "4:18 expected `:` after `y`, found `2`");
    slip(
        r#""a": Foo(1, y: 2),"#,
        "4:14 expected `,` or `)` after this value, found `:` (either every entry has a name or none has)",
    );
    slip(
        r#""a": Foo(x: 1; y: 2),"#,
        "4:14 expected `,` or `)` after this value, found `;` (entries are separated by `,`)",
    );
    slip(r#""a": Foo(x: 60deg),"#, "4:15 expected `,` or `)` after this value, found `deg` (a number carries no unit)");
    slip(r#""a": Foo(x: 1.2.3),"#, "4:13 `1.2.3` is not a number");
    slip(r#""a": Foo(x: 300u8),"#, "4:13 `300u8` does not fit u8");
    slip(
        r#""a": Foo(x: 1'000),"#,
        "4:14 expected `,` or `)` after this value, found `'` (digits stand together, or apart by `_`)",
    );
    slip(r#""a": Foo(x: 90°),"#, "4:15 expected `,` or `)` after this value, found `°` (a number carries no unit)");
    slip(
        r#""a": Foo(x: 1/2),"#,
        "4:14 expected `,` or `)` after this value, found `/` (nothing is computed here: write the number itself)",
    );
    slip(
        r#""a": Foo(x: Mode::Cubic),"#,
        "4:17 expected `,` or `)` after this value, found `:` (a name stands alone, without what leads to it)",
    );
    slip(r#""a": Foo(x := 1),"#, "4:13 expected a value, found `=` (a name and its value are joined by `:`)");
    slip(r#""a" => Foo(x: 1),"#, "4:5 expected `:` after this key, found `=` (a name and its value are joined by `:`)");
    slip(
        r#""a": Foo(x: 1001-1100),"#,
        "4:13 `1001-1100` is not a number (frames stand in double quotes: \"1001-1100\")",
    );
    slip(
        "\"a\": Foo(x: 1), -- remark, with comma\n\"b\": Foo(),",
        "4:17 `--` is not a number (a comment begins with `//`; a number has one sign)",
    );
    slip(r#""a" Foo(x: 1),"#, "4:5 expected `:` after this key, found `Foo`");
    slip(r#""a": Foo("x": 1),"#, "4:10 a parameter's name stands without quotes (write x: ..)");
    slip(r#""a": Foo(a-b: 1),"#, "4:10 `a-b` is not a name (a name is one word of letters, digits and `_`)");
    slip(r#""a": Foo(x: @, y: 1),"#, "4:13 expected a value, found `@`");
    slip(r#""a": Foo(x: Some(1, 2)),"#, "4:21 `Some` takes one value");
    slip(
        "\"a\": Foo(x: 1),\n# remark, with comma\n\"b\": Foo(),",
        "5:1 expected a value, found `# remark, with comma` (a comment begins with `//`)",
    );
    slip(
        r#""a": Foo{x: 1},"#,
        "4:9 expected `,` or `}` after this value, found `{` (what belongs to a name stands in parentheses: Name(..))",
    );
    slip(
        r#""a": com.acme.Glow(x: 1),"#,
        "4:9 expected `,` or `}` after this value, found `.` (text stands in double quotes; a name is one word of letters, digits and `_`)",
    );
    slip(
        r#""a": Foo x: 1),"#,
        "4:10 expected `,` or `}` after this value, found `x` (text stands in double quotes, and what belongs to a name in \
         parentheses: Name(..))",
    );
}

#[test]
fn a_text_without_its_quotes() {
    let slip = |lines: &str, expected: &str| assert_eq!(slips(lines), [expected], "{lines}");
    let never = "this text is never closed (write the closing `\"`)";
    let glued = "(a `\"` is missing before this, or is one too many)";
    slip("\"a\": Load(path: \"x.exr),\n\"b\": Foo(x: 1),", &format!("4:17 {never}"));
    slip("\"a\": Load(path: \"x.exr, y: 1),", &format!("4:17 {never}"));
    slip(r#""a: Load(path: "x"),"#, &format!("4:17 expected `:` after this key, found `x` {glued}"));
    slip(r#"a": Load(path: "x"),"#, &format!("4:2 expected `:` after this key, found `\": Load(path: \"` {glued}"));
    slip(
        r#""a": Foo(x: ["y", z"], w: 3),"#,
        &format!("4:20 expected `,` or `]` after this value, found `\"], w: 3` {glued}"),
    );
    slip(
        r#""a": Foo(x: 'plate', y: 1),"#,
        "4:13 `'plate'` is not one character (text stands in double quotes: \"plate\")",
    );
    slip(
        r#""a": Foo(x: “p, q”, y: 1),"#,
        "4:13 expected a value, found `“p, q”` (text stands in straight double quotes: \"..\")",
    );
    slip(
        r#""a": Foo(x: "\p", y: 1),"#,
        "4:14 `\\p` is no escape (a backslash itself is written `\\\\`; a path can use `/`)",
    );
    slip(
        r#""a": Foo(x: plates/x.exr, y: 1),"#,
        "4:19 expected `,` or `)` after this value, found `/` (text stands in double quotes; a name is one word of letters, \
         digits and `_`)",
    );
}

#[test]
fn a_bracket_left_open() {
    let slip = |lines: &str, expected: &str| assert_eq!(slips(lines), [expected], "{lines}");
    let next = "5:1 expected `)` before `\"b\"`: the `(` of line 4 is not closed";
    slip("\"a\": Foo(x: 1,\n\"b\": Foo(x: 2),", next);
    slip("\"a\": Foo(x: 1\n\"b\": Foo(x: 2),", next);
    slip("\"a\": Foo(k: Keys([(1, 2), (3, 4)],\n\"b\": Foo(x: 2),", next);
    slip(
        "\"a\": Foo(\n    x: (1, 2),\n    y: 1,\n\"b\": Foo(x: 2),",
        "7:1 expected `)` before `\"b\"`: the `(` of line 4 is not closed",
    );
    slip(
        "\"a\": Foo(x: [\"p\",\n\"b\": Foo(x: 2),",
        "5:1 expected `]` before `\"b\"`: the `[` of line 4 is not closed",
    );
    slip("\"a\": Foo(x:\n\"b\": Foo(x: 2),", "5:1 a parameter needs a value after `:`, found `\"b\"`");
    slip("\"a\":\n\"b\": Foo(x: 2),", "5:1 a key needs a value after `:`, found `\"b\"`");
    slip("\"a\": Foo(x: 1, \"b\": Foo(x: 2),", "4:16 expected `)` before `\"b\"`: the `(` of line 4 is not closed");
    slip("\"a\": Foo(v: (1, 2, y: 3),", "4:20 expected `)` before `y`: the `(` of line 4 is not closed");
    slip("\"a\": Foo(k: Keys([(1, 2), (3, 4))),", "4:33 expected `]` before `)`: the `[` of line 4 is not closed");
}

#[test]
fn a_bracket_mistyped_or_too_many() {
    let slip = |lines: &str, expected: &str| assert_eq!(slips(lines), [expected], "{lines}");
    slip("\"a\": Foo(x: 1},", "4:14 expected `)` to close the `(` of line 4, found `}`");
    slip("\"a\": Foo(x: [1, 2), y: 3),", "4:18 expected `]` to close the `[` of line 4, found `)`");
    slip("\"a\": Foo(x: 1)),", "4:15 this `)` closes nothing");
    slip("\"a\": Foo(x: 1]),", "4:14 this `]` closes nothing");
    slip("\"a\": Foo(x: [1]], y: 2),", "4:16 this `]` closes nothing");
}

#[test]
fn the_frame_of_a_graph() {
    let one = |text: &str, expected: &str| assert_eq!(faults(text), [expected], "{text}");
    one(
        "Graph(\n    nodes: {\n        \"a\": Foo(),\n    },\n",
        "1:6 this `(` is never closed (write the closing `)`)",
    );
    one(
        "Graph(\n    nodes: {\n        \"a\": Foo(),\n)\n",
        "4:1 expected `}` before `)`: the `{` of line 2 is not closed",
    );
    one(
        "Graph(\n    nodes: {\n        \"a\": Foo(\n    },\n)\n",
        "4:5 expected `)` before `}`: the `(` of line 3 is not closed",
    );
    one("Graph(nodes: {\"a\": Foo(x: 1", "1:23 this `(` is never closed (write the closing `)`)");
    one("Graph(nodes: {\"a\": Foo(x:", "1:26 a parameter needs a value after `:`, found the end of the file");
    one("Graph(nodes: {}))", "1:17 this `)` closes nothing");
    one("# remark\r\nGraph(x: 1)", "1:1 expected a graph, found `# remark` (a comment begins with `//`)");
    one(
        "Graph(nodes: {\"a\": Foo()};)",
        "1:26 expected `,` or `)` after this value, found `;` (entries are separated by `,`)",
    );
    one("Graph(x: 1 /* , y: 2)", "1:12 this comment is never closed (write the closing `*/`)");
    one("Graph(x: r#\"a\", y: 2)", "1:10 this text is never closed (write the closing `\"#`)");
    one("", "1:1 expected a value, found the end of the file");
    one("// nothing", "1:11 expected a value, found the end of the file");
    one("Graph()\nversion: 1", "2:1 expected nothing more, found `version`");
    one("\u{FEFF}Graph()", "1:1 expected a value, found U+FEFF (this is a byte order mark: save the file without it)");
    one(
        "Graph(x:\u{A0}1)",
        "1:9 expected a value, found U+00A0 (RON does not take this for white space: write a plain space)",
    );
    one(
        "#![enable(x)]\nGraph()",
        "1:11 expected a RON extension: `implicit_some`, `unwrap_newtypes` or another, found `x`",
    );
    one(
        "Graph(\nnodes = {\"a\": Foo(x: 1)})",
        "2:7 expected `:` after `nodes`, found `=` (a name and its value are joined by `:`)",
    );
}

#[test]
fn what_is_not_broken_is_read() {
    let text = r#"Graph(version: 1, nodes: { "a": Blur(x: ), "b": Foo(y: 1 z: 2), "c": Bar(q: [1, 2]), "d" Bar(),
        "e": Bar{q: 1}, "f": Bar(q: 60deg), "g": Bar(q: "x\p"), "h": Bar(), })"#;
    let whole = nodes(&read(text)).into_iter().map(|(id, whole)| format!("{id}{}", if whole { "+" } else { "-" }));
    assert_eq!(whole.collect::<Vec<_>>(), ["a-", "b-", "c+", "d+", "e-", "f-", "g-", "h+"]);
}

#[test]
fn an_unclosed_bracket_names_where_it_was_opened() {
    let text = "{\"a\": Foo(x: 1,\n\"b\": Foo()}";
    let reading = read(text);
    let opened = reading.faults.iter().filter_map(|fault| fault.opened).map(|span| (span.start, span.of(text)));
    assert_eq!(opened.collect::<Vec<_>>(), [(9, "(")]);
}

/// Without any one of its brackets, a graph gives few faults and keeps the nodes that lie elsewhere.
#[test]
fn any_bracket_may_be_missing() {
    let graph = GRAPHS[0];
    let whole = nodes(&read(graph));
    for (at, _) in graph.match_indices(['(', ')', '{', '}']) {
        let mut text = graph.to_owned();
        text.remove(at);
        let reading = read(&text);
        assert!((1..=2).contains(&reading.faults.len()), "{:#?}\n{text}", faults(&text));
        let kept = nodes(&reading).iter().filter(|node| whole.contains(node)).count();
        let in_a_node = graph[at..].starts_with(['(', ')']) && graph[..at].contains('{') && graph[at..].contains('}');
        assert!(!in_a_node || kept + 1 >= whole.len(), "{kept} of {} nodes kept\n{text}", whole.len());
    }
}
