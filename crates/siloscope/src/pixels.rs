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
    match part {
        Part::Cylinder => {
            sums(image, corner, side, bias, sampling, |q| placed.rounded(q, placed.cylinder_depth(q), part))
        }
        Part::Cone => sums(image, corner, side, bias, sampling, |q| placed.rounded(q, placed.cone_depth(q), part)),
    }
}

#[inline]
fn sums(
    image: &DepthImage,
    corner: usize,
    side: usize,
    bias: &DepthBias,
    Sampling { stride, reach }: Sampling,
    depth: impl Fn([f64; 2]) -> f64,
) -> TileResidual {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for v in (0..side).step_by(stride) {
        let start = corner + v * image.width;
        let (rays, depths) = (&image.rays[start..start + side], &image.depth[start..start + side]);
        for (ray, &measured) in rays.iter().zip(depths).step_by(stride) {
            let residual = f64::from(measured) - bias.measured(depth(*ray));
            let counts = measured > 0.0 && residual.abs() < reach;
            let residual = if counts { residual } else { 0.0 };
            n += f64::from(u8::from(counts));
            sum += residual;
            squares += residual * residual;
        }
    }
    if n < 3.0 {
        return TileResidual::default();
    }
    let mean = sum / n;
    TileResidual { count: n, mean, scatter: ((squares - sum * mean).max(0.0) / (n - 1.0)).sqrt() }
}
