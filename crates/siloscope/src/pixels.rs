//! The last step's residuals: every pixel of the wall's tiles against the exact ray–surface intersection.

use crate::Vec3;
use crate::patches::{DepthImage, Patches};
use crate::sensor::{DepthBias, NoiseLaw};
use crate::surface::{Part, PlacedSurface};

/// Mean residual of a tile's pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct TileResidual {
    /// Number of pixels that agree.
    pub count: f64,
    /// Mean residual m − f(d), metres along the ray.
    pub mean: f64,
    /// Standard deviation of the pixels about their mean.
    pub scatter: f64,
    /// Whether the tile lies wholly on one part of the wall.
    pub pure: bool,
}

/// Residuals of tile `i` at every `stride`-th pixel, without those beyond `limit` times the noise plus `reach` metres.
pub fn tile_residual(
    image: &DepthImage,
    patches: &Patches,
    i: usize,
    placed: &PlacedSurface,
    bias: &DepthBias,
    noise: &NoiseLaw,
    (stride, reach): (usize, f64),
) -> TileResidual {
    let patch = &patches.list[i];
    let (u0, v0) = (patch.tile.0 as usize * patches.side, patch.tile.1 as usize * patches.side);
    let sigma = noise.sigma(bias.true_depth(patch.measured));
    let limit = 4.0 * sigma + reach;
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    let mut parts = (false, false);
    for v in (v0..v0 + patches.side).step_by(stride) {
        let row = v * image.width;
        for u in (u0..u0 + patches.side).step_by(stride) {
            let measured = image.depth[row + u];
            let [x, y] = image.rays[row + u];
            let (d, part) = placed.depth(&Vec3::new(x, y, 1.0));
            match part {
                Part::Cylinder => parts.0 = true,
                Part::Cone => parts.1 = true,
            }
            let residual = f64::from(measured) - bias.measured(d);
            if measured > 0.0 && residual.abs() < limit {
                n += 1.0;
                sum += residual;
                squares += residual * residual;
            }
        }
    }
    if n < 3.0 {
        return TileResidual::default();
    }
    let mean = sum / n;
    TileResidual {
        count: n,
        mean,
        scatter: ((squares - sum * mean).max(0.0) / (n - 1.0)).sqrt(),
        pure: parts != (true, true),
    }
}
