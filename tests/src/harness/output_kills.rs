//! Runs that are killed while they write over existing frames.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use super::Outcome;
use super::place::{Place, wait};
use crate::Random;

type Files = BTreeMap<String, Vec<u8>>;

const SHOT: &str = r#"
    "card":   Checker(size: (480, 270), cell: 8.0),
    "grid":   Lattice(domain: "card", cell: 30.0),
    "bend":   Arc(grid: "grid", angle: Keys([(1, 5.0), (8, 90.0)])),
    "warped": Resample(image: "card", warp: "bend"),
    "exr":    Save(image: "warped", path: "out/frame.##.exr", depth: Float, compression: None),
    "png":    Save(image: "warped", path: "out/frame.##.png"),"#;

/// Two contents of the frames.
const VALUES: [&str; 2] = ["card.cell=8.0", "card.cell=12.0"];

/// After so many kills a run is left alone.
const KILLS_PER_RUN: usize = 50;

/// What kills did.
#[derive(Default)]
struct Kills {
    torn: Vec<String>,
    count: usize,
    /// Those after the process had ended by itself.
    late: usize,
    /// Those that left a temporary file: they came amid a write.
    amid_write: usize,
}

/// Kills `count` runs that write over existing frames. The control is the same check of a writer that writes in
/// place: this executable with `control_args`, which calls [`write_in_place_if_asked`].
pub fn output_kills(binary: &Path, count: usize, control_args: &[&str]) -> Outcome {
    let place = Place::new(binary);
    place.shot("shot.ron", "1-8", SHOT);
    let mut outcome = Outcome::default();
    let references = VALUES.map(|value| whole(&place, value).0);
    assert!(
        references[0].len() == 16 && references[0].iter().all(|(name, file)| references[1].get(name) != Some(file))
    );
    let seconds = [0, 1, 0].map(|value| whole(&place, VALUES[value]).1).into_iter().fold(f64::MAX, f64::min);

    let (mut random, mut kills) = (Random(23), Kills::default());
    while kills.count < count {
        let next = (kills.count + KILLS_PER_RUN).min(count);
        while kills.count < next {
            let (value, threads) = (rarer(&place, &references), random.pick(&[1, 2, 3, 8]));
            let mut command = place.command(&format!("{} --threads {threads}", line(value)));
            kills.one(&place, &mut random, seconds, &references, &mut command);
        }
        outcome.check(whole(&place, VALUES[0]).0 == references[0], || "a run after kills writes something else");
    }
    let left = place.temporaries();
    outcome.check(left.is_empty(), || format!("{} temporary files of killed runs stay, as {}", left.len(), left[0]));
    let torn_of_control = control(&place, count.min(KILLS_PER_RUN), &references, control_args, &mut random);
    outcome.check(torn_of_control > 0, || "insensitive: a writer in place was never caught");
    outcome.figures.push(format!(
        "output kills: {} kills ({} late, {} amid a write), {} torn files; {} temporary files left at the end; \
        control: {torn_of_control} torn files",
        kills.count,
        kills.late,
        kills.amid_write,
        kills.torn.len(),
        left.len(),
    ));
    outcome.violations.extend(kills.torn);
    outcome
}

/// The value that fewer files have, so that most are to be written.
fn rarer(place: &Place, references: &[Files; 2]) -> &'static str {
    let found = place.outputs();
    let count = found.iter().filter(|(name, file)| references[0].get(*name) == Some(file)).count();
    VALUES[usize::from(2 * count >= found.len())]
}

fn line(value: &str) -> String {
    format!("run shot.ron --cache cache --store all --progress none --set {value}")
}

/// Outputs and seconds of a run that nobody kills.
fn whole(place: &Place, value: &str) -> (Files, f64) {
    let (code, seconds) = place.run(&line(value));
    assert_eq!(code, Some(0), "{}", place.stderr());
    (place.outputs(), seconds)
}

impl Kills {
    /// Kills one writer at a random moment and looks at what it wrote.
    fn one(&mut self, place: &Place, random: &mut Random, seconds: f64, references: &[Files; 2], writer: &mut Command) {
        let before = place.temporaries();
        let mut child = writer.spawn().expect("the writer starts");
        kill_after(&mut child, random.between(0.0, 1.0) * seconds);
        self.late += usize::from(wait(&mut child, || {}).is_some());
        self.count += 1;
        self.amid_write += usize::from(place.temporaries().iter().any(|name| !before.contains(name)));
        let found = place.outputs();
        for name in references[0].keys() {
            let file = found.get(name);
            if !references.iter().any(|reference| reference.get(name) == file) {
                let size = file.map_or("missing".to_owned(), |bytes| format!("{} bytes", bytes.len()));
                self.torn.push(format!("{name} is torn by kill {} ({size})", self.count));
            }
        }
    }
}

fn kill_after(child: &mut Child, seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
    // It may have ended.
    let _ = child.kill();
}

/// Torn files of a writer that writes in place.
fn control(place: &Place, count: usize, references: &[Files; 2], args: &[&str], random: &mut Random) -> usize {
    for (folder, files) in ["0", "1"].iter().zip(references) {
        std::fs::create_dir(place.path(folder)).expect("a folder");
        files.iter().for_each(|(name, file)| std::fs::write(place.path(folder).join(name), file).expect("a file"));
    }
    let writer = |value: usize| {
        let mut command = Command::new(std::env::current_exe().expect("this executable"));
        place.prepare(command.args(args).env(WRITE_IN_PLACE, value.to_string()));
        command
    };
    let start = Instant::now();
    let code = wait(&mut writer(0).spawn().expect("the control starts"), || {});
    assert_eq!((code, place.outputs() == references[0]), (Some(0), true), "the control writes {}", place.stderr());
    let (seconds, mut kills) = (start.elapsed().as_secs_f64(), Kills::default());
    for value in [1, 0].into_iter().cycle().take(count) {
        kills.one(place, random, seconds, references, &mut writer(value));
    }
    kills.torn.len()
}

const WRITE_IN_PLACE: &str = "WARPLOOM_TESTS_WRITE_IN_PLACE";

/// If this process is the control, copies a folder of frames into `out` the wrong way: in place, piece by piece.
/// Whether it was.
pub fn write_in_place_if_asked() -> bool {
    let Some(folder) = std::env::var_os(WRITE_IN_PLACE) else { return false };
    for entry in std::fs::read_dir(folder).expect("frames") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name");
        let mut file = std::fs::File::create(Path::new("out").join(name)).expect("a frame");
        let bytes = std::fs::read(&path).expect("a frame");
        bytes.chunks(1 << 14).for_each(|piece| file.write_all(piece).expect("room on the disk"));
    }
    true
}
