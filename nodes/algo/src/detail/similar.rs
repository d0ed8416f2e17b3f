//! A training picture with, for each of its pixels, others whose surroundings are alike.

use rayon::prelude::*;

use super::encoding::Coder;
use super::look::{Look, distance, rings, smooth};
use super::picture::{Picture, each, pyramid};
use super::tree::{LEAF, Tree};
use crate::transfer::Encoding;
use crate::view::View;
use crate::{Interrupted, Watch};

/// Members of a set lie at least this far, px, from its pixel and from each other.
const APART: usize = 3;

/// Bytes per pixel while the finest level is made: planes, the pyramid's colours, looks and their tree, two lists of
/// members.
const BYTES: usize = 12 + 16 * 4 / 3 + 2 * size_of::<Look>() + 5 + 2 * size_of::<[Member; 2]>();

/// A training picture as [`detail`](super::detail) needs it.
pub struct SimilarSets {
    pub(super) coder: Coder,
    pub(super) width: usize,
    pub(super) height: usize,
    /// R, G, B, encoded.
    pub(super) planes: [Vec<f32>; 3],
    /// Finest first.
    pub(super) levels: Vec<Level>,
}

/// A level of the training picture's pyramid.
pub(super) struct Level {
    pub picture: Picture,
    pub rings: Vec<Look>,
    /// Two pixels that are like each pixel, the pixel itself where there are none.
    pub similar: Vec<[u32; 2]>,
}

impl SimilarSets {
    /// Width and height of the training picture, px.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Memory it holds.
    pub fn bytes(&self) -> usize {
        let level = |level: &Level| level.rings.len() * (size_of::<Look>() + size_of::<[u32; 2]>() + 16);
        self.planes.iter().map(|plane| plane.len() * 4).sum::<usize>() + self.levels.iter().map(level).sum::<usize>()
    }
}

/// Prepares a training picture for [`detail`](super::detail): its pyramid and, on each level, every pixel's similar set.
///
/// Two pixels are the more alike the less the sum of squared differences of their looks: the six lowest frequencies
/// (DCT-II) of luma and the means of the colour differences of the 5 x 5 pixels around them. A set is the two most
/// alike of those that fall into the same leaf of a tree over all looks, and of the sets of the four neighbours,
/// shifted back; all at least 3 px from each other along an axis.
///
/// - `planes`: R, G, B of the training picture, scene-linear, any size; samples that are not finite count as 0.
/// - `encoding`: what is compared of them.
/// - `levels`: levels of the pyramid, at least 1 (asserted).
/// - `watch`: asked for the memory taken, told the part done.
///
/// Pixels beyond the border are mirrored ones. A picture without pixels gives empty sets.
///
/// Cost: O(n log n) for n pixels. The result does not depend on the count of threads.
///
/// X. Tong et al., "Synthesis of bidirectional texture functions on arbitrary surfaces", SIGGRAPH 2002, section 4
/// (k-coherence); K. He and J. Sun, "Computing nearest-neighbor fields via propagation-assisted kd-trees", CVPR 2012.
pub fn similar_sets(
    planes: &[View<f32>; 3],
    encoding: Encoding,
    levels: usize,
    watch: Watch,
) -> Result<SimilarSets, Interrupted> {
    assert!(levels > 0, "at least one level");
    let (width, height) = (planes[0].width(), planes[0].height());
    assert!(planes.iter().all(|plane| (plane.width(), plane.height()) == (width, height)), "planes of one size");
    watch.reserve(width * height * BYTES)?;
    let coder = Coder::new(encoding);
    let planes = coder.planes(planes, watch)?;
    let empty = width == 0 || height == 0;
    let pictures = if empty { Vec::new() } else { pyramid(&planes, width, height, levels, watch)? };
    let mut levels = Vec::new();
    for (number, picture) in pictures.into_iter().enumerate() {
        watch.progress(1.0 - 0.25_f64.powi(number as i32))?;
        let (similar, rings) = (similar(&picture, watch)?, rings(&picture, watch)?);
        levels.push(Level { picture, rings, similar });
    }
    Ok(SimilarSets { coder, width, height, planes, levels })
}

/// How unlike a pixel is, and which.
type Member = (f32, u32);

/// Every pixel's similar set.
fn similar(picture: &Picture, watch: Watch) -> Result<Vec<[u32; 2]>, Interrupted> {
    let looks = smooth(picture, |_, _| true, watch)?;
    let tree = Tree::new(&looks, watch)?;
    let in_leaf = |number: usize| {
        let leaf = tree.leaf(number);
        let of_pixel = |i: usize| {
            let mut members = [(0.0, 0); LEAF + 1];
            for (member, j) in members.iter_mut().zip(leaf.clone()) {
                *member = (distance(&tree.points[i], &tree.points[j]), tree.order[j]);
            }
            two(picture, tree.order[i], &members[..leaf.len()])
        };
        watch.go_on().map(|()| leaf.clone().map(of_pixel).collect())
    };
    let by_leaf: Vec<Vec<[Member; 2]>> =
        (0..tree.leaf_count()).into_par_iter().map(in_leaf).collect::<Result<_, Interrupted>>()?;
    let mut found = vec![[(0.0, 0); 2]; looks.len()];
    for (set, &pixel) in by_leaf.into_iter().flatten().zip(&tree.order) {
        found[pixel as usize] = set;
    }
    drop(tree);
    let spread = |pixel: usize| {
        let (mut members, mut count) = ([(0.0, 0); 10], 2);
        members[..2].copy_from_slice(&found[pixel]);
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let Some(beside) = picture.beside(pixel, dx, dy) else { continue };
            for (_, member) in found[beside] {
                if let Some(member) = picture.beside(member as usize, -dx, -dy) {
                    members[count] = (distance(&looks[pixel], &looks[member]), member as u32);
                    count += 1;
                }
            }
        }
        two(picture, pixel as u32, &members[..count]).map(|(_, member)| member)
    };
    each(picture.width, picture.height, watch, spread)
}

/// The first and second of some members that lie apart from a pixel and each other; the pixel where there is none.
fn two(picture: &Picture, pixel: u32, members: &[Member]) -> [Member; 2] {
    let none = (f32::INFINITY, pixel);
    let best = |from: [u32; 2]| {
        members.iter().copied().fold(none, |best, member| {
            let better = member < best && from.iter().all(|&from| apart(picture.width, member.1, from) >= APART);
            if better { member } else { best }
        })
    };
    let first = best([pixel; 2]);
    [first, best([pixel, first.1])]
}

/// The larger of two pixels' distances along x and y, px.
fn apart(width: usize, a: u32, b: u32) -> usize {
    let [[ax, ay], [bx, by]] = [a, b].map(|pixel| [pixel as usize % width, pixel as usize / width]);
    ax.abs_diff(bx).max(ay.abs_diff(by))
}
