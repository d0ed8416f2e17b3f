//! What warps and solvers are refused for: told with values, and with the mend.

use crate::io::warp_tests::{fault, folder};

const STAGE: &str = r#"
    "plate": Constant(size: (40, 30), color: (1.0, 1.0, 1.0, 1.0)), "twice": Constant(size: (80, 60)),
    "grid": Lattice(domain: "plate", cell: 5.0), "wide": Lattice(domain: "twice", cell: 10.0),
    "ring": Lattice(domain: "plate", cell: 5.0, periodic: X),
    "warp": Arch(grid: "grid"), "other": Arch(grid: "wide"), "round": Affine(grid: "ring"),
    "mask": Threshold(image: "plate", channel: "A", above: 0.5), "parts": Components(mask: "mask"),
    "factor": FeatureFactor(grid: "grid", features: "parts"),
    "kept": FeatureFactor(grid: "grid", features: "parts", exact: Rigid),
    "left": Polygon(domain: "plate", points: [(5.0, 5.0), (14.0, 5.0), (14.0, 25.0), (5.0, 25.0)]),
    "right": Polygon(domain: "plate", points: [(16.0, 5.0), (25.0, 5.0), (25.0, 25.0), (16.0, 25.0)]),
    "both": Combine(masks: ["left", "right"]), "pair": Components(mask: "both"),
    "joined": FeatureFactor(grid: "grid", features: "pair", exact: Rigid),
    "back": Invert(warp: "warp", gives: OtherWay, grid: "grid"),
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
            "three corners lie on one line: bottom_left (0, 30), top_left (20, 15) and top_right (40, 0)".into(),
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
    ] {
        let fault = fault(&folder, &format!("{STAGE} \"out\": {node}"));
        assert_eq!((fault.parameter.as_deref(), fault.hint.as_deref()), (parameter, Some(hint)), "{fault:#?}");
        assert!(fault.message.starts_with(&message), "{node}: {fault:#?}");
    }
}
