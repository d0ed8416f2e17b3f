//! Entries of the disk tier with whatever may be wrong with a file: each is a miss, and is whole again afterwards.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;
use warploom_core::engine::{Disk, DiskTier, Engine, Report, Settings, Stat, StorePolicy};
use warploom_core::value::{Digest, decode};
use warploom_tests::Random;
use warploom_tests::disk_nodes::{Values, plan, values};
use warploom_tests::disk_state::Snapshot;
use warploom_tests::io::{Meddled, Meddler};

/// The bytes of a file of that name, or what has become of them.
type Bytes = Vec<u8>;

/// Files outside the cache look old, so that memos of them are kept.
struct Old(PathBuf);

impl Meddler for Old {
    fn stat(&self, path: &Path, stat: Stat) -> Stat {
        let minute = if path.starts_with(&self.0) { 0 } else { 60_000_000_000 };
        Stat { modified: stat.modified - minute, changed: stat.changed - minute, ..stat }
    }
}

/// A graph whose run finds every entry in the cache, and the cache.
struct Stage {
    folder: TempDir,
    nodes: &'static str,
    frames: &'static str,
    cache: Snapshot,
    expected: Values,
}

/// One of each kind that can be stored.
const EVERY_KIND: &str = r#""picture": Picture(), "cover": Cover(), "depth": Depth(), "parts": Parts(),
    "lattice": Lattice(), "bend": Bend(), "dots": Dots(), "shape": Shape(), "figure": Figure(), "word": Word(),
    "stir": Stir(of: ["picture", "cover", "depth", "parts", "lattice", "bend", "dots", "shape", "figure", "word"])"#;

/// Few records and pages, and a memo of a file read and of one written.
const A_FILE: &str = r#""plate": Plate(path: "in.txt"), "out": Keep(of: "plate", path: "out.#.bin")"#;

impl Stage {
    fn new(nodes: &'static str, frames: &'static str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("in.txt"), "plate").expect("written");
        let cache = folder.path().join("cache");
        std::fs::create_dir(&cache).expect("made");
        let mut stage = Self { cache: Snapshot::of(&cache), folder, nodes, frames, expected: Values::new() };
        stage.expected = stage.run().0;
        // A second run keeps the memos of the files that the first one wrote.
        let (again, report) = stage.run();
        assert!(again == stage.expected && report.cache.damaged == 0);
        stage.cache = Snapshot::of(&cache);
        stage
    }

    /// A run in an engine of its own, with what its targets gave and wrote.
    fn run(&self) -> (Values, Report) {
        let cache = self.folder.path().join("cache");
        let io = Arc::new(Meddled::new(Old(cache.clone())));
        let settings = Settings { threads: 1, memory: 1 << 26, cache: Some(cache), io, ..Settings::default() };
        let engine = Engine::new(Settings { store: StorePolicy::All, ..settings });
        let (mut values, report) = values(&engine, &plan(self.nodes, self.frames, self.folder.path(), &self.targets()));
        assert!(report.faults.is_empty(), "{:#?}", report.faults);
        let is_warned = engine.take_cache_warning().is_some();
        assert_eq!(is_warned, report.cache.damaged > 0, "damage is told of, and nothing else");
        for frame in 1..=2 {
            if let Ok(written) = std::fs::read(self.folder.path().join(format!("out.{frame}.bin"))) {
                values.insert(("out".into(), Some(frame)), written);
            }
        }
        (values, report)
    }

    fn targets(&self) -> Vec<&'static str> {
        self.nodes.split('"').skip(1).step_by(2).filter(|name| self.nodes.contains(&format!("{name}\": "))).collect()
    }

    /// The entries of a table, by file.
    fn table(&self, table: &str) -> BTreeMap<PathBuf, Bytes> {
        let entries = self.cache.with(&format!("/v2/{table}/"));
        assert!(!entries.is_empty(), "there are {table}");
        entries
    }

    /// Puts `damaged` in the place of entries, and runs: everything must be as if nothing were wrong.
    fn bears(&self, damaged: &BTreeMap<PathBuf, Bytes>, what: &str) {
        self.cache.restore();
        damaged.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).expect("written"));
        let (values, report) = self.run();
        assert!(values == self.expected, "{what}: other values");
        assert_eq!(report.cache.damaged, damaged.len() as u64, "{what}: every damaged entry is found, and no other");
        let tier = DiskTier::new(&self.folder.path().join("cache"), Arc::new(Disk), u64::MAX);
        assert_eq!(tier.verify().expect("readable").removed, 0, "{what}: all are whole again");
        damaged.keys().for_each(|path| assert!(path.exists(), "{what}: all are there again"));
    }

    /// The same damage in every entry of a table at once.
    fn bears_in_all(&self, table: &str, what: &str, damage: impl Fn(&Path, &Bytes) -> Option<Bytes>) {
        let entries = self.table(table);
        let damage = |(path, bytes)| Some((PathBuf::clone(path), damage(path, bytes)?));
        self.bears(&entries.iter().filter_map(damage).collect(), &format!("{table}, {what}"));
    }

    /// Without optimisation, a part of it.
    fn bears_everything(&self, table: &str) {
        let (bits, step) = if cfg!(debug_assertions) { (1, 3) } else { (2, 1) };
        let longest = self.table(table).values().map(Vec::len).max().unwrap_or_default();
        for at in 0..longest {
            for bit in [at % 8, (at + 1 + at / 8 % 7) % 8].into_iter().take(bits) {
                self.bears_in_all(table, &format!("bit {bit} of byte {at}"), |_, bytes| {
                    let mut bytes = bytes.clone();
                    *bytes.get_mut(at)? ^= 1 << bit;
                    Some(bytes)
                });
            }
            if at % step == 0 {
                self.bears_in_all(table, &format!("cut to {at}"), |_, bytes| {
                    bytes.get(..at).filter(|cut| cut.len() < bytes.len()).map(<[u8]>::to_vec)
                });
            }
        }
        self.bears_in_all(table, "a byte more", |_, bytes| Some([bytes.as_slice(), &[0]].concat()));
        self.bears_in_all(table, "twice", |_, bytes| Some([bytes.as_slice(), bytes].concat()));
        self.bears_in_all(table, "foreign", |_, _| Some(b"{\"foreign\": true}".repeat(20)));
        let entries = self.table(table);
        let (paths, contents) = (entries.keys(), entries.values());
        let swapped = paths.cloned().zip(contents.cycle().skip(1).cloned()).collect();
        self.bears(&swapped, &format!("{table}, swapped"));
    }
}

/// What a later format may write: whole by its checksum, and of a form that is not known yet.
fn sealed_newer(path: &Path, _: &Bytes) -> Option<Bytes> {
    let name = path.file_name()?.to_str().and_then(Digest::from_hex)?;
    let content = br#"{"newer": [1, 2]}"#;
    let checksum = blake3::keyed_hash(&name.0, content);
    Some([checksum.as_bytes().as_slice(), content].concat())
}

fn newer_value(_: &Path, _: &Bytes) -> Option<Bytes> {
    let header = br#"{"Cube": {"size": 33}}"#;
    let mut bytes = Digest::of_bytes(header).0.to_vec();
    bytes.extend((header.len() as u64).to_le_bytes());
    bytes.extend(header);
    Some(bytes)
}

#[test]
fn damaged_values_of_every_kind_are_made_anew() {
    let stage = Stage::new(EVERY_KIND, "1-1");
    assert_eq!(stage.table("values").len(), 11);
    stage.bears_everything("values");
    stage.bears_in_all("values", "newer", newer_value);
}

#[test]
fn damaged_records_are_made_anew() {
    let stage = Stage::new(A_FILE, "1-2");
    stage.bears_everything("records");
    stage.bears_in_all("records", "newer", sealed_newer);
}

#[test]
fn damaged_memos_are_made_anew() {
    let stage = Stage::new(A_FILE, "1-2");
    assert_eq!(stage.table("files").len(), 3);
    stage.bears_everything("files");
    stage.bears_in_all("files", "newer", sealed_newer);
}

#[test]
fn damaged_pages_of_the_journal_are_made_anew() {
    let stage = Stage::new(A_FILE, "1-2");
    stage.bears_everything("journal");
}

/// What is true of the file is true of its bytes: there is no more to reading an entry.
#[test]
fn ten_thousand_flips_in_a_large_value_are_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let engine = Engine::new(Settings::default());
    let plan = plan(r#""picture": Picture(size: 362)"#, "1-1", folder.path(), &["picture"]);
    let (values, _) = values(&engine, &plan);
    let bytes = &values[&("picture".into(), Some(1))];
    assert!(bytes.len() > 1 << 20);
    let digest_of = |bytes: &[u8]| {
        let value = decode(&mut &*bytes, bytes.len() as u64).expect("memory can be read");
        value.map(|value| value.digest())
    };
    let digest = digest_of(bytes);
    assert!(digest.is_some());
    let flip = |seed: u64| {
        let (mut random, mut bytes) = (Random(seed), bytes.clone());
        for _ in 0..5_000 {
            let (at, bit) = (random.below(bytes.len()), random.below(8));
            bytes[at] ^= 1 << bit;
            assert_ne!(digest_of(&bytes), digest, "bit {bit} of byte {at}");
            bytes[at] ^= 1 << bit;
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| flip(1));
        scope.spawn(|| flip(2));
    });
}

#[test]
fn tiers_of_two_formats_lie_side_by_side() {
    let stage = Stage::new(A_FILE, "1-2");
    let cache = stage.folder.path().join("cache");
    for format in ["v1", "v3"] {
        let folder = cache.join(format).join("records/ab");
        std::fs::create_dir_all(&folder).expect("made");
        std::fs::write(folder.join("ab".repeat(32)), vec![7; 100_000]).expect("written");
    }
    let others = |snapshot: Snapshot| [snapshot.with("/v1/"), snapshot.with("/v3/")];
    let before = others(Snapshot::of(&cache));
    let (values, report) = stage.run();
    assert!(values == stage.expected);
    assert_eq!(report.cache.damaged, 0);
    let tier = DiskTier::new(&cache, Arc::new(Disk), 0);
    assert!(tier.stat().expect("readable").bytes() < 100_000, "another format's bytes are not ours");
    assert_eq!(tier.verify().expect("readable").removed, 0);
    tier.collect().expect("removable");
    assert_eq!(tier.clear().expect("removable").left_bytes, 0);
    assert_eq!(others(Snapshot::of(&cache)), before);
}
