//! What the tiles' residuals need beside their noise.

use crate::geometry::surface::Part;
use crate::stats::robust::{MAD_TO_STD, upper_median};
use crate::surface_fit::equation::TileEquation;
use crate::surface_fit::solver::{Fit, tukey};

/// How true a tile's mean is at best, metres: its pixels are held against a quadratic. A smaller misfit would take the
/// rest for disagreement between tiles.
const RESOLUTION: f64 = 1e-5;

/// Misfit that the tiles' residuals need beside their noise, metres.
pub fn misfit_of(equations: &[TileEquation]) -> f64 {
    let mut excess: Vec<f64> = Vec::with_capacity(equations.len());
    let mut noise: Vec<f64> = Vec::with_capacity(equations.len());
    for tile in equations {
        excess.push((tile.equation.residual / tile.spread).abs());
        noise.push(tile.noise / (tile.spread * tile.spread));
    }
    let (Some(spread), Some(noise)) = (upper_median(&mut excess), upper_median(&mut noise)) else { return 0.0 };
    ((MAD_TO_STD * spread).powi(2) - 1.2 * noise).max(0.0).sqrt().max(RESOLUTION)
}

/// The misfit with which neither part of the wall is without weight: the step before may have gone too far for one that
/// little is seen of, and what has no weight would never be fitted again.
pub fn misfit_to_start_from(fit: &Fit, equations: &[TileEquation]) -> f64 {
    const LOST: f64 = 0.1;
    let needed = |part: Part| {
        let of_part = || equations.iter().filter(|t| t.equation.part == part).copied();
        let (count, weight) = of_part().fold((0.0, 0.0), |(count, weight), mut tile| {
            tile.allow(fit.misfit);
            (count + 1.0, weight + tukey(tile.equation.residual * tile.equation.residual / tile.equation.variance))
        });
        if weight < LOST * count { misfit_of(&of_part().collect::<Vec<_>>()) } else { 0.0 }
    };
    fit.misfit.max(needed(Part::Cylinder)).max(needed(Part::Cone))
}
