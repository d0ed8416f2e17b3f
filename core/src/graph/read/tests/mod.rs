//! Ron is the arbiter of what RON is; people are the arbiters of what is said about it.

pub(in crate::graph) mod arbiter;
pub(in crate::graph) mod dice;
mod messages;
mod speed;

/// Graphs as people write them.
const GRAPHS: [&str; 4] = [
    r#"Graph(
    version: 1,
    frames: "1001-1012",                                   // optional; --frames overrides
    nodes: {
        "plate":  Load(path: "plates/sh010.####.exr"),
        "mask":   Threshold(image: "plate", channel: "A", above: 0.5),
        "parts":  Components(mask: "mask"),
        "grid":   Lattice(domain: "plate", cell: 5.0),
        "factor": FeatureFactor(grid: "grid", features: "parts", weight: 10.0, radius: 2.0),
        "bend":   Arc(grid: "grid", angle: 60.0),
        "keep":   FeatureWarp(warp: "bend", factor: "factor", mode: Similarity),
        "warped": Resample(image: "plate", warp: "keep"),
        "out":    Save(image: "warped", path: "out/sh010.####.exr"),
    },
)
"#,
    r##"#![enable(implicit_some, unwrap_newtypes)]
/* a matte /* and its holes */ */
Graph(version: 1, nodes: {
    "ruß": Load(path: r"C:\plates\日本.exr", layers: [r#"a "b""#, "c\u{e9}\x41\n", 'x'], raw: true),
    "fade": Gain(image: "ruß.rgb", gain: Keys([(1001, 0.0), (1_012, 6.0e1), (0x3FF, -.5)]), by: Some(1.5)),
    "mix": Merge(images: ["ruß", "fade"], seed: 18446744073709551615, size: (1920, 1080), none: None,),
})
"##,
    "Graph(\n\tversion: 1,\n\tnodes: {\n\t\t\"a\": Noise(\n\t\t\tsize: (64, 64),\n\t\t\ttable: {\"x\": 1, \"y\": [2, 3]},\n\
     \t\t\tbytes: b\"\\xff\\\"\",\n\t\t\tbounds: (inf, -inf, NaN, 1u8, 2.5f32, 0..10, ..=3),\n\t\t),\n\t\t\"b\": Empty(),\n\t},\n)\n",
    r#"(frames: "1-5", nodes: {"a": Solid(color: (0.5, 0.25, 1e-3, 1.)), "b": Blur(image: "a", radius: +3)}) // end"#,
];
