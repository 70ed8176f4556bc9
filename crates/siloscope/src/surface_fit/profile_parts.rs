//! Patches in the plane through a known axis, where a wall is a line: which cylinder or cone they ask for beside it.

use crate::Vec3;
use crate::geometry::pose::SiloPose;
use crate::geometry::surface::{Cone, SiloSurface};

/// Patches that score a proposal of a part.
pub(super) const SCORED: usize = 300;
/// Tolerated distance from a part about a refined axis, as a share of its radius.
const FINE_REACH: f64 = 0.015;
/// Slopes of cones that silos have, and feed.
pub(super) const STEEPEST: f64 = 0.1;
/// The least steep of them.
pub(super) const SHALLOWEST: f64 = 2.7;

/// A patch as the start sees it: a point, its unit normal, and how sure they are.
#[derive(Debug, Clone, Copy)]
pub struct Oriented {
    /// Position in the camera frame.
    pub p: Vec3,
    /// Unit normal towards the camera.
    pub n: Vec3,
    /// Whether the normal's sign is known.
    pub signed: bool,
    /// Tolerated angle between the normal and a model's, radians.
    pub angle: f64,
    /// Tolerated distance of the point from a model that adds to the model's own, metres.
    pub slack: f64,
}

impl Oriented {
    /// The cosine of an angle with the normal, or with the line along it where its sign is unknown.
    #[inline]
    pub(super) fn cosine(&self, cosine: f64) -> f64 {
        if self.signed { cosine } else { cosine.abs() }
    }
}

/// A patch in the plane through the silo's axis and itself, where the wall is a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct InProfile {
    rho: f64,
    z: f64,
    /// The normal's radial and axial parts; the radial one is turned inwards where the sign is unknown.
    n_rho: f64,
    n_z: f64,
    of: Oriented,
}

impl InProfile {
    /// Of a patch in the silo frame.
    fn new(of: Oriented) -> Self {
        let rho = (of.p.x * of.p.x + of.p.y * of.p.y).sqrt().max(1e-9);
        let n_rho = (of.n.x * of.p.x + of.n.y * of.p.y) / rho;
        let turn = if !of.signed && n_rho > 0.0 { -1.0 } else { 1.0 };
        Self { rho, z: of.p.z, n_rho: turn * n_rho, n_z: turn * of.n.z, of }
    }
}

pub(super) fn thinned(patches: &[Oriented], n: usize) -> Vec<Oriented> {
    if patches.len() <= n {
        return patches.to_vec();
    }
    (0..n).map(|i| patches[i * patches.len() / n]).collect()
}

/// 1 where distance and normal agree, falling to 0 at their tolerances.
#[inline]
pub(super) fn soft(distance: f64, reach: f64, cosine: f64, angle: f64) -> f64 {
    let d = distance / reach;
    let a2 = 2.0 * (1.0 - cosine) / (angle * angle);
    if d.abs() >= 1.0 || a2 >= 1.0 { 0.0 } else { (1.0 - d * d) * (1.0 - a2) }
}

/// The surface with the part that it lacks, where patches (camera frame) ask for one.
pub fn other_part(surface: &SiloSurface, patches: &[Oriented]) -> Option<SiloSurface> {
    let local = in_profile(&surface.pose, &thinned(patches, 3 * SCORED));
    if surface.cone.is_none() {
        best_cone(surface, STEEPEST..SHALLOWEST, FINE_REACH, &local)
    } else {
        best_cylinder(surface, FINE_REACH, &local)
    }
}

/// The surface with another cone, of less than `slope`, in place of its own, where patches (camera frame) ask for one.
pub fn steeper_cone(surface: &SiloSurface, slope: f64, patches: &[Oriented]) -> Option<SiloSurface> {
    let local = in_profile(&surface.pose, &thinned(patches, 3 * SCORED));
    best_cone(&SiloSurface { cone: None, ..*surface }, STEEPEST..slope, FINE_REACH, &local)
}

pub(super) fn in_profile(pose: &SiloPose, patches: &[Oriented]) -> Vec<InProfile> {
    let turn = pose.rotation();
    let place = |o: &Oriented| InProfile::new(Oriented { p: pose.to_silo(&o.p), n: turn * o.n, ..*o });
    patches.iter().map(place).collect()
}

/// Soft count of the patches (silo frame) that agree with a surface about the z-axis.
pub(super) fn profile_score(s: &SiloSurface, inside: bool, reach: f64, local: &[InProfile]) -> f64 {
    local.iter().map(|o| profile_agreement(s, inside, reach, o)).sum()
}

fn profile_agreement(s: &SiloSurface, inside: bool, reach: f64, seen: &InProfile) -> f64 {
    let InProfile { rho, z, n_rho, n_z, of } = seen;
    let side = if inside { -1.0 } else { 1.0 };
    match (s.radius, s.cone) {
        (Some(radius), cone) if cone.is_none() || *z < s.cylinder_bottom() => {
            soft(rho - radius, reach * radius + of.slack, of.cosine(side * n_rho), of.angle)
        }
        (_, Some(cone)) => {
            let c = 1.0 / (1.0 + cone.slope * cone.slope).sqrt();
            let distance = (rho - cone.slope * (cone.apex - z)) * c;
            let cosine = of.cosine(-c * (n_rho + cone.slope * n_z));
            soft(distance, reach * rho + of.slack, cosine, of.angle)
        }
        _ => 0.0,
    }
}

/// The cone of a slope in `slopes` that most patches agree with, below the cylinder where there is one; each patch
/// proposes one by its normal.
pub(super) fn best_cone(
    cylinder: &SiloSurface,
    slopes: std::ops::Range<f64>,
    reach: f64,
    local: &[InProfile],
) -> Option<SiloSurface> {
    let radius = cylinder.radius.unwrap_or(f64::INFINITY);
    let proposals = local.iter().filter_map(|&InProfile { rho, z, n_rho, n_z, .. }| {
        let slope = n_z / n_rho;
        let cone = Cone { slope, apex: z + rho / slope };
        let meridian = n_rho.hypot(n_z) > 0.97;
        let possible = n_rho < 0.0 && slopes.contains(&slope) && rho < 0.97 * radius && meridian;
        possible.then_some(SiloSurface { cone: Some(cone), ..*cylinder })
    });
    best(proposals, profile_score(cylinder, true, reach, local), reach, local)
}

/// Above a known cone, the cylinder that most patches agree with; each patch proposes its own radius.
pub(super) fn best_cylinder(cone: &SiloSurface, reach: f64, local: &[InProfile]) -> Option<SiloSurface> {
    let proposals =
        local.iter().filter_map(|seen| (seen.n_rho < -0.97).then_some(SiloSurface { radius: Some(seen.rho), ..*cone }));
    best(proposals, profile_score(cone, true, reach, local), reach, local)
}

/// The proposal with the best score, where it beats the score without it.
fn best(
    proposals: impl Iterator<Item = SiloSurface>,
    bar: f64,
    reach: f64,
    local: &[InProfile],
) -> Option<SiloSurface> {
    const TRIED: usize = 60;
    let proposals: Vec<SiloSurface> = proposals.collect();
    let mut found = None;
    let mut best = bar + 3.0;
    for &surface in proposals.iter().step_by(proposals.len().div_ceil(TRIED).max(1)) {
        if let Some(score) = score_above(best, &surface, reach, local) {
            best = score;
            found = Some(surface);
        }
    }
    found
}

/// The score of a surface seen from inside, where it beats `bar`; ends as soon as it no longer can.
fn score_above(bar: f64, s: &SiloSurface, reach: f64, local: &[InProfile]) -> Option<f64> {
    const RUN: usize = 32;
    let (mut total, mut left) = (0.0, local.len());
    for run in local.chunks(RUN) {
        total += run.iter().map(|o| profile_agreement(s, true, reach, o)).sum::<f64>();
        left -= run.len();
        if total + left as f64 <= bar {
            return None;
        }
    }
    Some(total)
}
