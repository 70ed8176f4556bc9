//! The last step's residuals: every pixel of the wall's tiles against the exact ray–surface intersection.

use crate::Vec3;
use crate::patches::{DepthImage, Patches};
use crate::sensor::DepthBias;
use crate::surface::{Part, PlacedSurface};

/// Mean residual of a tile's pixels; no count where the tile does not lie wholly on one part of the wall.
#[derive(Debug, Clone, Copy, Default)]
pub struct TileResidual {
    /// Number of pixels that agree.
    pub count: f64,
    /// Mean residual m − f(d), metres along the ray.
    pub mean: f64,
    /// Standard deviation of the pixels about their mean.
    pub scatter: f64,
}

/// How the pixels of a tile are taken: every `stride`-th one, without those that are further than `reach` metres off.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// Step between pixels along rows and columns.
    pub stride: usize,
    /// Largest residual that still counts, metres along the ray.
    pub reach: f64,
}

/// Mean residual of tile `i` over its pixels.
pub fn tile_residual(
    image: &DepthImage,
    patches: &Patches,
    i: usize,
    placed: &PlacedSurface,
    bias: &DepthBias,
    sampling: Sampling,
) -> TileResidual {
    let (tile, side) = (patches.list[i].tile, patches.side);
    let corner = tile.1 as usize * side * image.width + tile.0 as usize * side;
    let part_at = |offset: usize| {
        let [x, y] = image.rays[corner + offset];
        placed.depth(&Vec3::new(x, y, 1.0)).1
    };
    let last = side - 1;
    let part = part_at(0);
    if [last, last * image.width, last * (image.width + 1)].into_iter().any(|o| part_at(o) != part) {
        return TileResidual::default();
    }
    let tile = Tile { image, corner, side, bias, sampling };
    match (part, placed.surface.ovality == [0.0; 2]) {
        (Part::Cylinder, true) => tile.residual(|q| placed.cylinder_depth(q)),
        (Part::Cone, true) => tile.residual(|q| placed.cone_depth(q)),
        (Part::Cylinder, false) => tile.residual(|q| placed.rounded(q, placed.cylinder_depth(q), part)),
        (Part::Cone, false) => tile.residual(|q| placed.rounded(q, placed.cone_depth(q), part)),
    }
}

struct Tile<'a> {
    image: &'a DepthImage<'a>,
    corner: usize,
    side: usize,
    bias: &'a DepthBias,
    sampling: Sampling,
}

/// Pixels of a tile's row worked on together: straight loops over them become vector instructions.
const LANES: usize = 16;

impl Tile<'_> {
    #[inline(always)]
    fn residual(&self, depth: impl Fn([f64; 2]) -> f64) -> TileResidual {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for v in (0..self.side).step_by(self.sampling.stride) {
            let (residuals, lanes) = self.row(v, &depth);
            for residual in &residuals[..lanes] {
                let counts = residual.abs() < self.sampling.reach;
                let kept = if counts { *residual } else { 0.0 };
                n += if counts { 1.0 } else { 0.0 };
                sum += kept;
                squares += kept * kept;
            }
        }
        if n < 3.0 {
            return TileResidual::default();
        }
        let mean = sum / n;
        TileResidual { count: n, mean, scatter: ((squares - sum * mean).max(0.0) / (n - 1.0)).sqrt() }
    }

    /// Residuals of a row's pixels, infinite where there is no depth, and how many there are.
    #[inline(always)]
    fn row(&self, v: usize, depth: &impl Fn([f64; 2]) -> f64) -> ([f64; LANES], usize) {
        let start = self.corner + v * self.image.width;
        let (rays, depths) = (&self.image.rays[start..start + self.side], &self.image.depth[start..start + self.side]);
        let mut residuals = [f64::INFINITY; LANES];
        let lanes = self.side.div_ceil(self.sampling.stride).min(LANES);
        if self.sampling.stride == 1 {
            for ((residual, &ray), &measured) in residuals.iter_mut().zip(rays).zip(depths) {
                *residual = self.difference(measured, depth(ray));
            }
        } else {
            let every = rays.iter().zip(depths).step_by(self.sampling.stride);
            for (residual, (&ray, &measured)) in residuals.iter_mut().zip(every) {
                *residual = self.difference(measured, depth(ray));
            }
        }
        (residuals, lanes)
    }

    #[inline(always)]
    fn difference(&self, measured: f32, wall: f64) -> f64 {
        let missing = if measured > 0.0 { 0.0 } else { f64::INFINITY };
        f64::from(measured) - self.bias.measured(wall) + missing
    }
}
