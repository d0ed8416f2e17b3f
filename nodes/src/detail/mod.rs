//! Detail for pictures that a warp magnified (Brooks, Dodgson 2002; Hertzmann et al. 2001).

mod resynthesis;
mod similar_sets;

pub use resynthesis::Detail;
pub use similar_sets::SimilarSets;

use warploom_algo::transfer;
use warploom_core::node::{Context, NodeError};
use warploom_core::value::{Buffer, Layer, Plane};

use crate::adapt::view_mut;

/// A layer's alpha, and its colour not premultiplied.
type Straight<'a> = (&'a Buffer<f32>, [Buffer<f32>; 3]);

/// A layer's alpha, and the planes of its colour, whose channels are `names`, not premultiplied: where alpha falls off the
/// colour beneath goes on, and no detail is made of the edge. None without alpha.
fn straight<'a>(cx: &Context, layer: &'a Layer, names: &[&str]) -> Result<Option<Straight<'a>>, NodeError> {
    let Some(Plane::F32(alpha)) = layer.channel("A").map(|channel| &channel.plane) else { return Ok(None) };
    let divided = |name: &&str| -> Result<Buffer<f32>, NodeError> {
        let Some(Plane::F32(plane)) = layer.channel(name).map(|channel| &channel.plane) else {
            unreachable!("{name} was found")
        };
        let mut out = cx.plane(layer.data.width(), layer.data.height())?;
        view_mut(&mut out).par_rows(|y, row| {
            row.copy_from_slice(plane.row(y));
            transfer::unpremultiply(row, alpha.row(y));
        });
        Ok(out.freeze())
    };
    let planes: Vec<Buffer<f32>> = names.iter().map(divided).collect::<Result<_, _>>()?;
    Ok(Some((alpha, [0, 1, 2].map(|i| planes[i % planes.len()].clone()))))
}

#[cfg(test)]
mod tests {
    use warploom_core::value::{Plane, Value};

    use crate::io::warp_tests::{folder, run};

    #[test]
    fn colour_stays_near_at_soft_edges() {
        let nodes = r#"
            "plate": Constant(size: (48, 48), color: (0.8, 0.4, 0.2, 1.0)), "grid": Lattice(domain: "plate", cell: 6.0),
            "warp": Affine(grid: "grid", rotate: 20.0, scale: (1.8, 1.8)),
            "drawn": Resample(image: "plate", warp: "warp", filter: Linear), "sets": SimilarSets(image: "plate"),
            "out": Detail(image: "drawn", warp: "warp", sets: "sets")"#;
        let (report, values) = run(&folder(), nodes);
        let Some(Value::Image(image)) = values.first() else { panic!("{:#?}", report.faults) };
        let plane = |name: &str| match &image.primary().channel(name).expect("it is there").plane {
            Plane::F32(plane) => plane,
            Plane::U32(_) => panic!("{name} holds numbers"),
        };
        let (alpha, mut soft) = (plane("A"), 0);
        for (name, colour) in [("R", 0.8), ("G", 0.4), ("B", 0.2)] {
            for (colours, alphas) in plane(name).rows().zip(alpha.rows()) {
                for (sample, alpha) in colours.iter().zip(alphas) {
                    // Light is moved across the edge until blurring it gives back the picture, as at any edge.
                    let near = (sample - colour * alpha).abs() <= 0.6 * colour * alpha;
                    assert!(near, "{name}: {sample} where alpha is {alpha}");
                    soft += usize::from(*alpha > 0.0 && *alpha < 1.0);
                }
            }
        }
        assert!(soft > 300, "{soft} samples lie on soft edges");
    }
}
