use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_algo::Interrupted;
use warploom_algo::exchange::{self, DecodeError, PixelMap};
use warploom_core::node::{Context, Domain, ErrorClass, In, Node, NodeError, Output, Outputs, ReadPath};
use warploom_core::value::{Buffer, Direction, Grid, Image, Layer, Plane, SampleType};

use super::codec::{self, Encoding, NodeHost};
use super::warp_file::{Channels, Choices, Preset};
use crate::adapt::{view, watch, window};
use crate::warp::Holes;

/// Reads a warp from an EXR of floats that says for each pixel where it comes from: an ST map, UV map or displacement.
///
/// The warp lies on the lattice of the pixels' centres, so that it is there exactly what the file says; outside of the
/// file's data window it continues. Pixels of alpha 0 or below have no position, and nothing is drawn there. In the stats,
/// `pixels` counts the map's pixels and `without_source` those without a position.
#[derive(Clone, Serialize, Deserialize, JsonSchema, SmartDefault)]
#[serde(default, deny_unknown_fields)]
pub struct LoadWarp {
    /// The file; `####` stands for the frame.
    pub path: ReadPath,
    /// Whose map it is: what the numbers mean, and which channels hold them.
    pub preset: Preset,
    /// What the numbers mean, where that is not as the preset has it.
    pub convention: Choices,
    /// Names of the channels, where they are not the preset's.
    pub channels: Channels,
    /// Picture whose format positions refer to; if not connected, the file's own format.
    pub domain: Option<In<Domain>>,
    /// Whether the map says where pixels go instead of where they come from.
    pub inverse: bool,
    /// Whether alpha is passed over: every pixel has a position.
    pub ignore_alpha: bool,
    /// Whether a map of 16-bit floats is read, which is off by as much as 2 px in 4096.
    pub allow_half: bool,
    /// Whether a map is read that was packed with loss (Pxr24, Dwaa, Dwab).
    pub allow_lossy: bool,
}

/// Numbers in the EXR standard of the compressions that change floats.
const LOSSY: [(u8, &str); 3] = [(5, "Pxr24"), (8, "Dwaa"), (9, "Dwab")];

impl Node for LoadWarp {
    const VERSION: u32 = 2;
    const OUTPUTS: &'static [Output] = crate::warp::WARP;
    // The decoder of DWA chooses instructions by the processor.
    const CPU_FAMILY: bool = true;

    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let image = self.read(cx)?;
        let names = self.channels.of(self.preset);
        let layer = self.layer(&image, names)?;
        self.check_packing(&image, layer)?;
        let [x, y] = [self.plane(layer, names[0])?, self.plane(layer, names[1])?];
        let alpha = self.alpha(layer, names[2])?;
        let (pixels, positions) = (window(&image.display), cx.get_optional(&self.domain));
        let positions = positions.map_or(pixels, |windows| window(&windows.display));
        if positions.is_empty() {
            let error = NodeError::refused("the format is empty; positions in it mean nothing");
            return Err(error.at("domain").hint("connect a picture that has pixels"));
        }
        let map = PixelMap { convention: self.convention.of(self.preset), pixels, positions };
        let (data, at_work) = (window(&layer.data), watch(cx));
        let decoded = exchange::decode(&map, data, [view(x), view(y)], alpha.map(view), &at_work);
        let decoded = decoded.map_err(|error| match error {
            DecodeError::Interrupted => at_work.error(Interrupted),
            error => self.refusal(error, names),
        })?;
        let lattice = exchange::pixel_lattice(data);
        let grid =
            Grid { origin: lattice.origin, spacing: lattice.spacing, nodes: lattice.nodes, periodic: [false; 2] };
        let direction = if self.inverse { Direction::DstFromSrc } else { Direction::SrcFromDst };
        Ok(crate::warp::derived(cx, &grid, direction, decoded.positions, Holes::Kept)?
            .stat("pixels", data.width() * data.height())
            .stat("without_source", decoded.without_source))
    }
}

impl LoadWarp {
    /// An error about the file.
    fn about(&self, class: ErrorClass, message: impl std::fmt::Display) -> NodeError {
        NodeError::new(class, format!("{}: {message}", self.path.path().display())).at("path")
    }

    fn read(&self, cx: &Context) -> Result<Image, NodeError> {
        let bytes = cx.read(&self.path)?;
        if !bytes.is_empty() && !codec::is_exr(&bytes) {
            let message = "the file is no EXR; others hold no 32-bit floats, which positions need";
            return Err(self.about(ErrorClass::InputUnsupported, message).hint("write the map as an EXR of floats"));
        }
        codec::decode(&bytes, Encoding::Linear, &NodeHost(cx)).or_else(|error| {
            // A decoder that was stopped takes that for a damaged file.
            cx.go_on()?;
            let NodeError { class, message, hint, .. } = error;
            Err(NodeError { hint, ..self.about(class, message) })
        })
    }

    /// The first layer that has both channels of numbers.
    fn layer<'a>(&self, image: &'a Image, [x, y, _]: [&str; 3]) -> Result<&'a Layer, NodeError> {
        let has_both = |layer: &&Layer| layer.channel(x).is_some() && layer.channel(y).is_some();
        image.layers.iter().find(has_both).ok_or_else(|| {
            const SHOWN: usize = 12;
            let all: Vec<String> =
                image.layers.iter().flat_map(|l| &l.channels).map(|c| format!("`{}`", c.name)).collect();
            let more = if all.len() > SHOWN { format!(" and {} more", all.len() - SHOWN) } else { String::new() };
            let shown = all[..all.len().min(SHOWN)].join(", ");
            let message = format!("no layer has the channels `{x}` and `{y}`; there are {shown}{more}");
            let hint = "take another preset, or name them: channels: (x: \"..\", y: \"..\")";
            self.about(ErrorClass::Refused, message).at("channels").hint(hint)
        })
    }

    fn check_packing(&self, image: &Image, layer: &Layer) -> Result<(), NodeError> {
        let packing = layer.metadata.get("compression").or_else(|| image.metadata.get("compression"));
        let code = packing.and_then(|packing| packing.bytes.first());
        match LOSSY.iter().find(|(lossy, _)| code == Some(lossy)) {
            Some((_, name)) if !self.allow_lossy => {
                let message = format!("the map was packed with loss ({name}), which moves positions");
                let hint = "write it again with Zip, Zips or Piz, or take it as it is: allow_lossy: true";
                Err(self.about(ErrorClass::InputUnsupported, message).hint(hint))
            }
            _ => Ok(()),
        }
    }

    fn plane<'a>(&self, layer: &'a Layer, name: &str) -> Result<&'a Buffer<f32>, NodeError> {
        let channel = layer.channel(name).expect("the layer was chosen for it");
        match &channel.plane {
            Plane::U32(_) => {
                let message = format!("channel `{name}` holds whole numbers (uint), not positions");
                let hint = "write the map as 32-bit floats, or name other channels";
                Err(self.about(ErrorClass::InputUnsupported, message).hint(hint))
            }
            Plane::F32(_) if channel.sample_type == SampleType::Half && !self.allow_half => {
                let message =
                    format!("channel `{name}` holds 16-bit floats (half), which are off by as much as 2 px in 4096");
                let hint = "write the map as 32-bit floats, or take it as it is: allow_half: true";
                Err(self.about(ErrorClass::InputUnsupported, message).hint(hint))
            }
            Plane::F32(plane) => Ok(plane),
        }
    }

    /// The channel that says which pixels have a position. That of a preset may be missing.
    fn alpha<'a>(&self, layer: &'a Layer, name: &str) -> Result<Option<&'a Buffer<f32>>, NodeError> {
        if self.ignore_alpha {
            return Ok(None);
        }
        let refused = |what: &str| {
            let hint = "name another channel, or read every pixel: ignore_alpha: true";
            Err(self.about(ErrorClass::Refused, format!("channel `{name}` {what}")).at("channels").hint(hint))
        };
        match layer.channel(name).map(|channel| &channel.plane) {
            Some(Plane::F32(plane)) => Ok(Some(plane)),
            Some(Plane::U32(_)) => refused("holds whole numbers (uint), not coverage"),
            None if self.channels.alpha.is_none() => Ok(None),
            None => refused("is not in the layer of the map"),
        }
    }

    fn refusal(&self, error: DecodeError, [x, y, alpha]: [&str; 3]) -> NodeError {
        match error {
            DecodeError::NotFinite { pixel: [column, row], count } => {
                let message = format!(
                    "{count} pixels have numbers in `{x}`, `{y}` that are not finite, the first at ({column}, {row})"
                );
                let hint = format!("write 0 to channel `{alpha}` where there is no position");
                self.about(ErrorClass::Refused, message).hint(hint)
            }
            DecodeError::Interrupted | DecodeError::NoSource => {
                let message = format!("no pixel has a position: channel `{alpha}` is 0 or below everywhere");
                self.about(ErrorClass::Refused, message).hint("if it is no coverage, pass it over: ignore_alpha: true")
            }
        }
    }
}
