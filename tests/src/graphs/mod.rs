//! Texts to check: good graphs, what mutations make of them, and what never was one; and what must hold of every
//! answer.

#[path = "../../../core/src/graph/read/tests/dice.rs"]
pub mod dice;
mod fuzz;
mod generate;
mod mutate;
mod promise;

pub use fuzz::{Pool, fuzz};
pub use generate::{Gives, Good, Made, Piece, Role};
pub use mutate::{byte_mutation, token_mutation};
pub use promise::broken;

/// All graph files of a folder beside this package's manifest, by name.
pub fn files(folder: &str) -> Vec<(String, String)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(&folder).expect("the folder");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    paths.sort();
    let name = |path: &std::path::Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), std::fs::read_to_string(path).expect("a graph"))).collect()
}
