//! What the tiles of a depth image read: mean depth, its variance, and how smoothly neighbours continue.

use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::surface_fit::tiles::{NONE, Patches};

/// A frame's tiles as the joint fit reads them.
#[derive(Debug, Clone)]
pub struct Readings<'a> {
    /// The tiles.
    pub patches: &'a Patches,
    /// Variance of each tile's mean by the sensor's noise, m².
    pub variance: Vec<f64>,
    /// Distance of each tile from the mean of its opposite neighbours, metres: small where a surface is smooth.
    pub deviation: Vec<f64>,
    /// Weights of a tile's nine nodes in the mean over its pixels.
    pub node_weights: [f64; 9],
    /// Size of a pixel at depth 1.
    pub pixel: f64,
}

/// Least standard deviation of a tile's mean, metres: rounding, and nine nodes in place of all pixels.
const RESOLUTION: f64 = 2e-5;

/// A tile's pixels scatter surely more than the noise law says where their variance exceeds it by this factor.
const SURELY: f64 = 1.5;

impl<'a> Readings<'a> {
    /// Of tiles with a noise law and a depth bias.
    pub fn new(patches: &'a Patches, noise: &NoiseLaw, bias: &DepthBias, pixel: f64) -> Self {
        let variance = patches.list.iter().map(|p| {
            let expected = noise.sigma(bias.true_depth(p.measured)).powi(2);
            let own = p.scatter * p.scatter;
            let single = if own > SURELY * expected { own } else { expected };
            (single * patches.common_noise / p.count.max(1.0)).max(RESOLUTION * RESOLUTION)
        });
        Self {
            variance: variance.collect(),
            deviation: (0..patches.list.len()).map(|i| deviation(patches, i)).collect(),
            node_weights: node_weights(patches.side),
            patches,
            pixel,
        }
    }
}

/// Weights of the nodes at t, s ∈ {−1, 0, 1} that give a quadratic's mean over a square of pixels.
pub fn node_weights(side: usize) -> [f64; 9] {
    let (n, last) = (side as f64, side.max(2) as f64 - 1.0);
    let square = (n * n - 1.0) / (3.0 * last * last); // mean of t² over the pixels
    let line = [0.5 * square, 1.0 - square, 0.5 * square];
    std::array::from_fn(|i| line[i / 3] * line[i % 3])
}

/// Largest deviation that is told: without neighbours, or at an edge.
const EDGE: f64 = 0.02;

/// Distance from the mean of opposite neighbours, of the better of two directions, metres along the ray.
fn deviation(patches: &Patches, i: usize) -> f64 {
    let (Some(patch), Some(near)) = (patches.list.get(i), patches.neighbours.get(i)) else { return EDGE };
    let inverse = |k: usize| {
        let at = near.get(k).copied().filter(|&n| n != NONE)?;
        patches.list.get(at as usize).map(|p| 1.0 / p.measured)
    };
    let bent = |a: usize, b: usize| Some((1.0 / patch.measured - 0.5 * (inverse(a)? + inverse(b)?)).abs());
    let least = [bent(3, 4), bent(1, 6)].into_iter().flatten().fold(f64::INFINITY, f64::min);
    (least * patch.measured * patch.measured).min(EDGE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_weights_give_a_quadratics_mean() {
        for side in [4usize, 6, 8, 13, 16] {
            let t = |k: usize| 2.0 * k as f64 / (side - 1) as f64 - 1.0;
            let value = |t: f64, s: f64| 0.3 + 0.2 * t - 0.1 * s + 0.5 * t * t - 0.7 * s * s + 0.4 * t * s;
            let all = (0..side * side).map(|i| value(t(i % side), t(i / side))).sum::<f64>() / (side * side) as f64;
            let nodes = (0..9).map(|i| value((i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0));
            let mean: f64 = nodes.zip(node_weights(side)).map(|(v, w)| v * w).sum();
            assert!((mean - all).abs() < 1e-13, "{side}");
        }
    }
}
