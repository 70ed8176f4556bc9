//! Rays of an image's tile.

use crate::Vec3;
use crate::geometry::depth_image::DepthImage;
use crate::surface_fit::tile_plane::Plane;

/// What only the tile of an image has: its rays, and how its depth changes.
#[derive(Debug, Clone, Copy)]
pub struct TileRays {
    /// Rays `(x/z, y/z)` of the first row's first and last pixel, then of the last row's.
    corners: [[f64; 2]; 4],
    /// Ray of the centre.
    centre: [f64; 2],
    /// Change of the measured depth per pixel along the image's rows and columns, over the tile and its neighbours.
    pub slopes: [f64; 2],
    /// The same over the tile alone.
    pub own_slopes: [f64; 2],
}

impl TileRays {
    /// Of the tile whose first pixel is `corner`.
    #[inline]
    pub fn of(image: &DepthImage, corner: usize, side: usize, planes: [Plane; 2]) -> Self {
        let last = side - 1;
        let at = |u: usize, v: usize| image.ray(corner + v * image.width + u);
        let [slopes, own_slopes] = planes.map(|plane| [plane.b, plane.c]);
        let (p, q) = (at(last / 2, last / 2), at(last.div_ceil(2), last.div_ceil(2)));
        Self {
            corners: [at(0, 0), at(last, 0), at(0, last), at(last, last)],
            centre: [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])],
            slopes,
            own_slopes,
        }
    }

    /// Mean of the corners' rays.
    pub fn mean(&self) -> Vec3 {
        let [nw, ne, sw, se] = &self.corners;
        let mean = |k: usize| 0.25 * (nw[k] + ne[k] + sw[k] + se[k]);
        Vec3::new(mean(0), mean(1), 1.0)
    }

    /// Change of the ray per pixel along the image's rows and columns.
    pub fn steps(&self, side: usize) -> [Vec3; 2] {
        let [nw, ne, sw, se] = &self.corners;
        let scale = 0.5 / (side - 1) as f64;
        let along = |k: usize| scale * (ne[k] + se[k] - nw[k] - sw[k]);
        let down = |k: usize| scale * (sw[k] + se[k] - nw[k] - ne[k]);
        [Vec3::new(along(0), along(1), 0.0), Vec3::new(down(0), down(1), 0.0)]
    }

    /// Rays of the corners, the middles of the sides, and the centre, row by row.
    ///
    /// A distorted lens bends the lines between corners: the middle of a side is taken as half as far off the straight
    /// line as the centre is off the corners' mean.
    #[inline(always)]
    pub fn nodes(&self) -> [[f64; 2]; 9] {
        let [nw, ne, sw, se] = self.corners;
        let mean = self.mean();
        let bow = [0.5 * (self.centre[0] - mean.x), 0.5 * (self.centre[1] - mean.y)];
        let between = |p: [f64; 2], q: [f64; 2]| [0.5 * (p[0] + q[0]) + bow[0], 0.5 * (p[1] + q[1]) + bow[1]];
        [nw, between(nw, ne), ne, between(nw, sw), self.centre, between(ne, se), sw, between(sw, se), se]
    }

    /// Two places between the nodes, on the diagonal: their row and column, and their ray.
    #[inline(always)]
    pub fn probes(&self, side: usize) -> [(f32, [f64; 2]); 2] {
        let last = (side - 1) as f32;
        let towards = |corner: [f64; 2]| [0.5 * (corner[0] + self.centre[0]), 0.5 * (corner[1] + self.centre[1])];
        [(0.25 * last, towards(self.corners[0])), (0.75 * last, towards(self.corners[3]))]
    }
}
