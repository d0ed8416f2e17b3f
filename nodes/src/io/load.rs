use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Context, Node, NodeError, Output, Outputs, ReadPath};
use warploom_core::value::Kind;

use super::codec::{self, Encoding, NodeHost};

/// Reads a picture: EXR, PNG, JPEG, TIFF or Radiance HDR, by the content of the file.
///
/// The result is scene-linear, with the primaries of Rec.709, and premultiplied. An EXR keeps all its layers, channels,
/// windows and attributes, and its primaries whatever they are; of a mip map the full resolution is read, and parts that
/// no node looks at are not unpacked. Other files give one layer with channels `R`, `G`, `B` or `Y`, and `A`.
///
/// What these files say of their colour is honoured, or the file is refused:
///
/// - PNG: the first there is of the chunks cICP, iCCP, sRGB, and gAMA with cHRM. PQ and HLG are refused.
/// - JPEG: an ICC profile, else the colour space of Exif: sRGB or Adobe RGB. Inks (CMYK) are refused.
/// - TIFF: an ICC profile, else PrimaryChromaticities; TransferFunction is refused. WhiteIsZero is turned round.
/// - Radiance HDR: EXPOSURE and COLORCORR are divided out, PRIMARIES and PIXASPECT honoured; XYZE and a GAMMA other
///   than 1 are refused.
/// - ICC profiles may be of curves and a matrix, for RGB or grey; tables of colours, Lab and inks are refused. They
///   are taken relative to white. Values outside 0..1 stay.
///
/// A picture of another orientation (Exif of JPEG and PNG, a TIFF's tag) is turned upright, whatever `encoding` is.
/// What else such files hold is left behind: texts, dates, densities, places, thumbnails, further pictures.
#[derive(Clone, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Load {
    /// The file; `####` stands for the frame.
    pub path: ReadPath,
    /// How colour is stored in the file. `Auto` believes the file, any other overrules it. In an EXR it applies to `R`,
    /// `G`, `B` and `Y` of the first layer.
    pub encoding: Encoding,
}

impl Node for Load {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];
    // The decoders of JPEG and DWA choose instructions by the processor.
    const CPU_FAMILY: bool = true;
    const HEEDS_WANTED: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let bytes = cx.read(&self.path)?;
        let wanted = cx.wanted("image");
        let image = codec::decode_wanted(&bytes, self.encoding, wanted, &NodeHost(cx)).or_else(|error| {
            // A decoder that was stopped takes that for a damaged file.
            cx.go_on()?;
            let message = format!("{}: {}", self.path.path().display(), error.message);
            Err(NodeError { message, ..error }.at("path"))
        })?;
        Ok(image.into())
    }
}
