//! Small node types that together use every form of port, request and parameter.

use std::sync::atomic::{AtomicU64, Ordering};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use warploom_core::node::{
    Context, Domain, ErrorClass, In, Node, NodeError, Output, Outputs, ReadPath, Reads, Request, WritePath,
};
use warploom_core::registry::{Definition, def};
use warploom_core::value::{Channel, Image, Kind, Plane, Rect, SampleType};

/// How often any of these nodes computed, in this process.
pub static COMPUTED: AtomicU64 = AtomicU64::new(0);

fn count() {
    COMPUTED.fetch_add(1, Ordering::Relaxed);
}

const NUMBER: &[Output] = &[Output::new("number", Kind::Number)];

macro_rules! node {
    ($name:ident { $($(#[$meta:meta])* $field:ident: $type:ty),* $(,)? }) => {
        #[derive(Serialize, Deserialize, JsonSchema, SmartDefault)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name { $($(#[$meta])* pub $field: $type,)* }
    };
}

node!(Const { value: f64 });
node!(Sum { terms: Vec<In<f64>>, bias: f64, });
node!(Split { of: In<f64>, });
node!(Frame {});
node!(Step { of: In<f64>, at: f64, });
node!(Window { of: In<f64>, radius: u32, });
node!(Hold { of: In<f64>, frame: i64, });
node!(Shot { of: In<f64>, });
node!(Scale { of: In<f64>, #[default(1.0)] by: f64, });
node!(OrElse { of: Option<In<f64>>, otherwise: f64, });
node!(Read { path: ReadPath });
node!(Write { of: In<f64>, path: WritePath, });
node!(Picture {
    a: f64,
    b: f64,
    #[default(1)]
    width: u32,
});
node!(Plate {
    a: f64,
    b: f64,
    #[default(1)]
    width: u32,
});
node!(PickA { image: In<Image>, });
node!(Both { image: In<Image>, });
node!(Size { domain: In<Domain>, });
node!(Panic { of: In<f64>, message: String, });
node!(Slow { of: In<f64>, #[default(20)] milliseconds: u64, });
node!(Drift {});

impl Node for Const {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, _: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(self.value.into())
    }
}

impl Node for Sum {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(cx.get_all(&self.terms).into_iter().fold(self.bias, |sum, term| (sum + term) % 1000.0).into())
    }
}

impl Node for Split {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("whole", Kind::Number), Output::new("rest", Kind::Number)];
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let number = cx.get(&self.of);
        Ok(Outputs::new([number.floor().into(), (number - number.floor()).into()]))
    }
}

impl Node for Frame {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    const READS_FRAME: bool = true;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok((cx.request().frame.unwrap_or(-1) as f64).into())
    }
}

impl Node for Step {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(f64::from(u8::from(cx.get(&self.of) > self.at)).into())
    }
}

impl Node for Window {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn needs(&self, _: &str, request: &Request, _: &[i64]) -> Vec<Request> {
        let radius = i64::from(self.radius);
        (-radius..=radius).map(|step| request.at(request.frame.map(|frame| frame + step))).collect()
    }
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let answers = cx.answers(&self.of);
        let sum = answers.iter().fold(0.0, |sum, number| sum + number);
        Ok((sum / answers.len() as f64).into())
    }
}

impl Node for Hold {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn needs(&self, _: &str, request: &Request, _: &[i64]) -> Vec<Request> {
        vec![request.at(Some(self.frame))]
    }
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(cx.get(&self.of).into())
    }
}

impl Node for Shot {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn needs(&self, _: &str, request: &Request, shot: &[i64]) -> Vec<Request> {
        shot.iter().map(|&frame| request.at(Some(frame))).collect()
    }
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(cx.answers(&self.of).iter().fold(0.0, |sum, number| (sum + number) % 1000.0).into())
    }
}

impl Node for Scale {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok((cx.get(&self.of) * self.by % 1000.0).into())
    }
}

impl Node for OrElse {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(cx.get_optional(&self.of).unwrap_or(self.otherwise).into())
    }
}

impl Node for Read {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let text = String::from_utf8(cx.read(&self.path)?).unwrap_or_default();
        let number: Result<f64, _> = text.trim().parse();
        number.map(Outputs::from).map_err(|_| NodeError::new(ErrorClass::InputUnreadable, "it holds no number"))
    }
}

impl Node for Write {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[];
    const SINK: bool = true;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        cx.write(&self.path, format!("{:?}", cx.get(&self.of)).as_bytes())?;
        Ok(Outputs::default())
    }
}

impl Node for Picture {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok(picture(cx, &[("A", self.a), ("B", self.b)], self.width)?.into())
    }
}

fn picture(cx: &Context, channels: &[(&str, f64)], width: u32) -> Result<Image, NodeError> {
    let width = width as usize;
    let channel = |&(name, value): &(&str, f64)| -> Result<Channel, NodeError> {
        let mut plane = cx.plane::<f32>(width, 1)?;
        plane.row_mut(0).fill(value as f32);
        Ok(Channel { name: name.into(), sample_type: SampleType::Float, plane: Plane::F32(plane.freeze()) })
    };
    let channels = channels.iter().map(channel).collect::<Result<_, _>>()?;
    Ok(Image::new(Rect::at(0, 0, width, 1), channels))
}

impl Node for Plate {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = &[Output::new("image", Kind::Image)];
    const HEEDS_WANTED: bool = true;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let wanted = cx.wanted("image");
        let is_wanted = |name: &str| wanted.channels().is_none_or(|names| names.iter().any(|known| known == name));
        let mut channels = vec![("A", self.a), ("B", self.b)];
        channels.retain(|(name, _)| is_wanted(name));
        let made: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
        Ok(Outputs::from(picture(cx, &channels, self.width)?).stat("made", made.concat()))
    }
}

impl Node for Both {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let image = cx.get(&self.image);
        let first = |name: &str| match image.primary().channel(name).map(|channel| &channel.plane) {
            Some(Plane::F32(plane)) => f64::from(plane.row(0)[0]),
            _ => panic!("who reads all is given all"),
        };
        Ok((first("A") + first("B")).into())
    }
}

impl Node for PickA {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn reads(&self, _: &str) -> Reads {
        Reads::Channels(vec!["A".into()])
    }
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        let image = cx.get(&self.image);
        assert_eq!(image.primary().channels.len(), 1, "nothing but what is read may be seen");
        let Some(Plane::F32(plane)) = image.primary().channel("A").map(|channel| &channel.plane) else {
            return Err(NodeError::refused("there is no channel A"));
        };
        Ok((f64::from(plane.row(0)[0]) + plane.width() as f64).into())
    }
}

impl Node for Size {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        Ok((cx.get(&self.domain).display.width() as f64).into())
    }
}

impl Node for Panic {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        let number = cx.get(&self.of);
        if number == 3.0 {
            panic!("{}", self.message);
        }
        Ok(number.into())
    }
}

impl Node for Slow {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, cx: &Context) -> Result<Outputs, NodeError> {
        count();
        for step in 0..self.milliseconds {
            cx.progress(step as f64 / self.milliseconds as f64)?;
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        Ok(cx.get(&self.of).into())
    }
}

impl Node for Drift {
    const VERSION: u32 = 1;
    const OUTPUTS: &'static [Output] = NUMBER;
    fn compute(&self, _: &Context) -> Result<Outputs, NodeError> {
        Ok((COMPUTED.fetch_add(1, Ordering::Relaxed) as f64).into())
    }
}

pub const NODES: &[Definition] = &[
    def::<Both>("Both"),
    def::<Const>("Const"),
    def::<Drift>("Drift"),
    def::<Frame>("Frame"),
    def::<Hold>("Hold"),
    def::<OrElse>("OrElse"),
    def::<Panic>("Panic"),
    def::<PickA>("PickA"),
    def::<Picture>("Picture"),
    def::<Plate>("Plate"),
    def::<Read>("Read"),
    def::<Scale>("Scale"),
    def::<Shot>("Shot"),
    def::<Size>("Size"),
    def::<Slow>("Slow"),
    def::<Split>("Split"),
    def::<Step>("Step"),
    def::<Sum>("Sum"),
    def::<Window>("Window"),
    def::<Write>("Write"),
];
