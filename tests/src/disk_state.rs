//! What is in a folder, to look at and to put back.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Every file below a folder, as far as it stays there while this looks.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        let entries = match std::fs::read_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entries => entries.expect("a folder"),
        };
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    files
}

/// The files of a folder with what is in them.
#[derive(Clone)]
pub struct Snapshot {
    folder: PathBuf,
    files: BTreeMap<PathBuf, Vec<u8>>,
}

impl Snapshot {
    /// What is in `folder` now.
    pub fn of(folder: &Path) -> Self {
        let read = |path: PathBuf| {
            let bytes = std::fs::read(&path).expect("readable");
            (path, bytes)
        };
        Self { folder: folder.to_owned(), files: files_below(folder).into_iter().map(read).collect() }
    }

    /// Makes the folder as it was.
    pub fn restore(&self) {
        std::fs::remove_dir_all(&self.folder).expect("removed");
        std::fs::create_dir_all(&self.folder).expect("made");
        for (path, bytes) in &self.files {
            std::fs::create_dir_all(path.parent().expect("below the folder")).expect("made");
            std::fs::write(path, bytes).expect("written");
        }
    }

    /// The files whose path has `part` in it.
    pub fn with(&self, part: &str) -> BTreeMap<PathBuf, Vec<u8>> {
        let has = |(path, _): &(&PathBuf, &Vec<u8>)| path.to_string_lossy().contains(part);
        self.files.iter().filter(has).map(|(path, bytes)| (path.clone(), bytes.clone())).collect()
    }
}
