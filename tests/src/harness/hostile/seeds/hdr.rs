//! Radiance HDR: each scan line's bytes by component, as runs; as the old runs of whole pixels; or plain.

use warploom_core::value::SampleType;

/// All variations.
pub fn all() -> Vec<(String, Vec<u8>)> {
    let mut old = head(20, 12);
    let mut plain = head(7, 9);
    for y in 0..12 {
        // A pixel, then marks of runs of the one before: 3, 11 and a mark of the next digit, 1 + 4 more pixels.
        old.extend([[90, 80 + y, 70, 128], [1, 1, 1, 3], [60, y, 50, 130], [1, 1, 1, 9], [9, 9, 9, 120]].concat());
        old.extend([[1, 1, 1, 4], [200, 100, y, 127]].concat());
    }
    (0..63).for_each(|i| plain.extend([i * 4, 255 - i, i + 20, 120 + i / 8]));
    vec![
        ("runs by component".to_owned(), super::written(&["B", "G", "R"], SampleType::Float, "hdr")),
        ("runs of pixels".to_owned(), old),
        ("plain".to_owned(), plain),
    ]
}

fn head(width: usize, height: usize) -> Vec<u8> {
    format!(
        "#?RADIANCE\n# drawn\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1.5\nCOLORCORR=1.0 1.0 1.0\n\n-Y {height} +X {width}\n"
    )
    .into_bytes()
}
