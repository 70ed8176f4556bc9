//! A wall that an image shows from outside: measured as a cloud's is, by its pixels' points in tiles of its surface.

use crate::Vec3;
use crate::base::refusal::Refusal;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::scale_share;
use crate::geometry::sensor::DepthBias;
use crate::stats::robust::upper_median;
use crate::surface_fit::cloud::tiled;
use crate::surface_fit::cloud_equations::CloudWall;
use crate::surface_fit::model_selection::Settled;
use crate::surface_fit::outcome::{Knowledge, Outcome};
use crate::surface_fit::solver::{Fit, Problem};
use std::borrow::Cow;

/// Measures a wall that tiles have shown from outside.
pub fn fit_outside(problem: &Problem, image: &DepthImage, know: &Knowledge, mut found: Settled) -> Outcome {
    let scale_is_free = know.radius.is_some() && problem.prior.bias_std[1] > 0.0;
    if let (Some((radius, _)), true) = (know.radius, scale_is_free) {
        found.fit.rescale_to(radius);
    }
    let grid = tile_size(problem, &found).ok_or(Refusal::NoWall)?;
    let wall = found.wall.clone();
    let (pixels, on_wall) = pixels(problem, image, &wall);
    let place = |bias: &DepthBias| pixels.iter().map(|(ray, measured)| ray * bias.true_depth(*measured)).collect();
    let seen = |bias: &DepthBias| CloudWall { points: Cow::Owned(place(bias)), on_wall: &on_wall, grid, by_rays: true };
    let mut result = tiled(seen, (problem.noise, problem.prior), found)?;
    result.residuals = residuals(problem, &result.fit, &wall);
    if !scale_is_free {
        result.factor.scale_std = know.error.bias_std[1];
        let parameters = result.fit.surface.parameters(&result.fit.bias);
        result.covariance += scale_share(&parameters, know.error.bias_std[1]);
    }
    Ok(result)
}

/// Rays and depths of the pixels, and for each whether its tile is wall.
fn pixels(problem: &Problem, image: &DepthImage, wall: &[bool]) -> (Vec<(Vec3, f64)>, Vec<bool>) {
    let patches = problem.patches;
    let (mut pixels, mut on_wall) = (Vec::new(), Vec::new());
    for (patch, wall) in patches.list.iter().zip(wall) {
        let corner = [patch.tile.0 as usize * patches.side, patch.tile.1 as usize * patches.side];
        for pixel in 0..patches.side * patches.side {
            let (u, v) = (corner[0] + pixel % patches.side, corner[1] + pixel / patches.side);
            let i = v * image.width + u;
            let measured = image.depth.get(i).map_or(0.0, |depth| f64::from(*depth));
            if measured > 0.0 && measured.is_finite() {
                let [x, y] = image.ray(i);
                pixels.push((Vec3::new(x, y, 1.0), measured));
                on_wall.push(*wall);
            }
        }
    }
    (pixels, on_wall)
}

/// Side of the wall's tiles in the middle of what is seen of it, metres.
fn tile_size(problem: &Problem, found: &Settled) -> Option<f64> {
    let wall = problem.patches.list.iter().zip(&found.wall).filter(|(_, wall)| **wall);
    let middle = upper_median(&mut wall.map(|(patch, _)| patch.measured).collect::<Vec<_>>())?;
    Some(middle * problem.pixel * problem.patches.side as f64)
}

/// Distance of each of the image's wall tiles from the wall, metres; NaN elsewhere.
fn residuals(problem: &Problem, fit: &Fit, wall: &[bool]) -> Vec<f64> {
    let placed = SurfaceEvaluator::new(fit.surface);
    let off = |i: usize| problem.contact(fit, &placed, i).map_or(f64::NAN, |c| c.residual * c.cosine);
    wall.iter().enumerate().map(|(i, wall)| if *wall { off(i) } else { f64::NAN }).collect()
}
