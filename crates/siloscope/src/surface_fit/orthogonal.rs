//! Orthogonal least squares of a wall to points, all of equal weight: the core of every fit here, without what makes it
//! robust.

use crate::Vec3;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::CONE_SLOPE;
use crate::geometry::pose::SiloPose;
use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::{Cone, Part, SiloSurface};
use crate::surface_fit::normal_equations::System;
use crate::surface_fit::solver::Fit;

/// Most steps; each leaves a share of the error that is as small as the points are near the wall.
const STEPS: usize = 60;
/// The last step's size, of the parameters in units of the points' spread.
const LAST: f64 = 1e-14;

/// The wall of a surface's parts for which the sum of the points' squared distances is least, from that surface on.
///
/// `None` where the points do not fix it. Points far from the origin are moved to it: the camera's place on the axis and
/// the directions of the axis would else be known only together.
pub fn orthogonal_fit(points: &[Vec3], start: SiloSurface) -> Option<SiloSurface> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
    let centred: Vec<Vec3> = points.iter().map(|point| point - middle).collect();
    let spread = (centred.iter().map(Vec3::norm_squared).sum::<f64>() / points.len().max(1) as f64).sqrt();
    let (surface, bias) = (seen_from(start, &middle), DepthBias::default());
    let mut fit = Fit { surface, bias, inside: true, misfit: 0.0, weights: Vec::new() };
    for _ in 0..STEPS {
        let step = equations(&centred, &fit.surface).solve(&fit)?;
        fit.surface = fit.surface.stepped(&step);
        let scaled = step.iter().enumerate().map(|(k, s)| if (2..5).contains(&k) || k == 6 { s / spread } else { *s });
        if scaled.fold(0.0, |most: f64, s| most.max(s.abs())) < LAST {
            break;
        }
    }
    Some(seen_from(fit.surface, &-middle))
}

/// Normal equations of the points' distances from a surface.
fn equations(points: &[Vec3], surface: &SiloSurface) -> System {
    let placed = SurfaceEvaluator::new(*surface);
    let mut system = System::empty();
    for point in points {
        let at = placed.local(point);
        let stretch = at.gradient.norm();
        let distance = at.value / stretch;
        let mut jacobian = placed.derivative(point, &at) / stretch;
        if let (Part::Cone, Some(cone)) = (at.part, surface.cone) {
            jacobian[CONE_SLOPE] -= distance * cone.slope / (stretch * stretch);
        }
        system.add_row(&jacobian, distance, 1.0);
    }
    system
}

/// A surface in the frame of a camera that was moved, its axes as they were.
fn seen_from(surface: SiloSurface, place: &Vec3) -> SiloSurface {
    let SiloPose { r_x, r_y, t_x, t_y } = surface.pose;
    let moved = surface.pose.rotation() * place;
    let pose = SiloPose { r_x, r_y, t_x: t_x + moved.x, t_y: t_y + moved.y };
    let cone = surface.cone.map(|cone| Cone { apex: cone.apex - moved.z, ..cone });
    SiloSurface { pose, cone, ..surface }
}
