//! Whoever a codec works for: it gives memory, hears how far the work is, and may stop it.

use std::io::{BufRead, Cursor, Read, Seek, SeekFrom, Write};

use warploom_core::node::{Context, NodeError};

/// Whoever a codec works for. A function of bytes is one that never wants to know how far the work is.
pub trait Host: Sync {
    /// Asked for so many bytes before they are allocated; an error refuses them.
    fn reserve(&self, bytes: u128) -> Result<(), NodeError>;

    /// Told the part done, 0..=1; an error means stop.
    fn progress(&self, part: f64) -> Result<(), NodeError>;

    /// An error means stop.
    fn go_on(&self) -> Result<(), NodeError>;
}

impl<F: Fn(u128) -> Result<(), NodeError> + Sync> Host for F {
    fn reserve(&self, bytes: u128) -> Result<(), NodeError> {
        self(bytes)
    }

    fn progress(&self, _: f64) -> Result<(), NodeError> {
        self(0)
    }

    fn go_on(&self) -> Result<(), NodeError> {
        self(0)
    }
}

/// A node at work.
pub struct NodeHost<'a>(pub &'a Context<'a>);

impl Host for NodeHost<'_> {
    fn reserve(&self, bytes: u128) -> Result<(), NodeError> {
        self.0.go_on().and_then(|()| self.0.reserve(bytes))
    }

    fn progress(&self, part: f64) -> Result<(), NodeError> {
        self.0.progress(part)
    }

    fn go_on(&self) -> Result<(), NodeError> {
        self.0.go_on()
    }
}

/// The host of a part of the work, from one part done to another.
pub struct Within<'a> {
    pub host: &'a dyn Host,
    pub from: f64,
    pub to: f64,
}

impl Host for Within<'_> {
    fn reserve(&self, bytes: u128) -> Result<(), NodeError> {
        self.host.reserve(bytes)
    }

    fn progress(&self, part: f64) -> Result<(), NodeError> {
        self.host.progress(self.from + part * (self.to - self.from))
    }

    fn go_on(&self) -> Result<(), NodeError> {
        self.host.go_on()
    }
}

/// Calls of a decoder or encoder between two looks at the host: many move a single byte.
const CALLS: u32 = 16;

fn stopped(_: NodeError) -> std::io::Error {
    std::io::Error::other("stopped")
}

/// The bytes of a file as a decoder reads them; it meets an error soon after its host says stop.
pub struct Source<'a> {
    bytes: Cursor<&'a [u8]>,
    host: &'a dyn Host,
    calls: u32,
}

impl<'a> Source<'a> {
    pub fn new(bytes: &'a [u8], host: &'a dyn Host) -> Self {
        Self { bytes: Cursor::new(bytes), host, calls: 0 }
    }

    fn look(&mut self) -> std::io::Result<()> {
        self.calls = (self.calls + 1) % CALLS;
        match self.calls {
            0 => {
                let part = self.bytes.position() as f64 / self.bytes.get_ref().len().max(1) as f64;
                self.host.progress(part.min(1.0)).map_err(stopped)
            }
            _ => Ok(()),
        }
    }
}

impl Read for Source<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        self.look()?;
        self.bytes.read(to)
    }
}

impl BufRead for Source<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.look()?;
        self.bytes.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.bytes.consume(count);
    }
}

impl Seek for Source<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// Bytes of a piece of what an encoder writes.
pub const PIECE: usize = 1 << 18;

/// What an encoder writes, however much it is: pieces that never move, each asked for before it is taken.
pub struct Sink<'a> {
    host: &'a dyn Host,
    pieces: Vec<Vec<u8>>,
    calls: u32,
    refusal: Option<NodeError>,
}

impl<'a> Sink<'a> {
    pub fn new(host: &'a dyn Host) -> Self {
        Self { host, pieces: Vec::new(), calls: 0, refusal: None }
    }

    fn look(&mut self) -> Result<(), NodeError> {
        self.calls = (self.calls + 1) % CALLS;
        if self.calls == 0 {
            self.host.go_on()?;
        }
        if self.pieces.last().is_none_or(|piece| piece.len() == PIECE) {
            self.host.reserve(PIECE as u128)?;
            self.pieces.push(Vec::with_capacity(PIECE));
        }
        Ok(())
    }

    /// What was written, piece by piece; the host's error if it gave one.
    pub fn pieces(self) -> Result<Vec<Vec<u8>>, NodeError> {
        self.refusal.map_or(Ok(self.pieces), Err)
    }
}

impl Write for Sink<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if let Err(error) = self.look() {
            self.refusal = Some(error);
            return Err(std::io::Error::other("refused"));
        }
        let piece = self.pieces.last_mut().expect("there is room in the last piece");
        let count = bytes.len().min(PIECE - piece.len());
        piece.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The pieces as one.
pub fn joined(pieces: Vec<Vec<u8>>, host: &dyn Host) -> Result<Vec<u8>, NodeError> {
    let count = pieces.iter().map(Vec::len).sum();
    host.reserve(count as u128)?;
    let mut file = Vec::with_capacity(count);
    pieces.iter().for_each(|piece| file.extend_from_slice(piece));
    Ok(file)
}
