//! Items sorted by the bands of rows that they touch.

use std::ops::Range;

use crate::{Interrupted, Watch};

/// Items between two looks at the watch.
const RUN: usize = 1 << 14;

/// For each of `count` bands of `height` rows the numbers of the items that touch it, in order; `rows` gives the rows
/// that an item touches. Asks `watch` for the memory.
pub(crate) fn by_band<T>(
    items: &[T],
    rows: impl Fn(&T) -> Range<usize>,
    height: usize,
    count: usize,
    watch: Watch,
) -> Result<Vec<Vec<u32>>, Interrupted> {
    let touched = |item: &T| {
        let rows = rows(item);
        rows.start / height..rows.end.div_ceil(height)
    };
    let mut sizes = vec![0; count];
    for run in items.chunks(RUN) {
        watch.go_on()?;
        run.iter().for_each(|item| sizes[touched(item)].iter_mut().for_each(|size| *size += 1));
    }
    watch.reserve(sizes.iter().sum::<usize>() * size_of::<u32>() + count * size_of::<Vec<u32>>())?;
    let mut bands: Vec<Vec<u32>> = sizes.into_iter().map(Vec::with_capacity).collect();
    for (first, run) in (0..).step_by(RUN).zip(items.chunks(RUN)) {
        watch.go_on()?;
        for (number, item) in (first..).zip(run) {
            bands[touched(item)].iter_mut().for_each(|band| band.push(number));
        }
    }
    Ok(bands)
}
