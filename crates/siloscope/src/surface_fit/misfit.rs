//! What the tiles' residuals need beside their noise, and how that is spread over them.

use crate::geometry::surface::Part;
use crate::stats::robust::{MAD_TO_STD, median, upper_median};
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

/// Share of the sensor in a typical tile's squared misfit; the rest is the wall's, as dents are.
const SENSOR: f64 = 0.9;

/// Spreads the misfit over the tiles of a depth image: some across the wall, more along the ray and growing with the depth
/// squared, as a sensor's lasting warp does.
///
/// The residuals can't tell which it is: what is warped far away covers little of the image, and is evened out into the
/// fit if it may be. The misfit is a typical distance across the wall.
pub fn spread_misfit(tiles: &mut [TileEquation]) {
    let squared = |tile: &TileEquation| tile.equation.jacobian[8].powi(2); // of the wall's depth
    let Some(typical) = median(tiles.iter().map(|t| squared(t) * t.equation.cosine).collect()) else { return };
    for tile in tiles {
        let [wall, sensor] = [1.0 / tile.equation.cosine, squared(tile) / typical];
        tile.spread = ((1.0 - SENSOR) * wall * wall + SENSOR * sensor * sensor).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::parameters::Parameters;
    use crate::surface_fit::solver::Equation;

    /// Tiles from 1 to 4 units deep, seen at all angles.
    fn tiles(unit: f64) -> Vec<TileEquation> {
        let tile = |i: usize| {
            let share = |k: f64| (i as f64 * k).fract();
            let (d, cosine) = (unit * (1.0 + 3.0 * share(0.618_034)), 0.2 + 0.8 * share(0.754_878));
            let mut jacobian = Parameters::zeros();
            jacobian[8] = -d;
            let (residual, variance, part) = (0.0, 1e-8, Part::Cone);
            let equation = Equation { residual, jacobian, variance, cosine, part, z: -1.0, across: [1.0, 0.0] };
            TileEquation { patch: i, equation, noise: 1e-8, expected: 1e-6, scatter: 1e-3, count: 100.0, spread: 0.0 }
        };
        let mut tiles = (0..900).map(tile).collect::<Vec<_>>();
        spread_misfit(&mut tiles);
        tiles
    }

    #[test]
    fn a_misfit_is_a_typical_distance_across_the_wall_in_any_unit() {
        let across = |unit: f64| median(tiles(unit).iter().map(|t| t.spread * t.equation.cosine).collect());
        assert!(across(1.0).is_some_and(|typical| (0.9..1.2).contains(&typical)), "{:?}", across(1.0));
        assert!((across(1.0).unwrap_or(0.0) - across(7.0).unwrap_or(1.0)).abs() < 1e-12);
    }

    #[test]
    fn a_sensors_warp_is_spread_as_it_grows_and_found_again() {
        let mut tiles = tiles(1.0);
        let chance = |i: usize| (0..12).map(|k| (i as f64 * (1.3 + f64::from(k)).sqrt()).fract()).sum::<f64>() - 6.0;
        for (i, tile) in tiles.iter_mut().enumerate() {
            tile.equation.residual = 2e-3 * tile.equation.jacobian[8].powi(2) * chance(i);
        }
        let misfit = misfit_of(&tiles);
        for (far, grazing) in [(false, false), (false, true), (true, false), (true, true)] {
            let here = |t: &&TileEquation| (t.equation.jacobian[8] < -2.5, t.equation.cosine < 0.6) == (far, grazing);
            let squares: Vec<f64> =
                tiles.iter().filter(here).map(|t| (t.equation.residual / (misfit * t.spread)).powi(2)).collect();
            let size = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
            assert!((0.75..1.25).contains(&size), "{far} {grazing}: {size}"); // 0.5 to 3 where all is across the wall
        }
    }
}
