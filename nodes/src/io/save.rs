use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{Context, In, Node, NodeError, Output, Outputs, WritePath};
use warploom_core::value::Image;

use super::codec::{self, Compression, Depth, Encoding, Format, NodeHost, WriteOptions};

/// Writes a picture in the format that the extension names: exr, png, jpg, jpeg, tif, tiff, hdr.
///
/// EXR keeps every layer, channel, window and attribute; lines take the place of tiles, from the top down. The others
/// hold the display window of the first layer's `R`, `G`, `B` (or `Y`), and straight `A` where the format has alpha;
/// what else there is is left out, and pixels outside the data window are 0. JPEG and HDR have no alpha: they get the
/// colour as seen over black. The same picture gives the same bytes.
///
/// Files say how their colour is stored, so that `Load` and others read what was written: a PNG by the chunks sRGB, gAMA
/// and cHRM, a TIFF and a JPEG by an ICC profile. With `encoding: Raw`, or if the picture is of an EXR whose
/// chromaticities are not those of Rec.709, they say nothing. A Radiance HDR has no words for it and is read as linear:
/// one written with `encoding: Srgb` is to be loaded so. It holds numbers of 3e-39 to 1e38; what is below and NaN are
/// 0, what is above is 1e38.
#[derive(Clone, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct Save {
    /// The picture.
    pub image: In<Image>,
    /// The file; `####` stands for the frame.
    #[schemars(extend("x-extensions" = codec::EXTENSIONS))]
    pub path: WritePath,
    /// How colour is stored. In an EXR it applies to `R`, `G`, `B` and `Y` of the first layer.
    pub encoding: Encoding,
    /// How samples are stored. Channels of identities (uint) stay so.
    pub depth: Depth,
    /// How an EXR is compressed; other formats leave no choice.
    pub compression: Compression,
    /// Quality of a JPEG.
    #[default(90)]
    #[schemars(range(min = 1, max = 100))]
    pub quality: u8,
}

impl Node for Save {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = &[];
    const SINK: bool = true;
    // The encoder of DWA chooses instructions by the processor.
    const CPU_FAMILY: bool = true;

    fn check(&self) -> Result<(), NodeError> {
        Format::of(&self.extension(), &self.options()).map(|_| ())
    }

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = cx.get(&self.image);
        let bytes = codec::encode_image(&image, &self.extension(), &self.options(), &NodeHost(cx))?;
        cx.write(&self.path, &bytes)?;
        Ok(Outputs::default())
    }
}

impl Save {
    fn extension(&self) -> Cow<'_, str> {
        self.path.path().extension().unwrap_or_default().to_string_lossy()
    }

    fn options(&self) -> WriteOptions {
        let Self { encoding, depth, compression, quality, .. } = *self;
        WriteOptions { encoding, depth, compression, quality }
    }
}
