//! The paper's six steps from a depth frame to the silo's axis (section 2.3). Read this page first.

pub mod axis;
pub mod candidates;
pub mod covariance;
pub mod coverage;
pub mod diagnostics;
pub mod instrument;
pub mod profile;
pub mod tensors;

use crate::base::clock::Clock;
use crate::base::refusal::Refusal;
use crate::base::workers::Workers;
use crate::geometry::depth_image::{Depth, DepthImage};
use crate::geometry::normals::normals;
use crate::geometry::view::View;
use crate::shape_tensor::axis::{AxisPoint, Consensus, Wall, axis_point, axis_points, consistent_direction};
use crate::shape_tensor::candidates::{Candidate, select_candidates};
use crate::shape_tensor::covariance::Scatter;
use crate::shape_tensor::coverage::{Coverage, coverage};
use crate::shape_tensor::diagnostics::{Evidence, PlacedWall, placed_walls};
use crate::shape_tensor::instrument::{Placed, SensorErrors, step_to, without_each};
use crate::shape_tensor::profile::{Profile, fit_profile};
use crate::shape_tensor::tensors::{ShapeTensor, shape_tensors};
use crate::stats::blocks::blocks;
use crate::stats::neighbours::{Neighbours, nearest_neighbours};
use crate::stats::voxel_grid::{Cloud, voxel_grid};
use crate::{Result, SiloPose, Vec3};
use nalgebra::Matrix4;

/// Settings of the six steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Side of the voxels, metres (step 1).
    pub grid: f64,
    /// Neighbours k of normals and shape tensors (step 2).
    pub neighbours: usize,
    /// From which side the walls are seen (step 3); None to try the inside first and then the others.
    pub view: Option<View>,
    /// Share of the clearly curved points kept as candidates (step 3).
    pub share: f64,
    /// Robust standard deviations by which a candidate's E1 may be off (step 4); infinite to keep all.
    pub agreement: f64,
    /// Partners s of each candidate (step 5).
    pub partners: usize,
    /// Threads; the answer does not depend on them.
    pub threads: usize,
    /// What is known of the sensor's errors: they stay in the answer, and are in its covariance.
    pub errors: SensorErrors,
}

impl Settings {
    /// Side of the blocks whose errors are independent, metres.
    fn block(&self) -> f64 {
        BLOCK * self.grid * (self.neighbours as f64).sqrt()
    }
}

impl Default for Settings {
    fn default() -> Self {
        let errors = SensorErrors::default();
        Self { grid: 0.05, neighbours: 30, view: None, share: 0.7, agreement: 2.0, partners: 100, threads: 1, errors }
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
    pub coverage: Coverage,
    /// Why to believe it.
    pub evidence: Evidence,
    /// Milliseconds of the steps.
    pub timing: Vec<(&'static str, f64)>,
}

/// The axis, or why there is none.
pub type Outcome = std::result::Result<Located, Refusal>;

/// Finds the axis in a depth image.
pub fn locate_in_image<T: Depth>(image: &DepthImage<T>, settings: &Settings) -> Result<Outcome> {
    let (workers, mut clock) = (Workers::new(settings.threads), Clock::start());
    let cloud = voxel_grid(image, settings.grid, &workers)?; // step 1, Eqs. 1 and 2
    clock.lap("points");
    locate_in_grid(cloud, &[View::Inside, View::Outside], settings, &workers, clock)
}

/// Finds the axis in a cloud of points in the camera frame.
pub fn locate_in_points(points: &[Vec3], settings: &Settings) -> Result<Outcome> {
    let (workers, mut clock) = (Workers::new(settings.threads), Clock::start());
    let cloud = voxel_grid(points, settings.grid, &workers)?; // step 1
    clock.lap("points");
    locate_in_grid(cloud, &[View::Inside, View::Either, View::Outside], settings, &workers, clock)
}

/// What steps 1 and 2 make of a frame.
struct Surface<'a> {
    cloud: Cloud,
    near: &'a Neighbours,
    normals: Vec<Vec3>,
    tensors: Vec<ShapeTensor>,
}

fn locate_in_grid(
    cloud: Cloud,
    views: &[View],
    settings: &Settings,
    workers: &Workers,
    mut clock: Clock,
) -> Result<Outcome> {
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
    let surface = Surface { near: &near, normals, tensors, cloud };
    let chosen = settings.view.map(|view| [view]);
    let views = chosen.as_ref().map_or(views, |view| view);
    let mut outcomes = views.iter().map(|view| located_from(*view, &surface, settings, workers, &mut clock));
    // Where no view gives an axis, the first one's reason is the one to tell.
    let first = outcomes.next().unwrap_or(Err(Refusal::NoWall));
    let outcome = first.or_else(|refusal| outcomes.find_map(Outcome::ok).ok_or(refusal));
    drop(outcomes);
    Ok(outcome.map(|located| Located { timing: clock.laps(), ..located }))
}

/// The axis, and how sure it is.
fn located_from(view: View, surface: &Surface, settings: &Settings, workers: &Workers, clock: &mut Clock) -> Outcome {
    let found = axis_of(view, surface, settings, workers, clock);
    let located = assess(surface, &found?, settings, workers);
    clock.lap("evidence");
    let located = with_sensor_errors(located?, (surface, view), settings, workers);
    clock.lap("sensor");
    located
}

/// The answer with the share of the sensor's and the camera's errors in its covariances.
fn with_sensor_errors(
    located: Located,
    (surface, view): (&Surface, View),
    settings: &Settings,
    workers: &Workers,
) -> Outcome {
    let again = |points: Vec<Vec3>| {
        let normals = normals(&points, surface.near, workers);
        let tensors = shape_tensors(&points, surface.near, &normals, workers);
        let mut cloud = surface.cloud.clone();
        cloud.points = points;
        let surface = Surface { cloud, near: surface.near, normals, tensors };
        let pose = axis_of(view, &surface, settings, workers, &mut Clock::start())?.pose;
        Ok(Placed { points: surface.cloud.points, normals: surface.normals, pose })
    };
    let found = Placed { points: surface.cloud.points.clone(), normals: surface.normals.clone(), pose: located.pose };
    let mut sum = located.clone();
    for other in without_each(&settings.errors, &found, again)? {
        let step = step_to(&located.pose, &other.pose);
        sum.covariance += step * step.transpose();
        let profile = fit_profile(&other.points, &other.normals, &other.pose, settings.block());
        sum.profile.add_step(&located.profile, &profile);
    }
    Ok(sum)
}

/// Steps 3 to 6.
fn axis_of(
    view: View,
    surface: &Surface,
    settings: &Settings,
    workers: &Workers,
    clock: &mut Clock,
) -> std::result::Result<Found, Refusal> {
    let Surface { cloud, near, normals, tensors } = surface;
    let points = &cloud.points;
    let candidates = select_candidates(points, near, tensors, settings.share, view, workers); // step 3
    clock.lap("candidates");
    let consensus = consistent_direction(&candidates, settings.agreement); // step 4, Eq. 3
    clock.lap("direction");
    let wall = |c: &Candidate| Wall { p: points[c.index], normal: normals[c.index] };
    let walls: Vec<Wall> = consensus.kept.iter().map(wall).collect();
    let x = consensus.direction.x;
    let estimates = axis_points(&walls, &x, settings.partners, workers); // step 5, Eq. 4
    let a = axis_point(&estimates, workers).ok_or(Refusal::NoWall)?;
    clock.lap("point");
    let pose = SiloPose { t_x: -a.x, t_y: -a.y, ..SiloPose::from_axis(&x, &Vec3::zeros()) }; // step 6, Eqs. 6, 7
    Ok(Found { pose, view, candidates, consensus, estimates })
}

/// What the six steps found.
struct Found {
    pose: SiloPose,
    view: View,
    candidates: Vec<Candidate>,
    consensus: Consensus,
    estimates: Vec<AxisPoint>,
}

/// What the paper leaves out: how sure the answer is, whether to give it, and what the frame shows.
fn assess(surface: &Surface, found: &Found, settings: &Settings, workers: &Workers) -> Outcome {
    let walls = placed_walls(&found.consensus.kept, &surface.cloud.points, &surface.normals, &found.pose);
    let side = settings.block();
    let (seen, covariance) =
        workers.join(|| shown(surface, &found.pose, side, settings.grid), || covariance(found, &walls, side));
    let (profile, coverage) = seen?;
    let counts = [surface.cloud.points.len(), found.candidates.len()];
    let evidence = Evidence::of(&walls, counts, found.consensus.direction.spread, coverage.share_behind());
    evidence.judge(found.view)?;
    profile.judge(&found.pose, found.view)?;
    Ok(Located { pose: found.pose, covariance: covariance?, profile, coverage, evidence, timing: Vec::new() })
}

/// The silo's profile about the axis, and what the frame shows of it.
fn shown(
    surface: &Surface,
    pose: &SiloPose,
    side: f64,
    grid: f64,
) -> std::result::Result<(Profile, Coverage), Refusal> {
    let see = |profile: &Profile| {
        let tolerance = 4.0 * profile.misfit + 0.25 * grid;
        coverage(&surface.cloud, &surface.normals, pose, profile, tolerance)
    };
    let profile = fit_profile(&surface.cloud.points, &surface.normals, pose, side);
    let coverage = see(&profile);
    if !profile.cone_may_be_feed() || coverage.is_apex_covered() {
        return Ok((profile, coverage));
    }
    let cylinder = Profile { cone: None, ..profile };
    if cylinder.radius.is_some() { Ok((cylinder, see(&cylinder))) } else { Err(Refusal::ConeMayBeFeed) }
}

/// Covariance of the pose by the scatter among the walls' blocks.
fn covariance(found: &Found, walls: &[PlacedWall], side: f64) -> std::result::Result<Matrix4<f64>, Refusal> {
    let (block, blocks) = blocks(walls.iter().map(|w| w.p), side);
    let turn = found.pose.rotation();
    let scatter = Scatter {
        pose: &found.pose,
        e1: &walls.iter().map(|w| w.e1).collect::<Vec<_>>(),
        estimates: &found.estimates,
        block: &block,
        blocks,
        height: walls.iter().map(|w| w.p.z).sum::<f64>() / walls.len() as f64,
        candidates: &found.candidates.iter().map(|c| turn * c.e1).collect::<Vec<_>>(),
        limit: found.consensus.limit,
    };
    scatter.covariance()
}

/// Side of the blocks whose errors are independent, in units of grid·√k: a neighbourhood's diameter.
const BLOCK: f64 = 1.15;
