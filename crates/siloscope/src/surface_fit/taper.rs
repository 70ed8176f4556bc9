//! Cylinder or cone? A small piece of a cone looks like a cylinder about another axis.

use crate::geometry::surface::{Cone, SiloSurface};
use crate::surface_fit::likelihood::{likelihood, may_be_feed};
use crate::surface_fit::solver::{Fit, Problem};
use crate::surface_fit::tiles::Patch;
use crate::{SiloPose, Vec3};

/// A cone through the patches that were taken for a cylinder, if it explains more of the frame.
///
/// A small piece of a cone looks like a cylinder about another axis, and in a frame that shows little wall two patches of
/// it are drawn long before three.
pub fn cone_instead(problem: &Problem, cylinder: &Fit, wall: &[bool]) -> Option<Fit> {
    let shown: Vec<&Patch> = problem.patches.list.iter().zip(wall).filter(|(_, wall)| **wall).map(|(p, _)| p).collect();
    let alone = cylinder.surface.cone.is_none() && cylinder.inside && !problem.patches.cloud;
    if !alone || shown.is_empty() || shown.len() as f64 > PLENTY * wall.len() as f64 {
        return None;
    }
    let sum: Vec3 = shown.iter().map(|p| p.at(cylinder.bias.true_depth(p.measured))).sum();
    let middle = sum / shown.len() as f64;
    let gain = |fit: &Fit| likelihood(problem, fit, SKETCH);
    let worth_it = gain(cylinder);
    let sketched = SLOPES.into_iter().map(|slope| {
        let surface = cone_along(&cylinder.surface, &middle, slope);
        let mut cone = Fit { surface, misfit: 0.03 * cylinder.surface.size(), ..cylinder.clone() };
        problem.refine(&mut cone, 5, SKETCH, 0.25);
        cone
    });
    let refined = sketched.filter(|cone| gain(cone) > worth_it).map(|mut cone| {
        problem.refine(&mut cone, 5, 3, 0.25);
        problem.refine(&mut cone, 3, 3, 0.15);
        (likelihood(problem, &cone, 1), cone)
    });
    let best = refined.max_by(|a, b| a.0.total_cmp(&b.0));
    let (gain, cone) = best.filter(|(_, cone)| cone.surface.cone.is_some())?;
    (gain > CLEARLY * likelihood(problem, cylinder, 1) && !may_be_feed(problem, &cone)).then_some(cone)
}

/// How much more of the frame a cone must explain: it also takes an oval silo's side a little better.
const CLEARLY: f64 = 1.25;

/// One patch in so many tells whether a cone is worth to be refined on more.
const SKETCH: usize = 6;

/// Slopes of cones that are tried in place of a cylinder.
const SLOPES: [f64; 3] = [0.4, 0.8, 1.2];

/// The cone of a slope that touches a cylinder along its generatrix beside a point, and bends there as it does.
fn cone_along(cylinder: &SiloSurface, point: &Vec3, slope: f64) -> SiloSurface {
    let pose = &cylinder.pose;
    let p = pose.to_silo(point);
    let outwards = Vec3::new(p.x, p.y, 0.0).normalize();
    let (sine, cosine) = slope.atan().sin_cos();
    let back = pose.rotation().transpose();
    let axis = back * (outwards * sine + Vec3::z() * cosine); // the cone's axis runs towards its wall
    let through = back * Vec3::new(-pose.t_x, -pose.t_y, p.z);
    let pose = SiloPose::from_axis(&axis, &through);
    let apex = pose.to_silo(point).z + cylinder.size() * cosine / slope;
    SiloSurface { pose, radius: None, cone: Some(Cone { slope, apex }), ovality: [0.0; 2] }
}

/// A wall that takes more of the frame than this is what it looks like.
const PLENTY: f64 = 0.35;
