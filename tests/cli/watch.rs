//! `run --watch`: a run per save.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::desk::{Desk, small_job};

const PICTURE: &str = "out/small.png";

/// A run that watches, what it says going to a file.
struct Watch<'a> {
    desk: &'a Desk,
    child: Child,
}

impl Drop for Watch<'_> {
    fn drop(&mut self) {
        // It has ended already unless a check failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[track_caller]
fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(60), "{what} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

impl<'a> Watch<'a> {
    fn start(desk: &'a Desk) -> Self {
        let log = std::fs::File::create(desk.path("watch.log")).expect("a file");
        let mut command = desk.command(["run", "job.ron", "--watch"]);
        Self { desk, child: command.stdout(Stdio::null()).stderr(log).spawn().expect("the binary starts") }
    }

    fn said(&self) -> String {
        String::from_utf8(self.desk.read("watch.log")).expect("what is said is UTF-8")
    }

    #[track_caller]
    fn waits_to_say(&self, words: &str, count: usize) {
        wait_until(words, || self.said().matches(words).count() >= count);
    }

    /// Waits for the picture that a run from scratch gives.
    #[track_caller]
    fn waits_for_the_picture(&self) {
        self.desk.run("run job.ron --no-cache --set out.path=\"expected.png\"").expect(0);
        let expected = self.desk.read("expected.png");
        wait_until("the picture", || std::fs::read(self.desk.path(PICTURE)).is_ok_and(|bytes| bytes == expected));
    }

    fn interrupt(mut self) -> String {
        let line = format!("kill -INT {}", self.child.id());
        assert!(std::process::Command::new("sh").args(["-c", &line]).status().expect("a shell").success());
        let mut ended = None;
        wait_until("the end", || {
            ended = self.child.try_wait().expect("it can be waited for");
            ended.is_some()
        });
        let said = self.said();
        assert_eq!(ended.and_then(|status| status.code()), Some(75), "{said}");
        said
    }
}

/// Saves the job with another angle.
fn turn(desk: &Desk, angle: &str) {
    desk.graph("job.ron", &crate::desk::SMALL_JOB.replace("angle: 60.0", &format!("angle: {angle}")));
}

#[test]
fn every_save_renders_again() {
    let desk = small_job();
    let watch = Watch::start(&desk);
    watch.waits_for_the_picture();
    watch.waits_to_say("watching", 1);
    turn(&desk, "75.0");
    watch.waits_for_the_picture();
    watch.waits_to_say("4 executed, 6 reused", 1);
    watch.waits_to_say("watching", 2);
    desk.card("plate.png", "Checker(size: (48, 48), cell: 7.0)");
    watch.waits_for_the_picture();
    watch.waits_to_say("watching", 3);
    let said = watch.interrupt();
    assert!(said.contains("stopping") && !said.contains("error["), "{said}");
}

#[test]
fn a_graph_with_faults_leaves_the_last_picture() {
    let desk = small_job();
    let watch = Watch::start(&desk);
    watch.waits_to_say("watching", 1);
    let before = desk.read(PICTURE);
    turn(&desk, "\"wide\"");
    watch.waits_to_say("the graph has faults", 1);
    watch.waits_to_say("watching", 2);
    assert!(watch.said().contains("error["), "{}", watch.said());
    assert_eq!(desk.read(PICTURE), before);
    // Plates are still looked at.
    desk.card("plate.png", "Checker(size: (48, 48), cell: 7.0)");
    wait_until("another picture", || desk.read(PICTURE) != before);
    turn(&desk, "30.0");
    watch.waits_for_the_picture();
    let said = watch.interrupt();
    assert_eq!(said.matches("the graph has faults").count(), 1, "{said}");
}

#[test]
fn it_may_begin_with_faults() {
    let desk = small_job();
    turn(&desk, "\"wide\"");
    let watch = Watch::start(&desk);
    watch.waits_to_say("watching", 1);
    assert!(watch.said().contains("error["), "{}", watch.said());
    assert!(!desk.path(PICTURE).exists());
    turn(&desk, "60.0");
    watch.waits_for_the_picture();
    std::fs::remove_file(desk.path("plate.png")).expect("it was there");
    watch.waits_to_say("error[input_unreadable]", 1);
    desk.card("plate.png", "Checker(size: (48, 48), cell: 5.0)");
    watch.waits_for_the_picture();
    watch.interrupt();
}
