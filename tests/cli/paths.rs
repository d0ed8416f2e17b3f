//! Where paths start, what they may hold, and variables in them.

use std::path::{Path, PathBuf};

use crate::desk::{Desk, Ended, SMALL_JOB, small_job};

/// Standard output names just these files, in whatever order they were done.
fn written(ended: &Ended, files: &[PathBuf]) {
    let mut lines: Vec<&Path> = ended.stdout.lines().map(Path::new).collect();
    let mut files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    lines.sort();
    files.sort();
    assert_eq!(lines, files);
}

#[test]
fn paths_in_a_graph_start_at_it_and_flags_where_one_is() {
    let desk = small_job();
    desk.graph("shots/one/job.ron", &SMALL_JOB.replace("\"plate.png\"", "\"../../plate.png\""));
    let line =
        "run shots/one/job.ron --set matte.path=\"../../matte.png\" --dump grid=grid.json --report r.json --cache here";
    let ended = desk.run(line).expect(0);
    written(&ended, &[desk.path("shots/one/out/small.png"), desk.path("grid.json")]);
    assert!(desk.path("shots/one/out/small.png").exists(), "the output lies beside the graph");
    assert!(["grid.json", "r.json", "here"].iter().all(|name| desk.path(name).exists()), "flags start here");
    assert_eq!(desk.files("shots/one"), ["job.ron", "out"]);
}

#[test]
fn absolute_paths_are_taken_as_they_are() {
    let desk = small_job();
    let plate = desk.path("plate.png");
    let job = desk.graph(
        "far/job.ron",
        &format!(
            r#""plate": Load(path: {plate:?}), "out": Save(image: "plate", path: {:?})"#,
            desk.path("away/copy.png"),
        ),
    );
    let output = desk.command(["run".as_ref(), job.as_os_str()]).output().expect("the binary starts");
    assert_eq!(Ended::from(output).expect(0).stdout, format!("{}\n", desk.path("away/copy.png").display()));
}

#[test]
fn variables_expand() {
    let desk = small_job();
    let nodes = r#""plate": Load(path: "$(env:WARPLOOM_TEST_PLATE).png"),
        "out": Save(image: "plate", path: "out/$(env:WARPLOOM_TEST_SHOT)/copy.png")"#;
    desk.graph("job.ron", nodes);
    let mut command = desk.command(["run", "job.ron"]);
    command.env("WARPLOOM_TEST_PLATE", "plate").env("WARPLOOM_TEST_SHOT", "sh 010");
    Ended::from(command.output().expect("the binary starts")).expect(0);
    assert!(desk.path("out/sh 010/copy.png").exists());
    for command in ["run", "check"] {
        let words = ["missing_variable", "WARPLOOM_TEST_PLATE", "WARPLOOM_TEST_SHOT", "job.ron:2", "job.ron:3"];
        desk.run(&format!("{command} job.ron")).says(2, &words);
    }
}

#[test]
fn names_may_hold_spaces_and_any_script() {
    let desk = small_job();
    desk.write("Über uns/素材 1.png", desk.read("plate.png"));
    let nodes = r#""plate": Load(path: "素材 1.png"), "out": Save(image: "plate", path: "fertig é/bild #1.png")"#;
    desk.write("Über uns/job ñ.ron", format!("Graph(version: 1, frames: \"7\", nodes: {{ {nodes} }})"));
    let args = ["run", "Über uns/job ñ.ron", "--report", "bericht ü.json", "--dump", "plate=kopie ß.png"];
    let ended = Ended::from(desk.command(args).output().expect("the binary starts")).expect(0);
    written(&ended, &[desk.path("Über uns/fertig é/bild 71.png"), desk.path("kopie ß.png")]);
    let report = desk.read_json("bericht ü.json");
    assert_eq!(report["graph"], serde_json::json!(desk.path("Über uns/job ñ.ron")));
    assert_eq!(desk.read("kopie ß.png"), desk.read("Über uns/fertig é/bild 71.png"));
}

#[test]
fn a_name_that_is_not_text_is_no_panic() {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let desk = Desk::new();
        let name = std::ffi::OsStr::from_bytes(b"caf\xe9.ron");
        for command in ["run", "check"] {
            let output = desk.command([command.as_ref(), name]).output().expect("the binary starts");
            Ended::from(output).says(2, &["does not exist"]);
        }
    }
}

/// The same file under two names would be its own input.
#[test]
#[cfg(unix)]
fn what_is_read_is_not_written_through_links() {
    let desk = Desk::new();
    desk.card("shots/plate.png", "Checker(size: (16, 16), cell: 4.0)");
    let before = desk.read("shots/plate.png");
    std::os::unix::fs::symlink(desk.path("shots"), desk.path("alias")).expect("a link");
    std::os::unix::fs::symlink(desk.path("shots/plate.png"), desk.path("latest.png")).expect("a link");
    for out in ["alias/plate.png", "latest.png"] {
        let nodes = format!(r#""in": Load(path: "shots/plate.png"), "out": Save(image: "in", path: "{out}")"#);
        desk.graph("over.ron", &nodes);
        desk.run("run over.ron").says(2, &["sink_conflict", "write to another file"]);
    }
    desk.graph("read.ron", r#""in": Load(path: "shots/plate.png")"#);
    desk.run("run read.ron --target in --dump in=alias/plate.png").expect(2);
    assert_eq!(desk.read("shots/plate.png"), before);
}

/// As an editor would: links stay links, permissions stay, and what is read-only is left alone.
#[test]
#[cfg(unix)]
fn files_that_are_there_keep_what_they_are() {
    use std::os::unix::fs::PermissionsExt;
    let desk = Desk::new();
    desk.graph("job.ron", r#""in": Checker(size: (16, 16)), "out": Save(image: "in", path: "latest.png")"#);
    desk.write("store/v001.png", "an older one");
    let mode = |mode| std::fs::set_permissions(desk.path("store/v001.png"), PermissionsExt::from_mode(mode));
    std::os::unix::fs::symlink("store/v001.png", desk.path("latest.png")).expect("a link");
    mode(0o444).expect("a mode");
    desk.run("run job.ron").says(6, &["latest.png", "read-only", "chmod u+w"]);
    assert_eq!(desk.read("store/v001.png"), b"an older one");
    mode(0o664).expect("a mode");
    desk.run("run job.ron").expect(0);
    let there = desk.path("store/v001.png").metadata().expect("it is there");
    assert_eq!((there.permissions().mode() & 0o777, &desk.read("store/v001.png")[1..4]), (0o664, &b"PNG"[..]));
    assert!(desk.path("latest.png").is_symlink());
    assert_eq!(desk.files("store"), ["v001.png"]);
}

/// A report may go into a pipe or a device; a picture may not.
#[test]
#[cfg(target_os = "linux")]
fn pipes_and_devices_stay() {
    let desk = Desk::new();
    desk.graph("job.ron", r#""in": Checker(size: (16, 16)), "out": Save(image: "in", path: "out.png")"#);
    desk.run("run job.ron --report /dev/null --no-cache").expect(0);
    let ended = desk.run("run job.ron --report /dev/stdout --no-cache").expect(0);
    assert!(ended.stdout.contains("\"schema\""), "{ended:?}");
    std::os::unix::fs::symlink("/dev/null", desk.path("null.png")).expect("a link");
    desk.graph("null.ron", r#""in": Checker(size: (16, 16)), "out": Save(image: "in", path: "null.png")"#);
    desk.run("run null.ron --no-cache").says(6, &["not a regular file"]);
    assert!(!Path::new("/dev/null").is_file());
}
