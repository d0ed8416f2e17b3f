//! Where a mesh is seen from.

use super::{dot, sub};

/// A camera that circles a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What lies in the middle of the picture.
    pub target: [f64; 3],
    /// From the target to the camera, positive.
    pub distance: f64,
    /// Around the y axis: 0 looks from +z, 90 from +x.
    pub azimuth_deg: f64,
    /// Above the horizontal plane through the target; 90 looks straight down.
    pub elevation_deg: f64,
    /// How far the picture is turned, clockwise.
    pub roll_deg: f64,
    /// Angle between the picture's upper and lower edge, between 0 and 180.
    pub field_of_view_deg: f64,
    /// What is nearer along the view is cut off; positive.
    pub near: f64,
}

/// Directions of a camera, each of length 1, in object space.
pub(super) struct Frame {
    eye: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
}

/// The direction that an azimuth and an elevation point in.
fn toward(azimuth_deg: f64, elevation_deg: f64) -> [f64; 3] {
    let ([sin_a, cos_a], [sin_e, cos_e]) = (sin_cos(azimuth_deg), sin_cos(elevation_deg));
    [sin_a * cos_e, sin_e, cos_a * cos_e]
}

fn sin_cos(angle_deg: f64) -> [f64; 2] {
    let angle = angle_deg.to_radians();
    [libm::sin(angle), libm::cos(angle)]
}

impl Camera {
    pub(super) fn frame(&self) -> Frame {
        let back = toward(self.azimuth_deg, self.elevation_deg);
        let ([sin_a, cos_a], [sin_e, cos_e]) = (sin_cos(self.azimuth_deg), sin_cos(self.elevation_deg));
        let (right, up) = ([cos_a, 0.0, -sin_a], [-sin_a * sin_e, cos_e, -cos_a * sin_e]);
        let [sin_r, cos_r] = sin_cos(self.roll_deg);
        Frame {
            eye: std::array::from_fn(|i| self.target[i] + self.distance * back[i]),
            right: std::array::from_fn(|i| cos_r * right[i] + sin_r * up[i]),
            up: std::array::from_fn(|i| cos_r * up[i] - sin_r * right[i]),
            forward: back.map(|component| -component),
        }
    }

    /// Distance of the picture's plane, px, for a picture `height` px high.
    pub(super) fn focal(&self, height: usize) -> f64 {
        height as f64 / 2.0 / libm::tan(self.field_of_view_deg.to_radians() / 2.0)
    }
}

impl Frame {
    /// A point as seen by the camera: to the right, up, and along the view.
    pub(super) fn seen(&self, point: [f64; 3]) -> [f64; 3] {
        let from_eye = sub(point, self.eye);
        [dot(self.right, from_eye), dot(self.up, from_eye), dot(self.forward, from_eye)]
    }

    /// The direction, in object space, of a light at an azimuth and elevation that move with the camera.
    pub(super) fn light(&self, [azimuth_deg, elevation_deg]: [f64; 2]) -> [f64; 3] {
        let [x, y, z] = toward(azimuth_deg, elevation_deg);
        std::array::from_fn(|i| x * self.right[i] + y * self.up[i] - z * self.forward[i])
    }
}
