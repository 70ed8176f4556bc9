//! The surface fit: a depth frame in, the silo's wall as cylinder and cone out, with its covariance.

pub mod cloud;
pub mod cloud_equations;
pub mod cloud_tiles;
pub mod common;
pub mod covariance;
pub mod diagnostics;
pub mod equation;
pub mod factor;
pub mod frame_factor;
pub mod joint;
pub mod likelihood;
mod misfit;
pub mod model_selection;
pub mod normal_equations;
pub mod orthogonal;
pub mod outcome;
pub mod outermost;
pub mod outside;
pub mod points;
pub mod profile_parts;
pub mod proposals;
pub mod residual;
pub mod segmentation;
pub mod solver;
pub mod state;
pub mod taper;
pub mod tile_plane;
pub mod tile_rays;
pub mod tiles;
pub mod vertex;
pub mod warm_start;

use crate::Vec3;
use crate::base::clock::Clock;
use crate::base::refusal::Refusal;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::sensor::NoiseLaw;
use crate::surface_fit::joint::{Start, fit_inside};
use crate::surface_fit::model_selection::coarse_fit;
pub use crate::surface_fit::outcome::{Knowledge, Outcome, SurfaceFit};
use crate::surface_fit::outside::fit_outside;
use crate::surface_fit::solver::Problem;
use crate::surface_fit::tiles::{Patch, Patches, noise_from_scatter, tile_patches};
use crate::surface_fit::warm_start::KnownWall;

/// Fits the wall to a depth image; where another frame of the camera has shown a wall, it is looked for there first.
pub fn fit_image(image: &DepthImage, know: &Knowledge, known: Option<&KnownWall>) -> Outcome {
    let mut clock = Clock::start();
    let mut patches = tile_patches(image, know.error.noise.as_ref());
    if patches.list.len() < 30 {
        return Err(Refusal::NoDepth);
    }
    patches.unbias_normals(&know.error.bias);
    clock.lap("patches");
    let (noise, prior, pixel) = (noise(&patches, know), know.prior(), image.pixel_size());
    let confirmed = known.filter(|wall| wall.inside).and_then(|wall| {
        if prior.bias_std[2] > 0.0 {
            patches.unbias_normals(&wall.bias);
        }
        let problem = Problem { patches: &patches, noise, prior: &prior, pixel };
        let found = fit_inside(&problem, image, know, Start::Known(wall), &mut clock);
        found.ok().filter(|fit| wall.is_same(&fit.wall.surface))
    });
    let mut result = match confirmed {
        Some(fit) => fit,
        None => {
            patches.unbias_normals(&know.error.bias);
            let (found, proposals) = coarse_fit(&mut patches, noise, &prior, pixel);
            clock.lap("coarse fit");
            let problem = Problem { patches: &patches, noise, prior: &prior, pixel };
            match found {
                Ok(found) if !found.fit.inside => fit_outside(&problem, image, know, found)?,
                Ok(found) => fit_inside(&problem, image, know, Start::Searched(Some(&found), &proposals), &mut clock)?,
                Err(why) => fit_inside(&problem, image, know, Start::Searched(None, &proposals), &mut clock)
                    .map_err(|own| if own == Refusal::NoWall { why } else { own })?,
            }
        }
    };
    result.timing = clock.laps();
    result.patches = patches;
    Ok(result)
}

impl SurfaceFit {
    /// Centres of the patches in the silo frame, freed from the depth bias: what the r–z profile shows.
    pub fn patch_points(&self) -> Vec<Vec3> {
        let placed = SurfaceEvaluator::new(self.fit.surface);
        let to_silo = |p: &Patch| {
            let d = if self.patches.cloud { 0.0 } else { self.fit.bias.true_depth(p.measured) };
            placed.to_silo(&p.at(d))
        };
        self.patches.list.iter().map(to_silo).collect()
    }

    /// Whether most of the wall's normals, turned towards the origin, point to the axis.
    fn is_seen_from_inside(&self) -> bool {
        let placed = SurfaceEvaluator::new(self.fit.surface);
        let wall = self.residuals.iter().zip(&self.patches.list).filter(|(r, _)| r.is_finite());
        let inwards = |p: &Patch| placed.turn(&p.normal).dot(&placed.local(&p.origin).gradient) < 0.0;
        let votes: i64 = wall.map(|(_, p)| if inwards(p) { 1 } else { -1 }).sum();
        votes > 0
    }
}

fn noise(patches: &Patches, know: &Knowledge) -> NoiseLaw {
    know.error.noise.unwrap_or_else(|| {
        let smooth = patches.list.iter().filter(|p| p.smooth);
        noise_from_scatter(&mut smooth.map(|p| (p.measured, p.scatter)).collect::<Vec<_>>(), 1e-4)
    })
}
