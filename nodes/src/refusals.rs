//! What warps and solvers are refused for: told with values, and with the mend.

use crate::io::warp_tests::{fault, folder, warnings};

const FAR: &str = "make the warp weaker, or look at what feeds it";

const STAGE: &str = r#"
    "plate": Constant(size: (40, 30), color: (1.0, 1.0, 1.0, 1.0)), "twice": Constant(size: (80, 60)),
    "grid": Lattice(domain: "plate", cell: 5.0), "wide": Lattice(domain: "twice", cell: 10.0),
    "ring": Lattice(domain: "plate", cell: 5.0, periodic: X),
    "warp": Arch(grid: "grid"), "other": Arch(grid: "wide"), "round": Affine(grid: "ring"),
    "mask": Threshold(image: "plate", channel: "A", above: 0.5), "parts": Components(mask: "mask"),
    "factor": FeatureFactor(grid: "grid", features: "parts"),
    "far": Affine(grid: "grid", translate: (2e9, 0.0)), "long": Stretch(grid: "grid", x: 1e4),
    "flat": Stretch(grid: "grid", x: 0.0), "handles": HandleFactor(grid: "grid"),
    "kept": FeatureFactor(grid: "grid", features: "parts", exact: Rigid),
    "left": Polygon(domain: "plate", points: [(5.0, 5.0), (14.0, 5.0), (14.0, 25.0), (5.0, 25.0)]),
    "right": Polygon(domain: "plate", points: [(16.0, 5.0), (25.0, 5.0), (25.0, 25.0), (16.0, 25.0)]),
    "both": Combine(masks: ["left", "right"]), "pair": Components(mask: "both"),
    "joined": FeatureFactor(grid: "grid", features: "pair", exact: Rigid),
    "back": Invert(warp: "warp", gives: OtherWay, grid: "grid"), "guide": SimilarityGuide(image: "plate"),
"#;

#[test]
fn refusals_have_values_and_a_mend() {
    let folder = folder();
    let (is, wide) = ("9 x 7 nodes, 5 x 5 px apart, from (0, 0)", "9 x 7 nodes, 10 x 10 px apart, from (0, 0)");
    for (node, parameter, message, hint) in [
        (
            r#"Blend(warp: "warp", from: "other")"#,
            Some("from"),
            format!("it is on another lattice ({wide}) than the warp ({is})"),
            "feed both from one Lattice",
        ),
        (
            r#"Blend(warp: "warp", from: "round")"#,
            Some("from"),
            format!("it is on another lattice ({is}, periodic in x) than the warp ({is})"),
            "feed both from one Lattice",
        ),
        (
            r#"FeatureWarp(warp: "other", factor: "factor")"#,
            Some("warp"),
            format!("it is on another lattice ({wide}) than the factor ({is})"),
            "feed both from one Lattice",
        ),
        (
            r#"FeatureWarp(warp: "back", factor: "factor")"#,
            Some("warp"),
            "the warp says where pixels come from, not where they go".into(),
            "turn it round with Invert(gives: OtherWay)",
        ),
        (
            r#"FeatureFactor(grid: "grid", features: "parts", boundary: Free)"#,
            None,
            "features cover the whole border, and nothing holds the picture".into(),
            "use boundary: Slide, or widen the picture's border with Lattice(overscan: ..)",
        ),
        (
            r#"FeatureWarp(warp: "warp", factor: "kept", on_conflict: KeepShape)"#,
            None,
            "features cover the whole border, and nothing holds the picture".into(),
            "use on_conflict: NoFold, or widen the picture's border with Lattice(overscan: ..)",
        ),
        (
            r#"FeatureWarp(warp: "warp", factor: "kept", overrides: [(label: 99, scale: Some(2.0))])"#,
            Some("overrides"),
            "there is no feature with the label 99; the one feature has the label 1".into(),
            "override labels that are there",
        ),
        (
            r#"FeatureWarp(warp: "warp", factor: "joined", overrides: [(label: 1, scale: Some(2.0)), (label: 2, scale: Some(0.5))])"#,
            Some("overrides"),
            "labels 1 and 2 touch and are one; their overrides differ: scale 2 and 0.5".into(),
            "give both one override, or leave a cell between them",
        ),
        (
            r#"Perspective(grid: "grid", top_left: (20.0, 15.0))"#,
            None,
            "three corners lie on one line: bottom_left (0, 30), top_left (20, 15) and top_right (40, 0) px".into(),
            "put the corners so that they span a convex quadrangle",
        ),
        (
            r#"Perspective(grid: "grid", top_left: (1e200, 0.0))"#,
            None,
            "a corner goes 1e200 px away, and positions overflow".into(),
            "put the corners nearer",
        ),
        (
            r#"Perspective(grid: "grid", bottom_right: (8.0, 6.0))"#,
            None,
            "the horizon runs through the lattice or the rectangle at (".into(),
            "make the quadrangle convex and its sides less convergent",
        ),
        (
            r#"Perspective(grid: "grid", rectangle: (0.0, -100.0, 40.0, 30.0), top_left: (10.0, -100.0), top_right: (30.0, -100.0))"#,
            Some("grid"),
            format!("the whole lattice ({is}) lies beyond the horizon"),
            "make the sides of the quadrangle less convergent, or warp a lattice nearer to it",
        ),
        (
            r#"Stretch(grid: "grid", x: 1e12)"#,
            None,
            "the warp takes the node at column 0, row 0 to (-19999999999980, 0) px; positions reach to 2147483648 px"
                .into(),
            FAR,
        ),
        (
            r#"Blend(warp: "far", amount: 2.0)"#,
            None,
            "the warp takes the node at column 0, row 0 to (4000000000, ".into(),
            FAR,
        ),
        (
            r#"Handles(factor: "handles", points: [(from: (0.0, 0.0), to: (0.0, 1e12))])"#,
            None,
            "the warp takes the node at column 0, row 0 to (".into(),
            FAR,
        ),
        (
            r#"Resample(image: "plate", warp: "long")"#,
            Some("warp"),
            "the result would be 400000 x 30 px; a side may be 1 to 65536 px long".into(),
            "draw the display window alone: crop: true",
        ),
        (
            r#"Resample(image: "plate", warp: "long", fit: true)"#,
            Some("warp"),
            "the result would be 400000 x 30 px; a side may be 1 to 65536 px long".into(),
            "give a size instead of fit, and draw no more than that: crop: true",
        ),
        (
            r#"Resample(image: "plate", warp: "warp", fit: true, size: (9, 9))"#,
            Some("fit"),
            "a size and fit: true exclude each other".into(),
            "leave one of them out",
        ),
        (
            r#"Similarity(guide: "guide", at: [(3.0, 3.0), (40.0, 12.5)])"#,
            Some("at"),
            "at[1] is (40, 12.5) px, outside the picture: x must be at least 0 and less than 40 px, y at least 0 and"
                .into(),
            "move it onto the picture",
        ),
        (
            r#"Similarity(guide: "guide", at: [])"#,
            Some("at"),
            "there are no selection points; at least one is needed".into(),
            "give the centre of a pixel, such as [(0.5, 0.5)]",
        ),
        (
            r#"SimilarityGuide(image: "plate", diameter: 6)"#,
            Some("diameter"),
            "the diameter is 6 px; it must be odd, from 1 to 21 px".into(),
            "use 5 or 7",
        ),
        (
            r#"SimilarityGuide(image: "plate", levels: [])"#,
            Some("levels"),
            "there are no levels".into(),
            "compare the picture: [0]",
        ),
        (
            r#"SimilarityGuide(image: "plate", levels: [0, 1, 0])"#,
            Some("levels"),
            "levels[0] and levels[2] are both 0".into(),
            "name each level once",
        ),
        (
            r#"SimilarityGuide(image: "plate", levels: [0, 7])"#,
            Some("levels"),
            "levels[1] is 7; a picture of 40 x 30 px has levels 0 to 6".into(),
            "leave it out",
        ),
        (
            r#"Invert(warp: "flat")"#,
            Some("warp"),
            "the warp takes all nodes onto one line, and has no inverse".into(),
            "let it keep some width and height",
        ),
    ] {
        let fault = fault(&folder, &format!("{STAGE} \"out\": {node}"));
        assert_eq!((fault.parameter.as_deref(), fault.hint.as_deref()), (parameter, Some(hint)), "{fault:#?}");
        assert!(fault.message.starts_with(&message), "{node}: {fault:#?}");
    }
}

#[test]
fn what_may_not_be_expected_is_told() {
    let folder = folder();
    let told = |nodes: &str| warnings(&folder, &format!("{STAGE} {nodes}"));
    for sound in [
        r#""out": FeatureFactor(grid: "grid", features: "parts", soft: "mask")"#,
        r#""out": FeatureWarp(warp: "warp", factor: "factor")"#,
        r#""out": Invert(warp: "warp")"#,
        r#""out": SaveWarp(warp: "warp", path: "sound.exr")"#,
        r#""out": Handles(factor: "handles", points: [(from: (0.0, 0.0), to: (0.0, 30.0))])"#,
    ] {
        assert_eq!(told(sound), [""; 0], "{sound}");
    }
    for (nodes, message) in [
        (
            r#""elsewhere": Polygon(domain: "twice", points: [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)]),
               "out": FeatureFactor(grid: "grid", features: "parts", soft: "elsewhere")"#,
            "the soft mask's format is x from 0 to 80 and y from 0 to 60, the features' x from 0 to 40 and y from 0 to 30",
        ),
        (
            r#""away": Affine(grid: "grid", translate: (1000.0, 0.0)), "beside": Resample(image: "mask", warp: "away"),
               "out": FeatureFactor(grid: "grid", features: "parts", soft: "beside")"#,
            "the soft mask covers x from 1000 to 1040 and y from 0 to 30, nothing of the lattice",
        ),
        (
            r#""exact": FeatureFactor(grid: "grid", features: "parts", exact: Similarity),
               "out": FeatureWarp(warp: "warp", factor: "exact")"#,
            "exact features keep to the border where they touch it, not to their shape (labels 1); use on_conflict:",
        ),
        (
            r#""bulge": Bulge(grid: "grid"), "more": Lattice(domain: "plate", cell: 5.0, overscan: 64.0),
               "out": Invert(warp: "bulge", grid: "more")"#,
            "the inverse folds in 48 cells: 1082 of its 1155 nodes lie outside of the warp's image, where it is continued; ",
        ),
        (
            r#""off": Affine(grid: "grid", translate: (1e6, 0.0)),
               "out": SaveWarp(warp: "off", path: "off.exr", inverse: true)"#,
            "positions are stored to within 0.031 px only: ",
        ),
        (
            r#""curl": Swirl(grid: "grid", angle: 3600.0, radius: 30.0), "out": FeatureWarp(warp: "curl", factor: "factor")"#,
            "the warp still folds in ",
        ),
        (
            r#""out": Handles(factor: "handles", points: [(from: (1.0, 1.0), to: (1.0, 1.0)), (from: (4.0, 1.0), to: (4.0, 1.0)),
                (from: (1.0, 4.0), to: (1.0, 4.0)), (from: (4.0, 4.0), to: (4.0, 4.0)), (from: (2.0, 3.0), to: (32.0, 3.0))])"#,
            "the handles cannot all be met, and are missed by up to ",
        ),
    ] {
        let told = told(nodes);
        assert!(told.len() == 1 && told[0].starts_with(message), "{nodes}: {told:?}");
    }
}
