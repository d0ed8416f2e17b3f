//! The one type that holds pixels.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock};

use rayon::prelude::*;

use super::heap::populate;
use super::{Digest, Hasher};

/// What a buffer may hold: 32-bit samples.
pub trait Sample: bytemuck::Pod + Default + PartialEq + Send + Sync + std::fmt::Debug {
    /// Name in digests and files.
    const NAME: &'static str;
}

impl Sample for f32 {
    const NAME: &'static str = "f32";
}

impl Sample for u32 {
    const NAME: &'static str = "u32";
}

/// Memory that a buffer lies in: the heap here, shared memory for plugin workers.
pub trait Storage: Send + Sync + 'static {
    /// All bytes, 64-byte aligned.
    fn bytes(&self) -> &[u8];
}

/// Samples of 64 bytes: one cache line, one AVX-512 register.
const SAMPLES_PER_LINE: usize = 16;

/// Immutable samples in rows; each row starts on a 64-byte boundary. Clones share the samples.
#[derive(Clone)]
pub struct Buffer<T> {
    shared: Arc<Shared>,
    width: usize,
    height: usize,
    stride: usize,
    sample: PhantomData<T>,
}

/// Whatever is to live as long as the samples of a buffer.
pub type Companion = Box<dyn Send + Sync>;

struct Shared {
    storage: Box<dyn Storage>,
    digest: OnceLock<Digest>,
    bad_samples: OnceLock<u64>,
    companion: OnceLock<Companion>,
}

impl<T: Sample> Buffer<T> {
    /// Samples that lie in `storage`, rows `stride` samples apart; `stride` is a multiple of 16.
    pub fn from_storage(storage: Box<dyn Storage>, width: usize, height: usize, stride: usize) -> Self {
        assert!(stride.is_multiple_of(SAMPLES_PER_LINE) && width <= stride, "stride {stride} for rows of {width}");
        assert!(storage.bytes().len() >= stride * height * size_of::<T>(), "storage is too small");
        let shared =
            Shared { storage, digest: OnceLock::new(), bad_samples: OnceLock::new(), companion: OnceLock::new() };
        let shared = Arc::new(shared);
        Self { shared, width, height, stride, sample: PhantomData }
    }

    /// Copies `samples`, row-major without gaps.
    pub fn from_packed(samples: &[T], width: usize, height: usize) -> Self {
        assert_eq!(samples.len(), width * height, "{width} x {height} samples");
        let mut buffer = BufferMut::zeroed(width, height);
        for (y, row) in samples.chunks_exact(width.max(1)).enumerate() {
            buffer.row_mut(y).copy_from_slice(row);
        }
        buffer.freeze()
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// All samples, gaps between rows included.
    pub fn samples(&self) -> &[T] {
        &bytemuck::cast_slice(self.shared.storage.bytes())[..self.stride * self.height]
    }

    /// Row `y`.
    pub fn row(&self, y: usize) -> &[T] {
        &self.samples()[y * self.stride..][..self.width]
    }

    /// All rows from the top.
    pub fn rows(&self) -> impl Iterator<Item = &[T]> {
        (0..self.height).map(|y| self.row(y))
    }

    /// Bytes of memory the samples take.
    pub fn bytes(&self) -> u64 {
        (self.stride * self.height * size_of::<T>()) as u64
    }

    /// Whether something lives with these samples already.
    pub(crate) fn is_accompanied(&self) -> bool {
        self.shared.companion.get().is_some()
    }

    /// Lets `companion` live as long as the samples, whoever shares them; the first one stays.
    pub(crate) fn accompany(&self, companion: Companion) {
        let _ = self.shared.companion.set(companion);
    }

    /// Digest of shape and samples (gaps left out), computed once per buffer: BLAKE3 of the digests of bands of
    /// a fixed size, so that bands are hashed side by side and the result depends on no thread count.
    pub fn digest(&self) -> Digest {
        if let Some(known) = self.shared.digest.get() {
            return *known;
        }
        // Not inside `get_or_init`: the thread pool may have this thread ask for the same digest meanwhile.
        let digest = {
            let rows_per_band = (BAND_BYTES / (self.width.max(1) * size_of::<T>())).max(1);
            let rows = if self.width == 0 { 0 } else { self.height };
            let bands: Vec<Digest> = (0..rows.div_ceil(rows_per_band))
                .into_par_iter()
                .map(|band| {
                    let top = band * rows_per_band;
                    let mut hasher = blake3::Hasher::new();
                    let band = top..(top + rows_per_band).min(rows);
                    // Long updates keep all lanes of the hash busy.
                    if self.stride == self.width {
                        let samples = &self.samples()[band.start * self.stride..band.end * self.stride];
                        hasher.update(bytemuck::cast_slice(samples));
                    } else {
                        let mut packed = Vec::with_capacity(self.width * (PACKED / self.width).max(1));
                        for y in band {
                            packed.extend_from_slice(self.row(y));
                            if packed.len() + self.width > packed.capacity() {
                                hasher.update(bytemuck::cast_slice(&packed));
                                packed.clear();
                            }
                        }
                        hasher.update(bytemuck::cast_slice(&packed));
                    }
                    Digest(*hasher.finalize().as_bytes())
                })
                .collect();
            let mut hasher = Hasher::new("buffer");
            hasher.text(T::NAME).int(self.width as i128).int(self.height as i128);
            bands.iter().for_each(|band| {
                hasher.digest(band);
            });
            hasher.finish()
        };
        *self.shared.digest.get_or_init(|| digest)
    }
}

impl Buffer<f32> {
    /// How many samples are NaN or infinite, counted once per buffer.
    pub fn bad_samples(&self) -> u64 {
        if let Some(known) = self.shared.bad_samples.get() {
            return *known;
        }
        // Not inside `get_or_init`, for the same reason as the digest.
        let of_row = |y| self.row(y).iter().map(|sample| u32::from(!sample.is_finite())).sum::<u32>();
        let count = (0..self.height).into_par_iter().map(|y| u64::from(of_row(y))).sum();
        *self.shared.bad_samples.get_or_init(|| count)
    }
}

const BAND_BYTES: usize = 1 << 20;

/// Samples of rows with gaps between them that are packed to be hashed together.
const PACKED: usize = 1 << 15;

impl<T: Sample> std::fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer<{}>({} x {})", T::NAME, self.width, self.height)
    }
}

impl<T: Sample> PartialEq for Buffer<T> {
    fn eq(&self, other: &Self) -> bool {
        self.width == other.width && self.height == other.height && self.digest() == other.digest()
    }
}

/// Samples that are still being written; [`BufferMut::freeze`] makes them a [`Buffer`].
pub struct BufferMut<T> {
    heap: Heap,
    width: usize,
    height: usize,
    stride: usize,
    sample: PhantomData<T>,
}

impl<T: Sample> BufferMut<T> {
    /// `width` x `height` zeros.
    pub fn zeroed(width: usize, height: usize) -> Self {
        let stride = width.next_multiple_of(SAMPLES_PER_LINE);
        Self { heap: Heap::zeroed(stride * height), width, height, stride, sample: PhantomData }
    }

    /// Bytes that `width` x `height` samples take, gaps between rows included.
    pub fn bytes_for(width: usize, height: usize) -> u128 {
        width.next_multiple_of(SAMPLES_PER_LINE) as u128 * height as u128 * size_of::<T>() as u128
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// All samples, gaps between rows included; what is written into gaps is ignored.
    pub fn samples_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(self.heap.words_mut())
    }

    /// Row `y`.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        let (stride, width) = (self.stride, self.width);
        &mut self.samples_mut()[y * stride..][..width]
    }

    /// Ends writing.
    pub fn freeze(self) -> Buffer<T> {
        Buffer::from_storage(Box::new(self.heap), self.width, self.height, self.stride)
    }
}

/// Samples on the heap, the first on a 64-byte boundary. Large ones go to a shelf when dropped, to be used again: fresh
/// pages cost more than most kernels (67 ms for 132 MB where hashing it takes 26 ms).
struct Heap {
    /// As many words as a line more than there are samples: an aligned vector would be filled with zeros on one thread,
    /// where fresh pages are zeros anyway and are made on all threads.
    words: Vec<u32>,
    len: usize,
}

const SHELF_FLOOR: usize = (1 << 20) / size_of::<u32>();
const SHELF_CAPACITY: usize = (512 << 20) / size_of::<u32>();
/// Words that threads fill with zeros side by side.
const FILLED: usize = 1 << 18;

/// Memory that no buffer uses and that was not given back; the oldest comes first.
static SHELF: Mutex<Shelf> = Mutex::new(Shelf { heaps: Vec::new(), len: 0 });

struct Shelf {
    heaps: Vec<Vec<u32>>,
    /// Words in all of them.
    len: usize,
}

impl Shelf {
    fn lock() -> std::sync::MutexGuard<'static, Self> {
        SHELF.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// A heap of this length, made of the one that is nearest to it, whose content stays. If none comes near, there is
    /// none; then others make room for a fresh one.
    fn take(len: usize) -> Option<Vec<u32>> {
        let mut shelf = Self::lock();
        let nearest = shelf.heaps.iter().enumerate().min_by_key(|(_, heap)| heap.len().abs_diff(len));
        let Some((at, _)) = nearest.filter(|(_, heap)| heap.len().abs_diff(len) <= len / 4) else {
            let keep = shelf.len.saturating_sub(len);
            let given_back = shelf.cut(keep);
            drop(shelf);
            drop(given_back);
            return None;
        };
        let mut heap = shelf.heaps.remove(at);
        shelf.len -= heap.len();
        let keep = shelf.len.saturating_sub(len.saturating_sub(heap.len()));
        let given_back = shelf.cut(keep);
        drop(shelf);
        drop(given_back);
        // On Linux pages are added or taken at the end, and none moves.
        heap.truncate(len);
        heap.shrink_to_fit();
        heap.reserve_exact(len - heap.len());
        heap.resize(len, 0);
        Some(heap)
    }

    fn put(heap: Vec<u32>) {
        let mut shelf = Self::lock();
        shelf.len += heap.len();
        shelf.heaps.push(heap);
        let given_back = shelf.cut(SHELF_CAPACITY);
        // Giving memory back takes time: not under the lock.
        drop(shelf);
        drop(given_back);
    }

    /// Takes out the oldest heaps until at most `keep` words are left.
    fn cut(&mut self, keep: usize) -> Vec<Vec<u32>> {
        let mut count = 0;
        while self.len > keep {
            self.len -= self.heaps[count].len();
            count += 1;
        }
        self.heaps.drain(..count).collect()
    }
}

/// Bytes that lie ready for new buffers. They are resident and hold nothing.
pub(crate) fn shelf_bytes() -> u64 {
    (Shelf::lock().len * size_of::<u32>()) as u64
}

/// Gives memory that lies ready for new buffers back to the system until at most `keep` bytes are left.
pub fn cut_shelf(keep: u64) {
    let given_back = Shelf::lock().cut(usize::try_from(keep).unwrap_or(usize::MAX) / size_of::<u32>());
    drop(given_back);
}

impl Heap {
    /// `len` zeros.
    fn zeroed(len: usize) -> Self {
        let room = len + SAMPLES_PER_LINE;
        if room >= SHELF_FLOOR
            && let Some(mut words) = Shelf::take(room)
        {
            words.par_chunks_mut(FILLED).for_each(|chunk| chunk.fill(0));
            return Self { words, len };
        }
        let mut words = vec![0; room];
        if room >= SHELF_FLOOR {
            words.par_chunks_mut(FILLED).for_each(populate);
        }
        Self { words, len }
    }

    /// Where the samples lie among the words.
    fn range(&self) -> Range<usize> {
        let first = self.words.as_ptr().align_offset(SAMPLES_PER_LINE * size_of::<u32>());
        first..first + self.len
    }

    fn words_mut(&mut self) -> &mut [u32] {
        let range = self.range();
        &mut self.words[range]
    }
}

impl Storage for Heap {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.words[self.range()])
    }
}

impl Drop for Heap {
    fn drop(&mut self) {
        let words = std::mem::take(&mut self.words);
        if words.len() >= SHELF_FLOOR {
            Shelf::put(words);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_aligned_and_recycled_buffers_are_zero() {
        for height in [700, 700, 640, 760, 300, 701] {
            let mut buffer = BufferMut::<f32>::zeroed(1000, height);
            assert!(buffer.samples_mut().iter().all(|&sample| sample == 0.0), "{height} rows");
            buffer.samples_mut().fill(3.0);
            let buffer = buffer.freeze();
            assert!(buffer.rows().all(|row| row.as_ptr().addr() % 64 == 0));
        }
    }

    #[test]
    fn digest_is_of_shape_and_samples_not_of_gaps_or_threads() {
        let packed: Vec<u32> = (0..5 * 3).collect();
        let buffer = Buffer::from_packed(&packed, 5, 3);
        assert_ne!(buffer.digest(), Buffer::from_packed(&packed, 3, 5).digest());
        let mut dirty = BufferMut::<u32>::zeroed(5, 3);
        dirty.samples_mut().fill(77);
        for y in 0..3 {
            dirty.row_mut(y).copy_from_slice(&packed[y * 5..][..5]);
        }
        assert_eq!(dirty.freeze().digest(), buffer.digest());

        let large: Vec<f32> = (0..600 * 2000).map(|i| i as f32).collect();
        let digest_on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| Buffer::from_packed(&large, 600, 2000).digest())
        };
        assert_eq!(digest_on(1), digest_on(3));
    }

    /// Rows are hashed together, with and without gaps.
    #[test]
    fn digest_is_of_the_samples_in_order() {
        for (width, height) in [(5, 7), (16, 7), (32, 7), (3001, 13), (40_001, 3)] {
            let packed: Vec<u32> = (0..width * height).collect();
            let mut hasher = Hasher::new("buffer");
            hasher.text(u32::NAME).int(width.into()).int(height.into());
            let expected = hasher.digest(&Digest::of_bytes(bytemuck::cast_slice(&packed))).finish();
            assert_eq!(Buffer::from_packed(&packed, width as usize, height as usize).digest(), expected, "{width}");
        }
    }

    #[test]
    fn bad_samples_are_counted_but_not_gaps() {
        let mut samples = BufferMut::<f32>::zeroed(5, 3);
        samples.samples_mut().fill(f32::NAN);
        (0..3).for_each(|y| samples.row_mut(y).copy_from_slice(&[0.0, f32::NAN, -1.0, f32::NEG_INFINITY, f32::MAX]));
        let buffer = samples.freeze();
        assert_eq!((buffer.bad_samples(), buffer.clone().bad_samples()), (6, 6));
    }

    #[test]
    fn one_changed_bit_changes_the_digest() {
        let buffer = Buffer::from_packed(&[0.0f32, 1.0], 2, 1);
        assert_ne!(buffer.digest(), Buffer::from_packed(&[-0.0f32, 1.0], 2, 1).digest());
    }
}
