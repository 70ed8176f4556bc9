//! The paper's six steps from a depth frame to the silo's axis (section 2.3). Read this page first.

use crate::axis::{AxisPoint, Direction, Wall, axis_point, axis_points, consistent_direction};
use crate::axis_covariance::Scatter;
use crate::backproject::DepthImage;
use crate::blocks::blocks;
use crate::candidates::{View, select_candidates};
use crate::evidence::{Evidence, PlacedWall, placed_walls};
use crate::grid::{Cloud, voxel_grid, voxel_grid_of_image};
use crate::neighbours::nearest_neighbours;
use crate::normals::normals;
use crate::profile::{Place, Profile, fit_profile};
use crate::refusal::Refusal;
use crate::shape_tensor::shape_tensors;
use crate::shares::{Shares, shares};
use crate::workers::Workers;
use crate::{Result, SiloPose, Vec3};
use nalgebra::Matrix4;
use std::time::Instant;

/// Settings of the six steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Side of the voxels, metres (step 1).
    pub grid: f64,
    /// Neighbours k of normals and shape tensors (step 2).
    pub neighbours: usize,
    /// From which side the walls are seen; None to tell it from the frame (step 3).
    pub view: Option<View>,
    /// Share of the clearly curved points kept as candidates (step 3).
    pub share: f64,
    /// Robust standard deviations by which a candidate's E1 may be off (step 4); infinite to keep all.
    pub agreement: f64,
    /// Partners s of each candidate (step 5).
    pub partners: usize,
    /// Threads; the answer does not depend on them.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { grid: 0.05, neighbours: 30, view: None, share: 0.5, agreement: 2.0, partners: 50, threads: 1 }
    }
}

/// The silo's axis in one frame, with the evidence for it.
#[derive(Debug, Clone)]
pub struct Located {
    /// Pose of the camera in the silo.
    pub pose: SiloPose,
    /// Covariance of r_x, r_y, t_x and t_y.
    pub covariance: Matrix4<f64>,
    /// Radius and cone, as far as they are seen.
    pub profile: Profile,
    /// What is seen, by pixels and by area.
    pub shares: Shares,
    /// Why to believe it.
    pub evidence: Evidence,
    /// Milliseconds of the steps.
    pub timing: Vec<(&'static str, f64)>,
}

/// The axis, or why there is none.
pub type Outcome = std::result::Result<Located, Refusal>;

/// Finds the axis in a depth image.
pub fn locate_in_image(image: &DepthImage, settings: &Settings) -> Result<Outcome> {
    let (workers, mut clock) = (Workers::new(settings.threads), Clock::start());
    let cloud = voxel_grid_of_image(image, settings.grid, &workers)?; // step 1, Eqs. 1 and 2
    clock.lap("points");
    locate_in_grid(&cloud, settings, &workers, clock)
}

/// Finds the axis in a cloud of points in the camera frame.
pub fn locate_in_points(points: &[Vec3], settings: &Settings) -> Result<Outcome> {
    let (workers, mut clock) = (Workers::new(settings.threads), Clock::start());
    let cloud = voxel_grid(points, settings.grid, &workers)?; // step 1
    clock.lap("points");
    locate_in_grid(&cloud, settings, &workers, clock)
}

fn locate_in_grid(cloud: &Cloud, settings: &Settings, workers: &Workers, mut clock: Clock) -> Result<Outcome> {
    let points = &cloud.points;
    if points.len() <= settings.neighbours {
        return Ok(Err(Refusal::NoDepth));
    }
    let near = nearest_neighbours(points, settings.neighbours, workers)?;
    clock.lap("neighbours");
    let normals = normals(points, &near, workers); // step 2, Hoppe
    clock.lap("normals");
    let tensors = shape_tensors(points, &near, &normals, workers); // step 2, Goldfeather and Interrante
    clock.lap("shape tensors");
    let view = settings.view.unwrap_or_else(|| View::of(points, &tensors));
    let candidates = select_candidates(points, &tensors, settings.share, view); // step 3
    clock.lap("candidates");
    let (direction, kept) = consistent_direction(&candidates, settings.agreement); // step 4, Eq. 3
    clock.lap("direction");
    let walls: Vec<Wall> = kept.iter().map(|c| Wall { p: points[c.index], normal: normals[c.index] }).collect();
    let estimates = axis_points(&walls, &direction.x, settings.partners, workers); // step 5, Eq. 4
    let Some(a) = axis_point(&estimates) else { return Ok(Err(Refusal::NoWall)) };
    clock.lap("point");
    let pose = SiloPose { t_x: -a.x, t_y: -a.y, ..SiloPose::from_axis(&direction.x, &Vec3::zeros()) }; // step 6, Eqs. 6, 7
    let walls = placed_walls(&kept, points, &normals, &pose);
    let count = (points.len(), candidates.len());
    let outcome = assess(cloud, &normals, &walls, &Found { pose, direction, estimates, count }, settings);
    clock.lap("evidence");
    Ok(outcome.map(|located| Located { timing: clock.laps, ..located }))
}

/// What the six steps found.
struct Found {
    pose: SiloPose,
    direction: Direction,
    estimates: Vec<AxisPoint>,
    count: (usize, usize),
}

/// What the paper leaves out: how sure the answer is, whether to give it, and what the frame shows.
fn assess(cloud: &Cloud, normals: &[Vec3], walls: &[PlacedWall], found: &Found, settings: &Settings) -> Outcome {
    let (block, blocks) =
        blocks(walls.iter().map(|w| w.p), BLOCK * settings.grid * (settings.neighbours as f64).sqrt());
    let place = |(w, block): (&PlacedWall, &usize)| Place { rho: w.rho(), z: w.p.z, angle: w.angle(), block: *block };
    let places: Vec<Place> = walls.iter().zip(&block).map(place).collect();
    let profile = fit_profile(&places, blocks);
    let shares = shares(cloud, normals, &found.pose, &profile, 3.0 * profile.misfit + 0.5 * settings.grid);
    let evidence = Evidence::of(walls, found.direction.spread, found.count.1, found.count.0, shares.behind());
    evidence.judge()?;
    let scatter = Scatter {
        pose: &found.pose,
        e1: &walls.iter().map(|w| w.e1).collect::<Vec<_>>(),
        estimates: &found.estimates,
        block: &block,
        blocks,
        height: walls.iter().map(|w| w.p.z).sum::<f64>() / walls.len() as f64,
        agreement: settings.agreement,
    };
    let covariance = scatter.covariance();
    Ok(Located { pose: found.pose, covariance, profile, shares, evidence, timing: Vec::new() })
}

/// Side of the blocks whose errors are independent, in units of grid·√k: four times a neighbourhood's radius.
const BLOCK: f64 = 2.3;

/// Milliseconds between the steps.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Clock {
    fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    fn lap(&mut self, step: &'static str) {
        self.laps.push((step, self.last.elapsed().as_secs_f64() * 1e3));
        self.last = Instant::now();
    }
}
