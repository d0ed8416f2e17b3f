//! `fmt`: what it changes, what it leaves alone, and what it exits with.

use std::io::Write;
use std::process::Stdio;

use crate::desk::{Desk, Ended};

const UGLY: &str = "Graph(version:1, // one\n nodes:{\"a\":Checker(),\"out\":Save(image:\"a\",path:\"a.png\")})";
const NEAT: &str = "Graph(\n    version: 1, // one\n    nodes: {\n        \"a\":   Checker(),\n        \
                    \"out\": Save(image: \"a\", path: \"a.png\"),\n    },\n)\n";

fn text(desk: &Desk, name: &str) -> String {
    String::from_utf8(desk.read(name)).expect("UTF-8")
}

fn piped(desk: &Desk, line: &str, text: &str) -> Ended {
    let mut command = desk.command(line.split_whitespace());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the binary starts");
    child.stdin.take().expect("a pipe").write_all(text.as_bytes()).expect("it reads");
    child.wait_with_output().expect("it ends").into()
}

#[test]
fn files_are_formatted_in_place() {
    let desk = Desk::new();
    let ugly = desk.write("ugly.ron", UGLY);
    desk.write("neat.ron", NEAT);
    let ended = desk.run("fmt ugly.ron neat.ron").expect(0);
    assert_eq!((ended.stdout, ended.stderr), (format!("{}\n", ugly.display()), String::new()));
    assert_eq!((text(&desk, "ugly.ron"), text(&desk, "neat.ron")), (NEAT.to_owned(), NEAT.to_owned()));
    assert_eq!(desk.files(""), ["neat.ron", "ugly.ron"], "and nothing else is there");
}

#[test]
fn check_names_what_would_change() {
    let desk = Desk::new();
    let ugly = desk.write("ugly.ron", UGLY);
    desk.write("neat.ron", NEAT);
    let ended = desk.run("fmt --check ugly.ron neat.ron").says(7, &["1 file to format"]);
    assert_eq!((ended.stdout, text(&desk, "ugly.ron")), (format!("{}\n", ugly.display()), UGLY.to_owned()));
    assert_eq!(desk.run("fmt --check neat.ron").expect(0).stderr, "");
}

#[test]
fn what_does_not_change_is_not_written() {
    let desk = Desk::new();
    let path = desk.write("neat.ron", NEAT);
    let before = path.metadata().expect("it is there").modified().expect("a time");
    std::thread::sleep(std::time::Duration::from_millis(20));
    desk.run("fmt neat.ron").expect(0);
    assert_eq!(path.metadata().expect("it is there").modified().expect("a time"), before);
}

#[test]
fn faults_leave_files_alone_and_others_are_formatted() {
    let desk = Desk::new();
    desk.write("broken.ron", "Graph(\n    version 1,\n)");
    desk.write("ugly.ron", UGLY);
    desk.run("fmt broken.ron missing.ron ugly.ron").says(2, &["broken.ron:2:13", "missing.ron does not exist"]);
    assert_eq!(text(&desk, "broken.ron"), "Graph(\n    version 1,\n)");
    assert_eq!(text(&desk, "ugly.ron"), NEAT);
    desk.write("ugly.ron", UGLY);
    desk.run("fmt --check ugly.ron broken.ron").expect(2);
    // What the graph means is not looked at.
    desk.write("odd.ron", "Graph(nodes:{\"a\":Nothing(b:\"c\")})");
    desk.run("fmt odd.ron").expect(0);
    assert_eq!(text(&desk, "odd.ron"), "Graph(nodes: {\n    \"a\": Nothing(b: \"c\"),\n})\n");
    desk.run("fmt").expect(2);
}

#[test]
fn a_pipe_is_formatted_to_a_pipe() {
    let desk = Desk::new();
    let ended = piped(&desk, "fmt -", UGLY).expect(0);
    assert_eq!((ended.stdout.as_str(), ended.stderr.as_str()), (NEAT, ""));
    assert_eq!(piped(&desk, "fmt -", NEAT).expect(0).stdout, NEAT);
    assert_eq!(piped(&desk, "fmt --check -", UGLY).expect(7).stdout, "<stdin>\n");
    assert_eq!(piped(&desk, "fmt -", "Graph(").says(2, &["<stdin>:1:"]).stdout, "");
    assert!(desk.files("").is_empty());
}

#[cfg(unix)]
#[test]
fn permissions_and_links_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};

    let desk = Desk::new();
    let path = desk.write("graphs/ugly.ron", UGLY);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).expect("they can be set");
    symlink("graphs/ugly.ron", desk.path("link.ron")).expect("a link");
    desk.run("fmt link.ron").expect(0);
    assert_eq!(path.metadata().expect("it is there").permissions().mode() & 0o777, 0o640);
    assert!(desk.path("link.ron").is_symlink());
    assert_eq!(text(&desk, "graphs/ugly.ron"), NEAT);
    assert_eq!(desk.files("graphs"), ["ugly.ron"]);
}
