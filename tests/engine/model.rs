//! A graph as plain data, what it means, and its text: an oracle that shares nothing with the engine.

use std::collections::{BTreeMap, HashMap, HashSet};

use warploom_tests::Random;

/// A number that may change over frames.
#[derive(Clone, Debug, PartialEq)]
pub enum By {
    Constant(f64),
    Keys(Vec<(i64, f64)>),
    Link(Edge),
}

/// A node and one of its outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    pub node: usize,
    pub output: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Op {
    Const(f64),
    Sum {
        terms: Vec<Edge>,
        bias: f64,
    },
    Split(Edge),
    Frame,
    Step {
        of: Edge,
        at: f64,
    },
    Window {
        of: Edge,
        radius: u32,
    },
    Hold {
        of: Edge,
        frame: i64,
    },
    Shot(Edge),
    Scale {
        of: Edge,
        by: By,
    },
    OrElse {
        of: Option<Edge>,
        otherwise: f64,
    },
    Read {
        file: usize,
        per_frame: bool,
    },
    Write {
        of: Edge,
        file: usize,
    },
    Picture {
        a: By,
        b: f64,
        width: u32,
    },
    /// A picture that holds no more than its readers look at.
    Plate {
        a: f64,
        b: f64,
        width: u32,
    },
    PickA(Edge),
    Both(Edge),
    Size(Edge),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Each names only nodes before it.
    pub ops: Vec<Op>,
    pub names: Vec<String>,
    /// The order in the file.
    pub order: Vec<usize>,
    pub frames: Vec<i64>,
    /// How it is laid out in the file.
    pub layout: u64,
}

/// A value with its bits.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    Number(f64),
    Picture { a: f32, b: f32, width: u32 },
}

impl Seen {
    fn number(&self) -> f64 {
        match self {
            Seen::Number(number) => *number,
            Seen::Picture { .. } => unreachable!("the generator connects kinds that fit"),
        }
    }
}

/// A pair as the oracle sees it: what it is a function of, and what comes out.
#[derive(Clone, Debug)]
pub struct Answer {
    pub identity: String,
    pub values: Vec<Seen>,
}

impl Model {
    fn edges(&self, node: usize) -> Vec<Edge> {
        match &self.ops[node] {
            Op::Const(_) | Op::Frame | Op::Read { .. } | Op::Plate { .. } => vec![],
            Op::Sum { terms, .. } => terms.clone(),
            Op::Scale { of, by: By::Link(link) } => vec![*of, *link],
            Op::Picture { a: By::Link(link), .. } => vec![*link],
            Op::Picture { .. } => vec![],
            Op::OrElse { of, .. } => of.iter().copied().collect(),
            Op::Split(of) | Op::Shot(of) | Op::PickA(of) | Op::Both(of) | Op::Size(of) => vec![*of],
            Op::Step { of, .. } | Op::Window { of, .. } | Op::Hold { of, .. } => vec![*of],
            Op::Scale { of, .. } | Op::Write { of, .. } => vec![*of],
        }
    }

    /// Whether a node is the same whatever the frame.
    pub fn is_static(&self, node: usize) -> bool {
        let inputs_static = || self.edges(node).iter().all(|edge| self.is_static(edge.node));
        match &self.ops[node] {
            Op::Frame | Op::Read { per_frame: true, .. } | Op::Write { .. } => false,
            Op::Scale { by: By::Keys(_), .. } | Op::Picture { a: By::Keys(_), .. } => false,
            Op::Hold { .. } | Op::Shot(_) => true,
            _ => inputs_static(),
        }
    }

    /// What a node needs at a frame, once per input and frame.
    fn needs(&self, node: usize, frame: i64) -> Vec<(usize, i64)> {
        let of = |edge: &Edge, frames: Vec<i64>| frames.into_iter().map(|frame| (edge.node, frame)).collect();
        match &self.ops[node] {
            Op::Window { of: edge, radius } => {
                let radius = i64::from(*radius);
                of(edge, (frame - radius..=frame + radius).collect())
            }
            Op::Hold { of: edge, frame } => of(edge, vec![*frame]),
            Op::Shot(edge) => of(edge, self.frames.clone()),
            _ => self.edges(node).into_iter().map(|edge| (edge.node, frame)).collect(),
        }
    }

    /// The answer of a node at a frame, from scratch.
    pub fn answer(
        &self,
        node: usize,
        frame: i64,
        files: &BTreeMap<String, String>,
        memo: &mut HashMap<(usize, i64), Answer>,
    ) -> Answer {
        if let Some(answer) = memo.get(&(node, frame)) {
            return answer.clone();
        }
        let mut get = |edge: &Edge, frame: i64| self.answer(edge.node, frame, files, memo).values[edge.output].clone();
        let mut by = |by: &By| match by {
            By::Constant(value) => *value,
            By::Keys(keys) => keys_at(keys, frame),
            By::Link(edge) => get(edge, frame).number(),
        };
        let (identity, values) = match &self.ops[node] {
            Op::Const(value) => (format!("const {:x}", value.to_bits()), vec![Seen::Number(*value)]),
            Op::Sum { terms, bias } => {
                let terms: Vec<f64> = terms.iter().map(|edge| get(edge, frame).number()).collect();
                let sum = terms.iter().fold(*bias, |sum, term| (sum + term) % 1000.0);
                (format!("sum {bias} {:x?}", bits(&terms)), vec![Seen::Number(sum)])
            }
            Op::Split(edge) => {
                let of = get(edge, frame).number();
                let values = vec![Seen::Number(of.floor()), Seen::Number(of - of.floor())];
                (format!("split {:x}", of.to_bits()), values)
            }
            Op::Frame => (format!("frame {frame}"), vec![Seen::Number(frame as f64)]),
            Op::Step { of, at } => {
                let of = get(of, frame).number();
                let step = if of > *at { 1.0 } else { 0.0 };
                (format!("step {at} {:x}", of.to_bits()), vec![Seen::Number(step)])
            }
            Op::Window { of, radius } => {
                let r = i64::from(*radius);
                let terms: Vec<f64> = (frame - r..=frame + r).map(|frame| get(of, frame).number()).collect();
                let mean = terms.iter().fold(0.0, |sum, term| sum + term) / terms.len() as f64;
                (format!("window {radius} {:x?}", bits(&terms)), vec![Seen::Number(mean)])
            }
            Op::Hold { of, frame } => {
                let of = get(of, *frame);
                (format!("hold {frame} {:x}", of.number().to_bits()), vec![of])
            }
            Op::Shot(of) => {
                let terms: Vec<f64> = self.frames.iter().map(|&frame| get(of, frame).number()).collect();
                let sum = terms.iter().fold(0.0, |sum, term| (sum + term) % 1000.0);
                (format!("shot {:x?}", bits(&terms)), vec![Seen::Number(sum)])
            }
            Op::Scale { of, by: factor } => {
                let factor = by(factor) + 0.0;
                let of = get(of, frame).number();
                let identity = format!("scale {:x} {:x}", factor.to_bits(), of.to_bits());
                (identity, vec![Seen::Number(of * factor % 1000.0)])
            }
            Op::OrElse { of, otherwise } => {
                let of = of.as_ref().map(|edge| get(edge, frame).number());
                let identity = format!("orelse {otherwise} {:x?}", of.map(f64::to_bits));
                (identity, vec![Seen::Number(of.unwrap_or(*otherwise))])
            }
            Op::Read { file, per_frame } => {
                let text = &files[&read_name(*file, per_frame.then_some(frame))];
                (format!("read {text}"), vec![Seen::Number(text.parse().expect("the files hold numbers"))])
            }
            Op::Write { of, file } => {
                let of = get(of, frame).number();
                (format!("write {} {:x}", write_name(*file, frame), of.to_bits()), vec![Seen::Number(of)])
            }
            Op::Picture { a, b, width } => {
                let a = by(a) + 0.0;
                let picture = Seen::Picture { a: a as f32, b: *b as f32, width: *width };
                (format!("picture {:x} {b} {width}", a.to_bits()), vec![picture])
            }
            Op::Plate { a, b, width } => {
                let plate = Seen::Picture { a: *a as f32, b: *b as f32, width: *width };
                (format!("plate {a} {b} {width} {}", self.wanted(node)), vec![plate])
            }
            Op::Both(edge) => match get(edge, frame) {
                Seen::Picture { a, b, width } => {
                    let sum = Seen::Number(f64::from(a) + f64::from(b));
                    (format!("both {:x} {:x} {width}", a.to_bits(), b.to_bits()), vec![sum])
                }
                Seen::Number(_) => unreachable!("the generator connects kinds that fit"),
            },
            Op::PickA(edge) => match get(edge, frame) {
                Seen::Picture { a, width, .. } => {
                    let picked = Seen::Number(f64::from(a) + f64::from(width));
                    (format!("picka {:x} {width}", a.to_bits()), vec![picked])
                }
                Seen::Number(_) => unreachable!("the generator connects kinds that fit"),
            },
            Op::Size(edge) => match get(edge, frame) {
                Seen::Picture { width, .. } => (format!("size {width}"), vec![Seen::Number(f64::from(width))]),
                Seen::Number(_) => unreachable!("the generator connects kinds that fit"),
            },
        };
        let answer = Answer { identity, values };
        memo.insert((node, frame), answer.clone());
        answer
    }

    /// What those nodes that the sinks need look at of a picture.
    fn wanted(&self, picture: usize) -> &'static str {
        let needed: HashSet<usize> = self.closure().into_iter().map(|(node, _)| node).collect();
        let is_read = |by: fn(&Op) -> bool| {
            let is_reader = |&&node: &&usize| by(&self.ops[node]) && self.edges(node)[0].node == picture;
            needed.iter().any(|node| is_reader(&node))
        };
        if is_read(|op| matches!(op, Op::Both(_))) {
            "all"
        } else if is_read(|op| matches!(op, Op::PickA(_))) {
            "A"
        } else {
            "windows"
        }
    }

    /// Every pair that the sinks need: node, and frame where it has one.
    pub fn closure(&self) -> HashSet<(usize, Option<i64>)> {
        let mut found = HashSet::new();
        let sinks = (0..self.ops.len()).filter(|&node| matches!(self.ops[node], Op::Write { .. }));
        let mut stack: Vec<(usize, i64)> =
            sinks.flat_map(|sink| self.frames.iter().map(move |&frame| (sink, frame))).collect();
        let mut visited = HashSet::new();
        while let Some((node, frame)) = stack.pop() {
            if !visited.insert((node, frame)) {
                continue;
            }
            found.insert((node, (!self.is_static(node)).then_some(frame)));
            stack.extend(self.needs(node, frame));
        }
        found
    }

    /// The text of the graph file.
    pub fn text(&self) -> String {
        let mut random = Random(self.layout);
        let mut text = String::from("// A graph.\nGraph(\n    version: 1,\n");
        let frames: Vec<String> = self.frames.iter().map(i64::to_string).collect();
        text += &format!("    frames: \"{}\",\n    nodes: {{\n", frames.join(","));
        for &node in &self.order {
            let gap = ["", "  ", "\n        "][random.below(3)];
            let note = ["", " // a note", " /* another */"][random.below(3)];
            text += &format!("        \"{}\": {gap}{},{note}\n", self.names[node], self.node_text(node, &mut random));
        }
        text + "    },\n)\n"
    }

    fn node_text(&self, node: usize, random: &mut Random) -> String {
        let edge = |edge: &Edge| {
            let name = &self.names[edge.node];
            match (&self.ops[edge.node], edge.output) {
                (Op::Split(_), 1) => format!("\"{name}.rest\""),
                _ => format!("\"{name}\""),
            }
        };
        let by = |by: &By| match by {
            By::Constant(value) => format!("{value:?}"),
            By::Keys(keys) => format!("Keys({keys:?})"),
            By::Link(link) => edge(link),
        };
        let (name, mut fields) = match &self.ops[node] {
            Op::Const(value) => ("Const", vec![format!("value: {value:?}")]),
            Op::Sum { terms, bias } => {
                let terms: Vec<String> = terms.iter().map(edge).collect();
                ("Sum", vec![format!("terms: [{}]", terms.join(", ")), format!("bias: {bias:?}")])
            }
            Op::Split(of) => ("Split", vec![format!("of: {}", edge(of))]),
            Op::Frame => ("Frame", vec![]),
            Op::Step { of, at } => ("Step", vec![format!("of: {}", edge(of)), format!("at: {at:?}")]),
            Op::Window { of, radius } => ("Window", vec![format!("of: {}", edge(of)), format!("radius: {radius}")]),
            Op::Hold { of, frame } => ("Hold", vec![format!("of: {}", edge(of)), format!("frame: {frame}")]),
            Op::Shot(of) => ("Shot", vec![format!("of: {}", edge(of))]),
            Op::Scale { of, by: factor } => ("Scale", vec![format!("of: {}", edge(of)), format!("by: {}", by(factor))]),
            Op::OrElse { of, otherwise } => {
                let mut fields = vec![format!("otherwise: {otherwise:?}")];
                fields.extend(of.iter().map(|of| format!("of: {}", edge(of))));
                ("OrElse", fields)
            }
            Op::Read { file, per_frame } => {
                let path = if *per_frame { format!("in/{file}.##.txt") } else { format!("in/{file}.txt") };
                ("Read", vec![format!("path: \"{path}\"")])
            }
            Op::Write { of, file } => {
                ("Write", vec![format!("of: {}", edge(of)), format!("path: \"out/{file}.##.txt\"")])
            }
            Op::Picture { a, b, width } => {
                ("Picture", vec![format!("a: {}", by(a)), format!("b: {b:?}"), format!("width: {width}")])
            }
            Op::Plate { a, b, width } => {
                ("Plate", vec![format!("a: {a:?}"), format!("b: {b:?}"), format!("width: {width}")])
            }
            Op::PickA(image) => ("PickA", vec![format!("image: {}", edge(image))]),
            Op::Both(image) => ("Both", vec![format!("image: {}", edge(image))]),
            Op::Size(domain) => ("Size", vec![format!("domain: {}", edge(domain))]),
        };
        if random.below(2) == 0 {
            fields.reverse();
        }
        format!("{name}({})", fields.join([", ", ",\n            "][random.below(2)]))
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn keys_at(keys: &[(i64, f64)], frame: i64) -> f64 {
    if frame <= keys[0].0 {
        return keys[0].1;
    }
    for pair in keys.windows(2) {
        let ((f0, v0), (f1, v1)) = (pair[0], pair[1]);
        if frame < f1 {
            let part = (frame - f0) as f64 / (f1 - f0) as f64;
            return if v0 == v1 { v0 } else { v0 * (1.0 - part) + v1 * part };
        }
    }
    keys[keys.len() - 1].1
}

pub fn read_name(file: usize, frame: Option<i64>) -> String {
    match frame {
        Some(frame) => format!("in/{file}.{}.txt", padded(frame)),
        None => format!("in/{file}.txt"),
    }
}

pub fn write_name(file: usize, frame: i64) -> String {
    format!("out/{file}.{}.txt", padded(frame))
}

fn padded(frame: i64) -> String {
    if frame < 0 { format!("-{:02}", -frame) } else { format!("{frame:02}") }
}
