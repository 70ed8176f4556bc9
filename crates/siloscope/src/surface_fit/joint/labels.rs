//! What each tile is: wall, a deposit on the wall, or something else before or behind it.
//!
//! Each tile has a likelihood under every label; the labels of neighbours are coupled (Potts, mean field). A tile of the
//! wall gains by its residual and by its normal. What is not wall may lie anywhere in front of it, and hardly behind it:
//! the asymmetry needs no constant of its own.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::predict::Sight;
use crate::surface_fit::joint::readings::Readings;
use crate::surface_fit::tiles::NONE;

/// Model error of a part and what fractions of the tiles have which label.
#[derive(Debug, Clone, Copy)]
pub struct LabelModel {
    /// Model error of cylinder and cone, metres across the wall.
    pub tau: [f64; 2],
    /// Fractions of wall, of what lies before it, and of what lies anywhere.
    pub fractions: [f64; 3],
    /// Whether the fit is still far from its answer: neighbours count less, and both sides alike.
    pub annealed: bool,
    /// Whether deposits on the wall have a label.
    pub deposits: bool,
    /// Radius of the silo, metres.
    pub size: f64,
}

/// Labels of all tiles.
#[derive(Debug, Clone, Default)]
pub struct Labels {
    /// Probability that a tile is wall.
    pub wall: Vec<f64>,
    /// Log-likelihood of a tile under the mixture.
    pub log_likelihood: Vec<f64>,
    /// Variance of a wall tile's residual, m².
    pub variance: Vec<f64>,
    /// Whether a tile belongs to a patch of deposit.
    pub deposit: Vec<bool>,
    /// Number of patches of deposit.
    pub patches: usize,
    /// Mean probabilities of the labels.
    pub fractions: [f64; 3],
}

/// Range of what lies before a wall, and of what lies anywhere, metres: their densities are uniform over it.
const BEFORE: f64 = 1.0;
const ANYWHERE: f64 = 2.0;
/// Directions of a wall's tiles scatter by this beside their own uncertainty: seams and dents, rad.
const WALL_TURN: f64 = 0.06;
/// Directions of other smooth surfaces near the wall's, rad.
const OTHER_TURN: f64 = 0.15;
/// Directions of a deposit's tiles, rad, and its smoothness: deviation of a tile from its neighbours per metre of depth.
const DEPOSIT_TURN: f64 = 0.12;
const DEPOSIT_ROUGHNESS: f64 = 7e-4 / 3.0;
/// A deposit is thinner than this fraction of the radius, parallel within this angle, and larger than so many tiles.
const DEPOSIT_DEPTH: f64 = 0.1;
const DEPOSIT_ANGLE: f64 = 0.35;
const DEPOSIT_TILES: usize = 6;
/// Smoothness of feed: deviation of a tile from its neighbours per metre of depth, and the least depth that counts.
const FEED_ROUGHNESS: f64 = 3e-3 / 3.0;
const LEAST_DEPTH: f64 = 0.5;
/// A tile of another surface costs this much, nats: its height is free, where that of the wall is not.
const OTHER_SURFACE: f64 = 3.0;
/// Squared deviations beyond this count as an edge.
const EDGE: f64 = 60.0;
/// Log-likelihood of a tile of smooth surface behind the wall.
const BEHIND: f64 = -30.0;
/// Log odds beyond which neighbours change nothing: they add 8 couplings at most, and 1e-5 is no chance.
const SURE: f64 = 17.0;
/// Half the logarithm of 2π.
const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_8;

/// Labels the tiles; where there is no sight of the wall, a tile is none.
pub fn label(readings: &Readings, sights: &[Option<Sight>], model: &LabelModel) -> Labels {
    let n = sights.len();
    let mut labels = Labels {
        wall: vec![0.0; n],
        log_likelihood: vec![0.0; n],
        variance: vec![f64::INFINITY; n],
        deposit: vec![false; n],
        ..Labels::default()
    };
    for (i, sight) in sights.iter().enumerate() {
        if let (Some(sight), Some(variance)) = (sight, labels.variance.get_mut(i)) {
            let tau = model.tau[usize::from(sight.at.part == Part::Cone)] / sight.rate;
            *variance = readings.variance.get(i).copied().unwrap_or(0.0) + (tau * tau).min(0.04);
        }
    }
    if model.deposits {
        mark_deposits(readings, sights, model, &mut labels);
    }
    let mut odds = vec![f64::NEG_INFINITY; n];
    let mut sums = [0.0; 3];
    let log_fractions = model.fractions.map(f64::ln);
    for (i, sight) in sights.iter().enumerate() {
        let Some(sight) = sight.filter(|_| readings.patches.list.get(i).is_some_and(|p| p.smooth)) else { continue };
        let [wall, before, anywhere] = log_densities(readings, &sight, i, model, &labels, &log_fractions);
        let most = wall.max(before).max(anywhere);
        let densities = [wall, before, anywhere].map(|value| (value - most).exp());
        let (other, all) = (densities[1] + densities[2], densities.iter().sum::<f64>());
        odds[i] = if other > 0.0 { wall - most - other.ln() } else { SURE };
        labels.log_likelihood[i] = most + all.ln();
        for (sum, value) in sums.iter_mut().zip(densities) {
            *sum += value / all;
        }
    }
    couple(readings, &odds, if model.annealed { 0.2 } else { 0.7 }, &mut labels.wall);
    let total = sums.iter().sum::<f64>().max(1.0);
    labels.fractions = sums.map(|sum| (sum / total).clamp(0.01, 0.97));
    labels
}

/// Log densities of a tile as wall, as what lies before it, and as anything, with their fractions.
fn log_densities(
    readings: &Readings,
    sight: &Sight,
    i: usize,
    model: &LabelModel,
    labels: &Labels,
    [of_wall, of_before, of_any]: &[f64; 3],
) -> [f64; 3] {
    let variance = labels.variance.get(i).copied().unwrap_or(f64::INFINITY);
    let tau = model.tau[usize::from(sight.at.part == Part::Cone)];
    let sigma_normal = readings.patches.list.get(i).map_or(0.0, |p| p.sigma_normal);
    let spread = WALL_TURN.powi(2) + sigma_normal.powi(2) + (1.2 * tau.min(0.02)).powi(2);
    let elsewhere = (OTHER_TURN * OTHER_TURN).max(2.25 * spread);
    let gain = |spread: f64| (elsewhere / spread).ln() + 1.0 - (0.5 * sight.angle2 / spread).min(8.0);
    let normal = |squared: f64, variance: f64| -0.5 * squared - 0.5 * variance.ln() - HALF_LOG_TAU;
    let squared = sight.residual * sight.residual / variance;
    let wall = normal(squared, variance) + gain(spread);
    let is_before = model.annealed || sight.residual < 2.0 * variance.sqrt();
    let (own, depth) = (readings.variance.get(i).copied().unwrap_or(0.0), sight.depth.max(LEAST_DEPTH));
    let deviation = readings.deviation.get(i).copied().unwrap_or(1.0);
    let smooth = |roughness: f64| {
        let variance = 1.5 * own + (roughness * depth).powi(2);
        normal((deviation * deviation / variance).min(EDGE), variance)
    };
    let rough = if model.annealed { FEED_ROUGHNESS + 20.0 * (tau - 5e-4).max(0.0) / depth } else { FEED_ROUGHNESS };
    let mut before = if is_before { (smooth(rough) - OTHER_SURFACE).max(-BEFORE.ln()) } else { BEHIND };
    if labels.deposit.get(i).copied().unwrap_or(false) {
        let turn = DEPOSIT_TURN * DEPOSIT_TURN + sigma_normal * sigma_normal;
        before = before.max(smooth(DEPOSIT_ROUGHNESS) + gain(turn));
    }
    [wall + of_wall, before + of_before, of_any - ANYWHERE.ln()]
}

/// Probabilities from log odds whose neighbours' labels are coupled: mean field, three sweeps.
fn couple(readings: &Readings, odds: &[f64], coupling: f64, wall: &mut [f64]) {
    let logistic = |odds: f64| 1.0 / (1.0 + (-odds.clamp(-40.0, 40.0)).exp());
    wall.iter_mut().zip(odds).for_each(|(p, odds)| *p = logistic(*odds));
    for _ in 0..3 {
        let before = wall.to_vec();
        for (i, p) in wall.iter_mut().enumerate() {
            let Some(near) = readings.patches.neighbours.get(i) else { continue };
            let own = odds.get(i).copied().unwrap_or(f64::NEG_INFINITY);
            if own.abs() >= SURE {
                *p = if own > 0.0 { 1.0 } else { 0.0 };
                continue;
            }
            let around =
                near.iter().map(|&n| if n == NONE { 0.5 } else { before.get(n as usize).copied().unwrap_or(0.5) });
            *p = logistic(own + coupling * (2.0 * around.sum::<f64>() - 8.0));
        }
    }
}

/// Marks tiles before the wall that are parallel to it and connected.
fn mark_deposits(readings: &Readings, sights: &[Option<Sight>], model: &LabelModel, labels: &mut Labels) {
    let candidate = |i: usize| {
        let Some(Some(sight)) = sights.get(i) else { return false };
        let off = -sight.residual * sight.rate;
        let sure = 3.0 * labels.variance.get(i).copied().unwrap_or(f64::INFINITY).sqrt();
        let parallel = sight.angle2 < DEPOSIT_ANGLE * DEPOSIT_ANGLE;
        sight.residual < -sure && off > 1e-3 && off < DEPOSIT_DEPTH * model.size && parallel
    };
    let mut open: Vec<bool> = (0..sights.len()).map(candidate).collect();
    let (mut patch, mut count) = (Vec::new(), 0);
    for first in 0..open.len() {
        if !std::mem::take(&mut open[first]) {
            continue;
        }
        patch.clear();
        patch.push(first);
        let mut at = 0;
        while let Some(&tile) = patch.get(at) {
            at += 1;
            for &n in readings.patches.neighbours.get(tile).into_iter().flatten().filter(|n| **n != NONE) {
                if open.get_mut(n as usize).is_some_and(std::mem::take) {
                    patch.push(n as usize);
                }
            }
        }
        if patch.len() >= DEPOSIT_TILES {
            count += 1;
            patch.iter().for_each(|&i| labels.deposit[i] = true);
        }
    }
    labels.patches = count;
}
