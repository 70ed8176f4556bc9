//! Is it a silo's wall at all? What must hold on any cylinder or cone, measured on the patches that the fit calls wall.
//!
//! On a wall of revolution the normals turn about the axis exactly as the positions do (k1 is the circle's), and they
//! don't turn along the generatrix (k2 = 0, Property 1). A flat wall or a room's corner fails the first, the inside of
//! a sphere the second.

use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::Part;
use crate::surface_fit::solver::Fit;
use crate::surface_fit::tiles::{NONE, Patches};

/// What was measured on the wall's patches.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WallEvidence {
    /// Number of wall patches.
    pub patches: usize,
    /// Their share of all patches with depth.
    pub share: f64,
    /// Turn of the normal per turn of the position about the axis: 1 on a wall of revolution, 0 on a plane.
    pub turn: f64,
    /// Standard error of `turn`.
    pub turn_std: f64,
    /// `turn` and its standard error on the cylinder alone; NaN and infinite where hardly any of it is seen.
    pub turn_of_cylinder: [f64; 2],
    /// Turn of the normal along the generatrix, in units of 1/R: 0 on cylinder and cone, 1 on a sphere.
    pub bend: f64,
    /// Standard error of `bend`.
    pub bend_std: f64,
    /// Angle about the axis that the wall patches cover, radians.
    pub arc: f64,
    /// Fraction of all patches that lie behind the cylinder, where nothing can be.
    pub behind: f64,
    /// Fraction of all patches that lie behind the cone: it is no closed bottom.
    pub behind_cone: f64,
}

/// Sums of a regression through the origin with noise-weighted pairs.
#[derive(Default)]
struct Slope {
    xx: f64,
    xy: f64,
    yy: f64,
    n: f64,
}

impl Slope {
    fn add(&mut self, x: f64, y: f64, weight: f64) {
        self.xx += weight * x * x;
        self.xy += weight * x * y;
        self.yy += weight * y * y;
        self.n += 1.0;
    }

    /// Slope and its standard error.
    fn fit(&self) -> (f64, f64) {
        if self.xx <= 0.0 || self.n < 3.0 {
            return (f64::NAN, f64::INFINITY);
        }
        let slope = self.xy / self.xx;
        let residual = (self.yy - slope * self.xy).max(0.0) / (self.n - 1.0);
        (slope, (residual / self.xx).sqrt())
    }
}

/// One wall patch about the axis.
#[derive(Clone, Copy)]
struct Seat {
    azimuth: f64,
    along: f64,
    rho: f64,
    normal_azimuth: f64,
    normal_polar: f64,
    /// Length of the normal across the axis.
    normal_radial: f64,
    part: Part,
    sigma: f64,
}

/// Steps between the patches of a pair: far enough for the normals to be independent.
const REACH: usize = 4;

/// Measures the evidence on the patches with weight in `fit`.
pub fn wall_evidence(patches: &Patches, fit: &Fit, placed: &SurfaceEvaluator, wall: &[bool]) -> WallEvidence {
    let seats: Vec<Option<Seat>> = (0..patches.list.len()).map(|i| seat(patches, fit, placed, wall, i)).collect();
    let (mut turn, mut of_cylinder, mut bend) = (Slope::default(), Slope::default(), Slope::default());
    for (i, seat) in seats.iter().enumerate() {
        let Some(from) = seat else { continue };
        for direction in [2, 4, 6, 7] {
            let Some(to) = walk(patches, &seats, i, direction) else { continue };
            if from.part != to.part {
                continue;
            }
            let weight = 1.0 / (from.sigma * from.sigma + to.sigma * to.sigma + 1e-6);
            let around = wrapped(to.azimuth - from.azimuth);
            let turned = wrapped(to.normal_azimuth - from.normal_azimuth);
            turn.add(around * from.normal_radial, turned * from.normal_radial, weight);
            if from.part == Part::Cylinder {
                of_cylinder.add(around, turned, weight);
            }
            let along = (to.along - from.along) / (0.5 * (from.rho + to.rho));
            if along.abs() > 0.5 * around.abs() {
                bend.add(along, to.normal_polar - from.normal_polar, weight);
            }
        }
    }
    let ((turn, turn_std), (bend, bend_std)) = (turn.fit(), bend.fit());
    let n = seats.iter().flatten().count();
    let [behind, behind_cone] = behind(patches, fit, placed, wall);
    WallEvidence {
        patches: n,
        share: n as f64 / patches.list.len().max(1) as f64,
        turn,
        turn_std,
        turn_of_cylinder: of_cylinder.fit().into(),
        bend,
        bend_std,
        arc: arc(seats.iter().flatten().map(|s| s.azimuth)),
        behind,
        behind_cone,
    }
}

/// The difference of two azimuths within ±π, without a turn too many.
fn wrapped(difference: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    match difference {
        d if d > PI => d - TAU,
        d if d < -PI => d + TAU,
        d => d,
    }
}

fn seat(patches: &Patches, fit: &Fit, placed: &SurfaceEvaluator, wall: &[bool], i: usize) -> Option<Seat> {
    if !wall[i] {
        return None;
    }
    let patch = &patches.list[i];
    let p = patch.at(if patches.cloud { 0.0 } else { fit.bias.true_depth(patch.measured) });
    let at = placed.local(&p);
    let n = placed.turn(&patch.normal);
    let n = if n.dot(&at.gradient) < 0.0 { -n } else { n };
    let rho = at.p.xy().norm();
    let stretch = at.gradient.norm();
    Some(Seat {
        azimuth: at.p.y.atan2(at.p.x),
        along: at.p.z * stretch,
        rho,
        normal_azimuth: n.y.atan2(n.x),
        normal_polar: n.z.clamp(-1.0, 1.0).asin(),
        normal_radial: n.xy().norm(),
        part: at.part,
        sigma: patch.sigma_normal,
    })
}

/// The wall patch `REACH` steps from `i` in one of the eight directions, all wall in between.
fn walk<'a>(patches: &Patches, seats: &'a [Option<Seat>], i: usize, direction: usize) -> Option<&'a Seat> {
    let steps = if patches.cloud { 1 } else { REACH };
    let mut at = i;
    for _ in 0..steps {
        let next = patches.neighbours[at][direction];
        if next == NONE {
            return None;
        }
        at = next as usize;
        seats[at].as_ref()?;
    }
    seats[at].as_ref()
}

/// Angle covered by azimuths, in bins of 5°.
fn arc(azimuths: impl Iterator<Item = f64>) -> f64 {
    let mut bins = [0u32; 72];
    for azimuth in azimuths {
        let bin = ((azimuth / std::f64::consts::TAU + 0.5) * 72.0) as usize;
        bins[bin.min(71)] += 1;
    }
    bins.iter().filter(|&&n| n > 0).count() as f64 * std::f64::consts::TAU / 72.0
}

/// Fractions of the patches that lie clearly behind the cylinder and behind the cone as seen from the camera.
fn behind(patches: &Patches, fit: &Fit, placed: &SurfaceEvaluator, wall: &[bool]) -> [f64; 2] {
    let list = &patches.list;
    let reach = |p: f64| 0.05 * p;
    let mut count = [0.0; 2];
    if !fit.inside || patches.cloud {
        return count;
    }
    for patch in list.iter().zip(wall).filter(|(_, wall)| !**wall).map(|(patch, _)| patch) {
        let at = placed.local(&patch.at(fit.bias.true_depth(patch.measured)));
        if at.value / at.gradient.norm() > reach(at.p.xy().norm()) + 5.0 * fit.misfit {
            count[usize::from(at.part == Part::Cone)] += 1.0;
        }
    }
    count.map(|n| n / list.len().max(1) as f64)
}
