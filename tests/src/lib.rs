//! What the test harnesses of Warploom share.

pub mod disk_nodes;
pub mod disk_state;
pub mod disk_work;
pub mod graphs;
pub mod harness;
pub mod io;

/// Seconds that this thread has computed.
pub fn cpu_seconds() -> std::io::Result<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    let nanoseconds = text.split_whitespace().next().and_then(|first| first.parse::<f64>().ok());
    Ok(nanoseconds.ok_or(std::io::ErrorKind::InvalidData)? / 1e9)
}

/// A generator of numbers that is the same everywhere (SplitMix64).
pub struct Random(
    /// The seed, then the state.
    pub u64,
);

impl Random {
    /// The next number.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number from 0 to `bound` - 1.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    /// One of `items`.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }

    /// A number between two, in thousandths.
    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * (self.below(1001) as f64 / 1000.0)
    }
}
