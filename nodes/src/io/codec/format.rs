//! Formats that can be written, and what each can hold.

use warploom_core::node::NodeError;

use super::{Compression, Depth, WriteOptions};

/// A format that can be written.
#[derive(Clone, Copy, PartialEq)]
pub enum Format {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
    /// TIFF.
    Tiff,
    /// Radiance HDR.
    Hdr,
}

/// The formats by their extensions.
const FORMATS: [(&str, Format); 7] = [
    ("exr", Format::Exr),
    ("png", Format::Png),
    ("jpg", Format::Jpeg),
    ("jpeg", Format::Jpeg),
    ("tif", Format::Tiff),
    ("tiff", Format::Tiff),
    ("hdr", Format::Hdr),
];

/// Extensions of the formats that can be written.
pub const EXTENSIONS: [&str; FORMATS.len()] = {
    let mut extensions = [""; FORMATS.len()];
    let mut at = 0;
    while at < FORMATS.len() {
        extensions[at] = FORMATS[at].0;
        at += 1;
    }
    extensions
};

impl Format {
    /// The format that `extension` (without the dot, in any case) names, if it has what `options` asks for.
    pub fn of(extension: &str, options: &WriteOptions) -> Result<Self, NodeError> {
        let extension = extension.to_lowercase();
        let named = FORMATS.iter().find(|(known, _)| *known == extension);
        let (_, format) = *named.ok_or_else(|| no_format(&extension))?;
        let compression = (format != Self::Exr && options.compression != Compression::Auto).then(|| {
            let message = format!("{:?} compression is of EXR; .{extension} has none to choose", options.compression);
            NodeError::refused(message).at("compression").hint("leave `compression` out")
        });
        let (name, depths) = format.holds();
        let depth = (options.depth != Depth::Auto && !depths.contains(&options.depth)).then(|| {
            let allowed: Vec<_> = depths.iter().map(|depth| format!("{depth:?}")).collect();
            let message = format!("{name} has no depth {:?}; it may be Auto, {}", options.depth, allowed.join(" or "));
            NodeError::refused(message).at("depth").hint("leave `depth` out")
        });
        NodeError::all([compression, depth].into_iter().flatten().map(Err))?;
        Ok(format)
    }

    /// Its name, and the depths it has.
    fn holds(self) -> (&'static str, &'static [Depth]) {
        match self {
            Self::Exr => ("EXR", &[Depth::Half, Depth::Float]),
            Self::Png => ("PNG", &[Depth::U8, Depth::U16]),
            Self::Jpeg => ("JPEG", &[Depth::U8]),
            Self::Tiff => ("TIFF", &[Depth::U8, Depth::U16, Depth::Float]),
            Self::Hdr => ("Radiance HDR", &[Depth::Float]),
        }
    }
}

fn no_format(extension: &str) -> NodeError {
    let known = EXTENSIONS.map(|extension| format!(".{extension}")).join(", ");
    let what = if extension.is_empty() { "a path without extension".into() } else { format!(".{extension}") };
    NodeError::refused(format!("{what} names no image format; it is one of {known}"))
        .at("path")
        .hint("end the path in one of them")
}
