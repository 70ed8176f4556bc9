//! The uncertainty of the volume, by its causes.

use super::cells::Cell;
use super::detail;
use super::fit::{Surface, WIDER};
use super::grid::Grid;
use super::jacobian::{CalibrationJacobian, DEPTH, GEOMETRY, POSE, Parameters, deviation, share};
use super::setup::Setup;
use super::trend::Observation;
use super::under::Under;
use super::volume::Volume;
use nalgebra::DVector;
use std::f64::consts::TAU;

/// Standard deviations of the volume, cubic metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UncertaintyBudget {
    /// By the camera's pose.
    pub pose: f64,
    /// By the silo's geometry.
    pub geometry: f64,
    /// By the sensor's systematic depth error, of which a scale error is a part.
    pub depth: f64,
    /// By the sensor's noise.
    pub noise: f64,
    /// By what is not seen of the surface.
    pub unseen: f64,
    /// By the grid.
    pub grid: f64,
    /// All together, with the correlations of pose, geometry and depth.
    pub total: f64,
}

/// How much the volume shrinks for each metre that a cell's height z is larger.
fn influences(surface: &Surface, volume: &Volume) -> (Vec<f64>, DVector<f64>) {
    let reach = surface.grid.reach;
    let rough = (surface.roughness / reach).powi(2);
    let mut known = vec![false; surface.grid.count()];
    surface.used.iter().for_each(|(i, _)| known[*i] = true);
    let own = if rough > 0.0 { detail::gather(&surface.grid, &known, &volume.cells) } else { vec![0.0; known.len()] };
    let mut left = volume.functions.clone();
    let mut kept = Vec::with_capacity(surface.used.len());
    for (i, o) in &surface.used {
        let weight = own[*i] * surface.kept(*i);
        o.row.iter().for_each(|(j, value)| left[j] -= weight * value * reach);
        kept.push(weight);
    }
    let spread = surface.trend.spread(&left);
    let through =
        |o: &Observation| o.row.iter().map(|(j, value)| spread[j] * value).sum::<f64>() / (o.variance * reach);
    let all = surface.used.iter().zip(kept).map(|((_, o), weight)| weight + through(o)).collect();
    (all, left)
}

/// The budget, and the derivatives of the volume by the calibration's parameters.
pub fn uncertainty_budget(
    surface: &Surface,
    volume: &Volume,
    cells: &[Cell],
    jacobian: &CalibrationJacobian,
    setup: &Setup,
) -> (UncertaintyBudget, Parameters) {
    let covariance = &setup.covariance;
    let (influences, left) = influences(surface, volume);
    let mut derivatives = Parameters::zeros();
    let mut noise = 0.0;
    for (((i, _), slopes), influence) in surface.used.iter().zip(&surface.slopes).zip(influences) {
        let cell = &cells[*i];
        derivatives -= influence * jacobian.heights(cell.mean, *slopes);
        noise += influence * influence * cell.variance;
    }
    let of_surface = noise;
    let under = setup.under();
    for (cell, weight) in cells.iter().zip(&volume.bare).filter(|(_, weight)| **weight > 0.0) {
        let [x, y, _] = cell.mean;
        derivatives -= *weight * jacobian.heights(cell.mean, under.slopes(x, y));
        noise += weight * weight * cell.variance;
    }
    derivatives[4] += volume.geometry.radius;
    derivatives[5] += volume.geometry.cylinder_bottom;
    derivatives[6] += volume.geometry.apex;
    let patch = surface.patch * surface.grid.cell().powi(2);
    let hidden = (volume.area - volume.seen).max(0.0) * patch * surface.roughness.powi(2);
    let continued = (left.dot(&surface.trend.spread(&left)) - of_surface).max(0.0);
    let unseen = WIDER * WIDER * continued + hidden;
    let grid = grid_error(&surface.grid, volume, &under);
    let known = deviation(&derivatives, covariance).powi(2);
    let out = UncertaintyBudget {
        pose: share(&derivatives, covariance, POSE),
        geometry: share(&derivatives, covariance, GEOMETRY),
        depth: share(&derivatives, covariance, DEPTH),
        noise: noise.sqrt(),
        unseen: unseen.sqrt(),
        grid,
        total: (known + noise + unseen + grid * grid).sqrt(),
    };
    (out, derivatives)
}

/// Mean height error that the cells leave, metres.
const CELL_ERROR: f64 = 3e-5;
/// Error of the wedge of content under the cells at its rim on the cone, as a share of cell² · slope · length.
const RIM_ERROR: f64 = 0.005;

/// What the cells leave of the volume, as measured on exact frames.
fn grid_error(grid: &Grid, volume: &Volume, under: &Under<'_>) -> f64 {
    let rim = TAU * volume.reach * (1.0 - volume.wall_share);
    let [height, run] = under.rise();
    let wedge = grid.cell().powi(2) * height / run * rim;
    (CELL_ERROR * volume.area).hypot(RIM_ERROR * wedge)
}
