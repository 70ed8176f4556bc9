//! Is it the wall's relief that the pixels of a tile scatter by? Relief has a grain, noise has none.
//!
//! Corrugated sheet runs around the silo or up along it: on neighbouring pixels of one of these directions it is nearly
//! the same. Noise that grows with the incidence looks like relief by its size alone, but is another one in each pixel.

use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::Part;
use crate::surface_fit::polish::TileEquation;
use crate::surface_fit::solver::{Fit, Problem};
use crate::surface_fit::tiles::{Patch, Patches};
use crate::{SiloPose, Vec3};
use std::f64::consts::{FRAC_PI_4, SQRT_2};

/// About so many tiles are asked.
const SKETCH: usize = 400;
/// Fewest tiles that tell, and least share of those that were asked.
const FEWEST: usize = 40;
const LEAST_SHARE: f64 = 0.25;
/// Longest step along the wall between neighbouring pixels, metres: a third of a corrugated sheet's pitch. Further off,
/// relief is another one in each pixel, as noise is.
const FINEST: f64 = 0.025;
/// As much of the relief's variance as neighbours surely have in common.
const COMMON: f64 = 0.25;
/// Fewest pairs of pixels that tell a tile's own variance.
const FEWEST_PAIRS: f64 = 8.0;
/// A mean of so many standard errors is none by chance.
const SURE: f64 = 3.0;

/// The relief, metres, as far as neighbouring pixels have it in common; all of it where that can't be seen.
pub fn relief_with_grain(problem: &Problem, image: &DepthImage, fit: &Fit, tiles: &[TileEquation], relief: f64) -> f64 {
    if relief == 0.0 {
        return relief;
    }
    let placed = SurfaceEvaluator::new(fit.surface);
    let of_part = |part: Part| {
        let asked: Vec<&TileEquation> = tiles.iter().filter(|tile| tile.equation.part == part).collect();
        let sketch = asked.iter().step_by(asked.len().div_ceil(SKETCH).max(1));
        let least = FEWEST.max((LEAST_SHARE * sketch.len() as f64) as usize);
        let found: Vec<([f64; 2], f64)> = sketch.filter_map(|tile| in_common(problem, image, &placed, tile)).collect();
        if asked.len() < FEWEST {
            0.0
        } else if found.len() < least {
            relief
        } else {
            let means = [0, 1].map(|k| sure_mean(&found.iter().map(|(both, w)| (both[k], *w)).collect::<Vec<_>>()));
            (means[0].max(means[1]) / COMMON).sqrt()
        }
    };
    relief.min(of_part(Part::Cylinder).max(of_part(Part::Cone)))
}

/// What of a tile's variance across the wall neighbours have in common, around the silo and along the wall, m²; and its
/// weight.
fn in_common(
    problem: &Problem,
    image: &DepthImage,
    placed: &SurfaceEvaluator,
    tile: &TileEquation,
) -> Option<([f64; 2], f64)> {
    let patch = &problem.patches.list[tile.patch];
    let e = &tile.equation;
    if tile.count < patch.count {
        return None; // some pixels are something else
    }
    let [x, y] = e.across;
    let rho = x.hypot(y);
    let inwards = if e.part == Part::Cone { placed.surface.cone?.slope } else { 0.0 };
    let along = Vec3::new(-inwards * x / rho, -inwards * y / rho, 1.0).normalize();
    let ways =
        [Vec3::new(-y / rho, x / rho, 0.0), along].map(|way| in_pixels(problem, &placed.surface.pose, patch, way));
    if ways.iter().any(|[u, v]| u.hypot(*v) * FINEST < 1.0) {
        return None;
    }
    let [around, along] = ways.map(|way| own_variance(problem.patches, image, tile, nearest(way)));
    let across = e.cosine * e.cosine;
    let expected = tile.expected * across;
    let in_common = [around?, along?].map(|own| across * (tile.scatter * tile.scatter - own));
    Some((in_common, 1.0 / (expected * expected).max(1e-24)))
}

/// A direction along the wall in the image, pixels per metre.
fn in_pixels(problem: &Problem, pose: &SiloPose, patch: &Patch, way: Vec3) -> [f64; 2] {
    let camera = pose.rotation().transpose() * way;
    let scale = 1.0 / (problem.pixel * patch.measured);
    [(camera.x - patch.q.x * camera.z) * scale, (camera.y - patch.q.y * camera.z) * scale]
}

/// The neighbouring pixel that lies most nearly in a direction: columns to the right or left, and rows down.
fn nearest([u, v]: [f64; 2]) -> (isize, usize) {
    const STEPS: [(isize, usize); 4] = [(1, 0), (1, 1), (0, 1), (-1, 1)];
    let eighths = v.atan2(u) / FRAC_PI_4;
    STEPS[eighths.round().rem_euclid(4.0) as usize]
}

/// Variance that a tile's pixels do not share with their neighbours in a direction, m²: half that of their differences.
fn own_variance(
    patches: &Patches,
    image: &DepthImage,
    tile: &TileEquation,
    (right, down): (isize, usize),
) -> Option<f64> {
    const REACH: f64 = 4.0 * SQRT_2;
    let (side, [slope_u, slope_v]) = (patches.side, patches.rays[tile.patch].own_slopes);
    let (column, row) = patches.list[tile.patch].tile;
    let corner = row as usize * side * image.width + column as usize * side;
    let expected = slope_u * right as f64 + slope_v * down as f64;
    let (first, end) = if right < 0 { (1, side) } else { (0, side - right as usize) };
    let (mut n, mut squares) = (0.0, 0.0);
    for at in (0..side - down).flat_map(|v| (first..end).map(move |u| corner + v * image.width + u)) {
        let other = (at + down * image.width).wrapping_add_signed(right);
        let [here, there] = [at, other].map(|i| f64::from(image.depth[i]));
        let off = there - here - expected;
        if here > 0.0 && there > 0.0 && off.abs() < REACH * tile.scatter {
            n += 1.0;
            squares += off * off;
        }
    }
    (n > FEWEST_PAIRS).then(|| 0.5 * squares / n)
}

/// The weighted mean, or 0 where it may be none.
fn sure_mean(values: &[(f64, f64)]) -> f64 {
    let weights: f64 = values.iter().map(|(_, w)| w).sum();
    let mean = values.iter().map(|(v, w)| v * w).sum::<f64>() / weights;
    let error = values.iter().map(|(v, w)| ((v - mean) * w).powi(2)).sum::<f64>().sqrt() / weights;
    if mean > SURE * error { mean } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sensor::{DepthBias, NoiseLaw};
    use crate::geometry::surface::SiloSurface;
    use crate::surface_fit::polish::{ALL, pixel_equations};
    use crate::surface_fit::solver::Prior;
    use crate::surface_fit::tiles::tile_patches;

    const RELIEF: f64 = 4e-3;

    /// The relief that is left of `RELIEF` on a cylinder whose pixels are off by what `off` makes of the wall's point.
    fn left(off: impl Fn(usize, Vec3) -> f64) -> f64 {
        let (width, height, focal) = (320, 240, 400.0);
        let pose = SiloPose { r_x: 0.7, r_y: -0.1, t_x: 0.2, t_y: 0.1 };
        let surface = SiloSurface { pose, radius: Some(1.2), cone: None, ovality: [0.0; 2] };
        let placed = SurfaceEvaluator::new(surface);
        let ray = |i: usize| [((i % width) as f64 - 159.5) / focal, ((i / width) as f64 - 119.5) / focal];
        let rays: Vec<[f64; 2]> = (0..width * height).map(ray).collect();
        let measured = |(i, ray): (usize, &[f64; 2])| {
            let (q, d) = (Vec3::new(ray[0], ray[1], 1.0), placed.cylinder_depth(*ray));
            let at = placed.local(&(q * d));
            (d + off(i, at.p) / at.gradient.dot(&placed.turn(&q))) as f32
        };
        let depth: Vec<f32> = rays.iter().enumerate().map(measured).collect();
        let image = DepthImage::with_rays(&depth, &rays, width, height).expect("sizes agree");
        let noise = NoiseLaw::uniform(1e-3);
        let patches = tile_patches(&image, Some(&noise));
        let bias = DepthBias::default();
        let prior = Prior { bias, bias_std: [0.0; 3], radius: None, gravity: None, ovality_std: 0.0 };
        let problem = Problem { patches: &patches, noise, prior: &prior, pixel: 1.0 / focal };
        let fit = Fit { surface, bias, inside: true, misfit: 0.0, weights: Vec::new() };
        let tiles = pixel_equations(&problem, &image, &fit, &vec![true; patches.list.len()], &ALL);
        assert!(tiles.len() > 500, "{}", tiles.len());
        relief_with_grain(&problem, &image, &fit, &tiles, RELIEF)
    }

    fn chance(i: usize) -> f64 {
        2.0 * ((i as f64 * 12.9898).sin() * 43_758.545_3).fract().abs() - 1.0
    }

    fn wave(at: f64) -> f64 {
        6.5e-3 * (std::f64::consts::TAU * at / 0.076).sin()
    }

    #[test]
    fn noise_has_no_grain() {
        assert!(left(|i, _| 8e-3 * chance(i)) < 0.2 * RELIEF);
    }

    #[test]
    fn corrugated_sheet_has_one_whichever_way_it_runs() {
        let around = left(|i, p| wave(p.z) + 2e-3 * chance(i));
        let along = left(|i, p| wave(1.2 * p.y.atan2(p.x)) + 2e-3 * chance(i));
        assert_eq!([around, along], [RELIEF; 2]);
    }
}
