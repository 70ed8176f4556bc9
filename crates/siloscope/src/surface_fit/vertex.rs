//! What lies before a cone's vertex, and so whether the cone could be feed itself.

use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::Part;
use crate::surface_fit::solver::{Fit, Problem};
use crate::surface_fit::tiles::Patch;

/// Whether content lies well before the cone at its vertex and all around it: then the cone is no surface of feed itself.
///
/// A funnel of feed also has a rounded tip, which lies a little before its own cone. A fit that takes feed and wall for
/// one cone has the rest of the funnel before its vertex, which rises away from the axis. An auger may stand over a
/// funnel: that covers the tip, but to its sides more of the cone than elsewhere. And lumps of feed may cover the tip of
/// a funnel that was found in the rest of it: they leave no rim free.
pub fn is_covered(problem: &Problem, fit: &Fit) -> bool {
    const COVERED: f64 = 0.08;
    const SURELY: f64 = 0.01;
    const RISE: f64 = 0.1;
    const FREE: f64 = 0.3;
    let all = before_the_cone(problem, fit);
    let within = |from: f64, to: f64| all.iter().filter(move |b| b.rho >= from && b.rho < to);
    let tip = || within(0.0, 0.06);
    let disc = || within(0.0, 0.3);
    tip().count() >= 4
        && share_above(tip(), COVERED) >= 0.7
        && share_above(within(0.7, f64::INFINITY), SURELY) < FREE
        && is_even(disc(), SURELY)
        && rise(disc().filter(|b| b.by > COVERED)) < RISE
}

/// A patch before the cone. Lengths are shares of the silo's size.
#[derive(Debug, Clone, Copy)]
struct Before {
    azimuth: f64,
    /// How far it surely lies before the cone.
    by: f64,
    /// Distance from the axis at which its ray meets the cone.
    rho: f64,
    /// Its own height.
    height: f64,
}

fn before_the_cone(problem: &Problem, fit: &Fit) -> Vec<Before> {
    if problem.patches.cloud {
        return Vec::new();
    }
    let (placed, size) = (SurfaceEvaluator::new(fit.surface), fit.surface.size());
    let before = |patch: &Patch| {
        let (d, part) = placed.depth(&patch.q);
        let p = placed.to_silo(&(patch.q * d));
        let seen = fit.bias.true_depth(patch.measured);
        let sure = d - seen - 4.0 * problem.noise.sigma(d) / patch.count.sqrt();
        (part == Part::Cone).then(|| Before {
            azimuth: p.y.atan2(p.x),
            by: sure / size,
            rho: p.x.hypot(p.y) / size,
            height: -placed.down([patch.q.x, patch.q.y]) * seen / size,
        })
    };
    problem.patches.list.iter().filter_map(before).collect()
}

fn share_above<'a>(places: impl Iterator<Item = &'a Before>, bar: f64) -> f64 {
    let (count, above) = places.fold((0, 0), |(n, above), b| (n + 1, above + i32::from(b.by > bar)));
    f64::from(above) / f64::from(count.max(1))
}

/// Whether about as much lies before the cone in each quarter about the axis.
fn is_even<'a>(places: impl Iterator<Item = &'a Before> + Clone, bar: f64) -> bool {
    const SECTORS: usize = 4;
    const EVEN: f64 = 0.5;
    let shares: [f64; SECTORS] = std::array::from_fn(|sector| {
        let turn = |b: &Before| b.azimuth / std::f64::consts::TAU + 0.5;
        let in_sector = |b: &&Before| ((turn(b) * SECTORS as f64) as usize).min(SECTORS - 1) == sector;
        share_above(places.clone().filter(in_sector), bar)
    });
    let (least, most) = (shares.iter().copied().fold(1.0, f64::min), shares.iter().copied().fold(0.0, f64::max));
    least > EVEN * most
}

/// How steeply what is seen rises away from the axis: the slope of a line through the places.
fn rise<'a>(places: impl Iterator<Item = &'a Before>) -> f64 {
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for Before { rho, height, .. } in places {
        n += 1.0;
        x += rho;
        y += height;
        xx += rho * rho;
        xy += rho * height;
    }
    (n * xy - x * y) / (n * xx - x * x)
}
