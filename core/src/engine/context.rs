//! What a node sees while it computes.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::Existing;
use super::io::{self as door, Io, cannot_write, plain};
use super::memory::Purpose;
use crate::node::{ErrorClass, In, NodeError, Output, Port, ReadPath, Request, WritePath};
use crate::value::{BufferMut, Digest, Given, Reads, Sample};

/// A file that a sink wrote.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Artifact {
    /// Absolute.
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// Digest of its content.
    pub blake3: Digest,
}

/// Whether to go on, who wants to know how far it is, and where memory comes from.
pub(crate) trait Control: Sync {
    /// The part done, 0..=1.
    fn progress(&self, part: f64);
    /// Whether the run is stopped.
    fn is_stopped(&self) -> bool;
    /// Counts memory before it is allocated; an error refuses it, or asks the node to end and try again later.
    fn reserve(&self, bytes: u128, purpose: Purpose) -> Result<(), NodeError>;
}

/// What a node sees while it computes: its inputs, its files, its budget; and how it is told to stop.
pub struct Context<'a> {
    pub(crate) inputs: &'a [Vec<Given>],
    pub(crate) request: &'a Request,
    pub(crate) frame: Option<i64>,
    pub(crate) files: &'a [(PathBuf, Digest)],
    pub(crate) outputs: &'static [Output],
    pub(crate) wanted: &'a [Reads],
    pub(crate) io: &'a dyn Io,
    pub(crate) control: &'a dyn Control,
    pub(crate) existing: Existing,
    pub(crate) artifacts: Mutex<Vec<Artifact>>,
}

impl Context<'_> {
    /// What feeds `port`, if it asks for one request as most do.
    pub fn get<K: Port>(&self, port: &In<K>) -> K::Seen {
        see::<K>(&self.inputs[port.slot][0])
    }

    /// What feeds an optional port.
    pub fn get_optional<K: Port>(&self, port: &Option<In<K>>) -> Option<K::Seen> {
        port.as_ref().map(|port| self.get(port))
    }

    /// What feeds a list of ports, in the order of the graph file.
    pub fn get_all<K: Port>(&self, ports: &[In<K>]) -> Vec<K::Seen> {
        ports.iter().map(|port| self.get(port)).collect()
    }

    /// The answers to all requests that `needs` made of `port`, in its order.
    pub fn answers<K: Port>(&self, port: &In<K>) -> Vec<K::Seen> {
        self.inputs[port.slot].iter().map(see::<K>).collect()
    }

    /// What is asked for. Its frame is only there for node types that declare to read it.
    pub fn request(&self) -> Request {
        self.request.at(self.frame)
    }

    /// What all who read an output look at together. Always all of it for node types that do not declare
    /// [`HEEDS_WANTED`](crate::node::Node::HEEDS_WANTED): what they make must not depend on who reads it.
    pub fn wanted(&self, output: &str) -> &Reads {
        let at = self.outputs.iter().position(|known| known.name == output);
        &self.wanted[at.expect("a node asks for outputs that it declares")]
    }

    /// Zeros to draw on; refused if this node's allocations pass the memory budget, or if the run is stopped.
    pub fn plane<T: Sample>(&self, width: usize, height: usize) -> Result<BufferMut<T>, NodeError> {
        let mut planes = self.planes(1, width, height)?;
        Ok(planes.remove(0))
    }

    /// Several planes of zeros, refused before the first is made if not all have room.
    pub fn planes<T: Sample>(&self, count: usize, width: usize, height: usize) -> Result<Vec<BufferMut<T>>, NodeError> {
        self.go_on()?;
        let bytes = count as u128 * BufferMut::<T>::bytes_for(width, height);
        self.control.reserve(bytes, Purpose::Planes).map_err(|error| match error.class {
            ErrorClass::OverBudget => {
                let planes = if count == 1 { "a plane".to_owned() } else { format!("{count} planes") };
                NodeError { message: format!("{}, for {planes} of {width} x {height}", error.message), ..error }
            }
            _ => error,
        })?;
        Ok((0..count).map(|_| BufferMut::zeroed(width, height)).collect())
    }

    /// Counts `bytes` that the node is about to allocate against the memory budget. An error means stop; pass it on.
    pub fn reserve(&self, bytes: u128) -> Result<(), NodeError> {
        self.control.reserve(bytes, Purpose::Other)
    }

    /// The content of a file parameter: the very bytes whose digest is in this node's key.
    pub fn read(&self, path: &ReadPath) -> Result<Vec<u8>, NodeError> {
        let path = path.path();
        let expected = self.files.iter().find(|(known, _)| known == path).map(|(_, digest)| digest);
        let unreadable = |problem: String| NodeError::new(ErrorClass::InputUnreadable, problem);
        let size = door::stat(self.io, path).map_err(|e| unreadable(cannot_read(path, &e)))?.size;
        self.reserve(size.into())?;
        let bytes = door::read(self.io, path).map_err(|e| unreadable(cannot_read(path, &e)))?;
        if expected != Some(&Digest::of_bytes(&bytes)) {
            return Err(unreadable(format!("{} changed while it was read", path.display()))
                .hint("run again once it is written whole"));
        }
        Ok(bytes)
    }

    /// Writes a file whole or not at all. Where a run only verifies, the file must be there with this content.
    pub fn write(&self, path: &WritePath, bytes: &[u8]) -> Result<(), NodeError> {
        let path = path.path();
        let artifact = Artifact { path: path.to_owned(), bytes: bytes.len() as u64, blake3: Digest::of_bytes(bytes) };
        if self.existing == Existing::Verify {
            self.verify(&artifact)?;
        } else {
            self.go_on()?;
            door::deliver(self.io, path, bytes).map_err(|e| {
                let message = format!("cannot write {}: {}", path.display(), plain(&e));
                NodeError::new(ErrorClass::OutputUnwritable, message).hint(cannot_write(&e))
            })?;
        }
        self.artifacts.lock().unwrap_or_else(PoisonError::into_inner).push(artifact);
        Ok(())
    }

    fn verify(&self, artifact: &Artifact) -> Result<(), NodeError> {
        let path = &artifact.path;
        let found = match door::digest(self.io, path) {
            Ok(digest) if digest == artifact.blake3 => return Ok(()),
            Ok(_) => format!("{} is not what this graph writes there", path.display()),
            Err(error) => cannot_read(path, &error),
        };
        Err(NodeError::new(ErrorClass::OutputDiffers, found).hint("run without --existing verify to write it"))
    }

    /// Says how far the node is, 0..=1. An error means stop; pass it on.
    pub fn progress(&self, part: f64) -> Result<(), NodeError> {
        self.go_on()?;
        self.control.progress(part);
        Ok(())
    }

    /// An error means stop; pass it on.
    pub fn go_on(&self) -> Result<(), NodeError> {
        match self.control.is_stopped() {
            true => Err(NodeError::new(ErrorClass::Cancelled, "stopped")),
            false => Ok(()),
        }
    }
}

fn see<K: Port>(given: &Given) -> K::Seen {
    K::see(given).expect("the graph's check lets only fitting kinds through")
}

pub(crate) fn cannot_read(path: &Path, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => format!("{} does not exist", path.display()),
        _ => format!("cannot read {}: {}", path.display(), plain(error)),
    }
}
