//! Pictures of meshes.

use rayon::prelude::*;

use super::camera::{Camera, Frame};
use super::cover::{Bins, Edges, NONE, PORTION, Screen, TILE, Tile, pattern};
use super::texture::{Edge, Pyramid, Texture};
use super::{Surface, blend, cross, dot, sub, unit};
use crate::steps::Steps;
use crate::view::{View, ViewMut};
use crate::{Interrupted, Watch};

/// How a mesh is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Where it is seen from.
    pub camera: Camera,
    /// Samples per side of a pixel, 1..=8.
    pub samples: usize,
    /// What lies outside the texture, along u and along v.
    pub edges: [Edge; 2],
    /// Azimuth and elevation of the light, in degrees, which moves with the camera: at (0, 0) it comes from there.
    pub light_deg: [f64; 2],
    /// Part of the light that comes from all sides, 0..=1.
    pub ambient: f64,
    /// Whether the backs of triangles are seen, too.
    pub two_sided: bool,
}

/// A picture of a textured mesh.
///
/// A point p of object space is seen at (w/2 + f x / z, h/2 - f y / z), px, where x, y, z are its distances from the
/// camera to the right, up and along the view, and f = (h/2) / tan(field of view / 2). Of each pixel `samples` squared points
/// are looked at; at each the nearest triangle with z >= near counts. A triangle that is seen at n of N points of a
/// pixel adds n/N of its colour at the mean of those points:
///
/// texture(u, v) * (ambient + (1 - ambient) max(0, normal . light)),
///
/// with alpha unlit. u, v and the normal are interpolated in space, not on screen; the texture is filtered over the part of
/// it that a pixel sees. The normal of a triangle's back is the opposite one.
///
/// * `surface`: uvs per vertex; normals per vertex or none, then each triangle is flat; the triangles' indices less than
///   the count of positions.
/// * `texture`: premultiplied planes R, G, B, A of one size, at least 1 x 1; a missing colour is 0, a missing alpha 1.
/// * `out`: planes R, G, B, A of one size, at most 65536 px a side; every sample is written, 0 where there is nothing.
///
/// Triangles without area, seen edge-on or with a corner that is not finite are not drawn. The nearest surface hides what
/// lies behind it even where the texture is transparent. Of two triangles at one depth the first counts. NaN in texture
/// coordinates and samples gives NaN where it is seen.
///
/// Scratch: a third of the texture (planes that are the same samples in memory count once), 24 bytes per vertex, 8 per triangle and 4 per triangle and tile of 16 x 16 pixels that
/// it may touch.
///
/// Cost: linear in the texture's samples and the vertices; per triangle, in the samples of the pixels of its box.
///
/// M. Olano and T. Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware 1997; J. McCormack,
/// R. Perry, K. Farkas, N. Jouppi, "Feline: fast elliptical lines for anisotropic texture mapping", SIGGRAPH 1999.
pub fn render(
    surface: Surface,
    texture: [Option<View<f32>>; 4],
    look: &Look,
    mut out: [ViewMut<f32>; 4],
    watch: Watch,
) -> Result<(), Interrupted> {
    assert!((1..=8).contains(&look.samples), "{} samples per side", look.samples);
    let texture_size = texture.iter().flatten().next().map_or([1, 1], |plane| [plane.width(), plane.height()]);
    let same = |plane: &View<f32>| [plane.width(), plane.height()] == texture_size;
    assert!(texture.iter().flatten().all(same) && !texture_size.contains(&0), "a texture of {texture_size:?} px");
    assert_eq!(surface.uvs.len(), surface.positions.len(), "one texture coordinate per vertex");
    assert!([0, surface.positions.len()].contains(&surface.normals.len()), "one normal per vertex, or none");
    let size = [out[0].width(), out[0].height()];
    assert!(out.iter().all(|plane| [plane.width(), plane.height()] == size), "sizes differ");
    if size.contains(&0) {
        return Ok(());
    }
    let screen = Screen { size, focal: look.camera.focal(size[1]), near: look.camera.near };
    let frame = look.camera.frame();
    let pyramid = Pyramid::new(&texture, texture_size, watch)?;
    let scene = Scene {
        surface,
        seen: seen(surface.positions, &frame, watch)?,
        texture: Texture::new(texture, texture_size, &pyramid, look.edges),
        light: frame.light(look.light_deg),
        look,
        screen,
    };
    let drawn = |triangle| scene.edges(triangle).map(|_| scene.corners(triangle));
    let bins = Bins::new(&screen, surface.triangles.len(), drawn, watch)?;
    let pattern = pattern(look.samples);
    let rows = screen.tiles()[1];
    let [r, g, b, a] = out.each_mut().map(|plane| std::mem::replace(plane, ViewMut::packed(&mut [], 0, 0)).bands(TILE));
    let bands: Vec<_> = r.into_iter().zip(g).zip(b).zip(a).map(|(((r, g), b), a)| [r.1, g.1, b.1, a.1]).collect();
    let steps = Steps::new(watch, rows);
    bands.into_par_iter().enumerate().try_for_each(|(row, mut band)| {
        let mut tile = Tile::new(screen, &pattern);
        for column in 0..screen.tiles()[0] {
            scene.tile(&mut tile, &bins, [column, row], &pattern, &mut band, watch)?;
        }
        steps.step()
    })
}

/// Positions as seen by the camera.
fn seen(positions: &[[f64; 3]], frame: &Frame, watch: Watch) -> Result<Vec<[f64; 3]>, Interrupted> {
    watch.reserve(size_of_val(positions))?;
    let mut seen = vec![[0.0; 3]; positions.len()];
    seen.par_chunks_mut(PORTION).zip(positions.par_chunks(PORTION)).try_for_each(|(seen, positions)| {
        seen.iter_mut().zip(positions).for_each(|(seen, position)| *seen = frame.seen(*position));
        watch.go_on()
    })?;
    Ok(seen)
}

struct Scene<'a> {
    surface: Surface<'a>,
    seen: Vec<[f64; 3]>,
    texture: Texture<'a>,
    light: [f64; 3],
    look: &'a Look,
    screen: Screen,
}

impl Scene<'_> {
    fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.surface.triangles[triangle].map(|vertex| self.seen[vertex as usize])
    }

    /// None for a triangle that is not seen.
    fn edges(&self, triangle: usize) -> Option<Edges> {
        let edges = Edges::new(self.corners(triangle), self.screen.focal)?;
        (edges.is_front || self.look.two_sided).then_some(edges)
    }

    /// Draws a tile into a band of rows.
    fn tile(
        &self,
        tile: &mut Tile,
        bins: &Bins,
        [column, row]: [usize; 2],
        pattern: &[[f64; 2]],
        band: &mut [ViewMut<f32>; 4],
        watch: Watch,
    ) -> Result<(), Interrupted> {
        let triangles = bins.of(row * self.screen.tiles()[0] + column);
        let columns = column * TILE..((column + 1) * TILE).min(self.screen.size[0]);
        if triangles.is_empty() {
            for plane in band {
                (0..plane.height()).for_each(|y| plane.row_mut(y)[columns.clone()].fill(0.0));
            }
            return Ok(());
        }
        tile.begin(column, row);
        for triangles in triangles.chunks(PORTION) {
            watch.go_on()?;
            for &number in triangles {
                if let Some(edges) = self.edges(number as usize) {
                    tile.draw(number, self.corners(number as usize), &edges);
                }
            }
        }
        for y in 0..band[0].height() {
            for x in columns.clone() {
                let color = self.pixel(tile.seen(x, row * TILE + y), tile.middle(x, row * TILE + y), pattern);
                band.iter_mut().zip(color).for_each(|(plane, sample)| plane.row_mut(y)[x] = sample);
            }
        }
        Ok(())
    }

    /// The colour of a pixel with its middle at `x`, `y` px from the picture's, from the triangles seen at its samples.
    fn pixel(&self, seen: &[u32], [x, y]: [f64; 2], pattern: &[[f64; 2]]) -> [f32; 4] {
        let mut color = [0.0; 4];
        for (first, &number) in seen.iter().enumerate() {
            if number == NONE || seen[..first].contains(&number) {
                continue;
            }
            let mine = || seen.iter().zip(pattern).filter(|(other, _)| **other == number).map(|(_, offset)| offset);
            let count = mine().count();
            // All of them together lie about the middle.
            let mean = |axis: usize| match count == seen.len() {
                true => 0.0,
                false => mine().map(|offset| offset[axis]).sum::<f64>() / count as f64,
            };
            let sample = self.surface_color(number as usize, x + mean(0), y + mean(1));
            let part = count as f32 / seen.len() as f32;
            color = std::array::from_fn(|i| color[i] + part * sample[i]);
        }
        color
    }

    /// The colour of a triangle where it is seen.
    fn surface_color(&self, triangle: usize, x: f64, y: f64) -> [f32; 4] {
        let edges = self.edges(triangle).expect("only what has edges is drawn");
        let (shares, sum) = edges.at(x, y);
        let shares = shares.map(|share| share / sum);
        let uvs = self.surface.triangles[triangle].map(|vertex| self.surface.uvs[vertex as usize]);
        let uv = blend(shares, uvs);
        // With u = U / sum: u' = (U' - u sum') / sum.
        let change = |axis: usize| {
            let slopes = edges.slopes(axis);
            let [along_u, along_v] = blend(slopes, uvs);
            let along_sum = slopes[0] + slopes[1] + slopes[2];
            [(along_u - uv[0] * along_sum) / sum, (along_v - uv[1] * along_sum) / sum]
        };
        let ([u_x, v_x], [u_y, v_y]) = (change(0), change(1));
        let [r, g, b, a] = self.texture.filtered(uv, [u_x, u_y], [v_x, v_y]);
        let lit = self.brightness(triangle, shares, edges.is_front) as f32;
        [lit * r, lit * g, lit * b, a]
    }

    fn brightness(&self, triangle: usize, shares: [f64; 3], is_front: bool) -> f64 {
        let vertices = self.surface.triangles[triangle].map(|vertex| vertex as usize);
        let smooth = if self.surface.normals.is_empty() {
            None
        } else {
            unit(blend(shares, vertices.map(|vertex| self.surface.normals[vertex])))
        };
        let [p, q, r] = vertices.map(|vertex| self.surface.positions[vertex]);
        let normal = smooth.or_else(|| unit(cross(sub(q, p), sub(r, p)))).unwrap_or_default();
        let facing = if is_front { dot(normal, self.light) } else { -dot(normal, self.light) };
        self.look.ambient + (1.0 - self.look.ambient) * facing.max(0.0)
    }
}
