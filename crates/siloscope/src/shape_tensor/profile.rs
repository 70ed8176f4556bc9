//! The silo's profile about a known axis: the cylinder's radius and the cone, as far as walls are seen.

use crate::base::refusal::Refusal;
use crate::geometry::surface::Cone;
use crate::geometry::view::View;
use crate::stats::blocks::{blocks, sums};
use crate::stats::line_fit::LineFit;
use crate::stats::robust::{MAD_TO_STD, TUKEY, median};
use crate::{SiloPose, Vec3};
use nalgebra::{Matrix2, Vector2};

/// A wall point in the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Distance ρ from the axis.
    pub rho: f64,
    /// z in the silo frame.
    pub z: f64,
    /// Angle of the wall to the axis by its normal: 0 on the cylinder, atan m on the cone.
    pub angle: f64,
    /// The block it belongs to.
    pub block: usize,
}

/// Cylinder and cone about one axis; a part that is not seen is None. Standard deviations beside them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Profile {
    /// Radius R.
    pub radius: Option<f64>,
    /// The cone ρ = m(z_a − z).
    pub cone: Option<Cone>,
    /// Standard deviation of the radius.
    pub radius_std: f64,
    /// Covariance of the cone's slope m and vertex z_a.
    pub cone_covariance: Matrix2<f64>,
    /// Robust standard deviation of the walls' distances from it.
    pub misfit: f64,
}

/// Places that the profile rests on, that propose parts, and that judge the proposals: enough of each, and no more
/// time than a step takes.
const PLACES: usize = 4000;
const PROPOSERS: usize = 48;
const JUDGES: usize = 160;
/// How far a wall's normal may be off its part's, radians: far walls are rough.
const MAX_ANGLE: f64 = 0.25;
/// How far a wall may be off a proposed part, as a share of the median distance from the axis.
const PROPOSAL_TOLERANCE: f64 = 0.04;
/// Slopes m of cones that hold feed and let it out.
const SLOPES: std::ops::RangeInclusive<f64> = 0.1..=5.0;
/// Share of the places that a part must have to be one.
const MIN_FRACTION: f64 = 0.02;

/// Fits cylinder and cone to a cloud with its normals, given the pose; blocks of side `side` tell how sure they are.
///
/// Points whose normals meet the axis and pairs of them propose parts; the profile that most points agree with is
/// refined by least squares with Tukey's weights. Feed may be among the points: it is outvoted, or no wall.
pub fn fit_profile(points: &[Vec3], normals: &[Vec3], pose: &SiloPose, side: f64) -> Profile {
    let (places, blocks) = places(points, normals, pose, side);
    let judges = subsample(&places, JUDGES);
    let Some(scale) = median(judges.iter().map(|p| p.rho).collect()) else { return Profile::default() };
    let mut profile = proposed(&judges, PROPOSAL_TOLERANCE * scale);
    profile.misfit = PROPOSAL_TOLERANCE * scale;
    for _ in 0..10 {
        profile.refine(&places);
    }
    profile.drop_small_parts(&places);
    profile.add_deviations(&places, blocks);
    profile
}

/// The points whose normals meet the axis, as places of the profile.
fn places(points: &[Vec3], normals: &[Vec3], pose: &SiloPose, side: f64) -> (Vec<Place>, usize) {
    let turn = pose.rotation();
    let step = points.len().div_ceil(PLACES).max(1);
    let placed = points.iter().zip(normals).step_by(step).map(|(p, normal)| (pose.to_silo(p), turn * normal));
    let meets_axis = |(p, n): &(Vec3, Vec3)| (p.x * n.y - p.y * n.x).abs() < MAX_ANGLE * p.xy().norm() * n.xy().norm();
    let placed: Vec<_> = placed.filter(meets_axis).collect();
    let (block, blocks) = blocks(placed.iter().map(|(p, _)| *p), side);
    let place = |((p, n), block): (&(Vec3, Vec3), usize)| {
        let rho = p.xy().norm();
        Place { rho, z: p.z, angle: (n.z * rho / p.xy().dot(&n.xy())).atan(), block }
    };
    (placed.iter().zip(block).map(place).collect(), blocks)
}

fn subsample(places: &[Place], n: usize) -> Vec<Place> {
    let n = n.min(places.len());
    (0..n).map(|i| places[i * places.len() / n]).collect()
}

/// The proposal that most judges agree with: one part first, then the other where it is wanted.
fn proposed(judges: &[Place], reach: f64) -> Profile {
    let proposers = subsample(judges, PROPOSERS);
    let cylinders = proposers.iter().filter(|p| p.angle.abs() < MAX_ANGLE).map(|p| Some(p.rho));
    let cylinders: Vec<_> = cylinders.chain([None]).collect();
    let pairs = proposers.iter().enumerate().flat_map(|(i, p)| proposers[..i].iter().map(move |q| (p, q)));
    let cones: Vec<_> = pairs.filter_map(|(p, q)| cone_through(p, q)).map(Some).chain([None]).collect();
    let judged = |radius: Option<f64>, cone: Option<Cone>| {
        let profile = Profile { radius, cone, ..Profile::default() };
        (judges.iter().map(|p| profile.agreement(p, reach)).sum::<f64>(), profile)
    };
    let one = cylinders.iter().map(|r| judged(*r, None)).chain(cones.iter().map(|c| judged(None, *c)));
    let (score, one) = best(one);
    let other: Vec<_> = match one.radius {
        Some(_) => cones.iter().map(|c| judged(one.radius, *c)).collect(),
        None => cylinders.iter().map(|r| judged(*r, one.cone)).collect(),
    };
    let (with_other, both) = best(other.into_iter());
    if with_other > score + MIN_FRACTION * judges.len() as f64 { both } else { one }
}

fn best(judged: impl Iterator<Item = (f64, Profile)>) -> (f64, Profile) {
    judged.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

fn cone_through(p: &Place, q: &Place) -> Option<Cone> {
    let slope = (p.rho - q.rho) / (q.z - p.z);
    let fits = |place: &Place| (slope.atan() - place.angle).abs() < MAX_ANGLE;
    let is_cone = SLOPES.contains(&slope) && fits(p) && fits(q);
    is_cone.then(|| Cone { slope, apex: p.z + p.rho / slope })
}

impl Profile {
    /// Adds the step from one profile to another to the covariances, of the parts that both have.
    pub fn add_step(&mut self, from: &Self, to: &Self) {
        if let (Some(from), Some(to)) = (from.radius, to.radius) {
            self.radius_std = self.radius_std.hypot(to - from);
        }
        if let (Some(from), Some(to)) = (from.cone, to.cone) {
            let step = Vector2::new(to.slope - from.slope, to.apex - from.apex);
            self.cone_covariance += step * step.transpose();
        }
    }

    /// z where the cylinder meets the cone; None where either is missing.
    pub fn bottom(&self) -> Option<f64> {
        Some(self.cone?.apex - self.radius? / self.cone?.slope)
    }

    /// Standard deviation of the cone's vertex.
    pub fn apex_std(&self) -> f64 {
        self.cone_covariance[(1, 1)].sqrt()
    }

    /// Standard deviation of the height where they meet, z_a − R/m.
    pub fn bottom_std(&self) -> f64 {
        let (Some(radius), Some(cone)) = (self.radius, self.cone) else { return f64::NAN };
        let row = Vector2::new(radius / cone.slope.powi(2), 1.0);
        ((self.radius_std / cone.slope).powi(2) + row.dot(&(self.cone_covariance * row))).sqrt()
    }

    /// Signed distance from the wall, positive outside, and the wall's angle to the axis there; NaN without any wall.
    pub fn distance(&self, rho: f64, z: f64) -> (f64, f64) {
        let cylinder = self.radius.map(|radius| (rho - radius, 0.0));
        let cone = self.cone.map(|c| ((rho - c.slope * (c.apex - z)) / 1.0_f64.hypot(c.slope), c.slope.atan()));
        match (self.bottom(), cylinder, cone) {
            (Some(bottom), Some(cylinder), Some(cone)) => {
                if z < bottom {
                    cylinder
                } else {
                    cone
                }
            }
            (_, cylinder, cone) => cylinder.or(cone).unwrap_or((f64::NAN, f64::NAN)),
        }
    }

    /// A length that tells how large the silo is: its radius, or the cone's halfway to the camera's height.
    pub fn size(&self) -> f64 {
        self.radius.or(self.cone.map(|cone| 0.5 * cone.slope * cone.apex.abs())).unwrap_or(0.0)
    }

    /// Whether the cone lies as flat as feed does.
    pub fn cone_may_be_feed(&self) -> bool {
        self.cone.is_some_and(|cone| cone.may_be_feed())
    }

    /// Whether there is a wall at all, and the camera on the side from which it was seen.
    pub fn judge(&self, pose: &SiloPose, view: View) -> Result<(), Refusal> {
        let inside = self.distance(pose.t_x.hypot(pose.t_y), 0.0).0 < 0.0;
        let possible = match view {
            View::Either => self.radius.is_some() || self.cone.is_some(),
            View::Inside => inside,
            View::Outside => self.radius.is_some() && !inside,
        };
        if possible { Ok(()) } else { Err(Refusal::NoWall) }
    }

    /// Whether a height belongs to the cone.
    pub fn is_cone(&self, z: f64) -> bool {
        self.cone.is_some() && self.bottom().is_none_or(|bottom| z >= bottom)
    }

    /// 1 where place and normal agree with the profile, falling to 0.
    fn agreement(&self, p: &Place, reach: f64) -> f64 {
        let (off, angle) = self.distance(p.rho, p.z);
        let soft = |x: f64| (1.0 - x * x).max(0.0);
        if off.is_nan() { 0.0 } else { soft(off / reach) * soft((p.angle - angle) / (2.0 * MAX_ANGLE)) }
    }

    /// One round of reweighted least squares on each part; the scale is the agreeing places' own.
    fn refine(&mut self, places: &[Place]) {
        let (cylinder, cone) = (self.of_part(places, false), self.of_part(places, true));
        let off = cylinder.iter().chain(&cone).map(|(p, _)| self.distance(p.rho, p.z).0.abs());
        // At most halved: a scale that falls too fast would freeze a bad start.
        let own = MAD_TO_STD * median(off.collect()).unwrap_or(0.0);
        self.misfit = own.clamp(0.5 * self.misfit, self.misfit);
        if self.radius.is_some() {
            self.radius = weighted_mean(&cylinder).or(self.radius);
        }
        if self.cone.is_some() {
            self.cone = weighted_cone(&cone).or(self.cone);
        }
    }

    /// The places of cylinder or cone that agree, with Tukey's weights.
    fn of_part(&self, places: &[Place], cone: bool) -> Vec<(Place, f64)> {
        let of_part = places.iter().filter(|p| self.is_cone(p.z) == cone);
        of_part.map(|p| (*p, self.weight(p))).filter(|(_, weight)| *weight > 0.0).collect()
    }

    /// Tukey's weight; none for a normal that says otherwise.
    fn weight(&self, p: &Place) -> f64 {
        let (off, angle) = self.distance(p.rho, p.z);
        let x = off / (TUKEY * self.misfit.max(1e-12));
        let agrees = (p.angle - angle).abs() < 2.0 * MAX_ANGLE && x.abs() < 1.0;
        if agrees { (1.0 - x * x).powi(2) } else { 0.0 }
    }

    fn drop_small_parts(&mut self, places: &[Place]) {
        let weight = |cone: bool| self.of_part(places, cone).iter().map(|(_, w)| w).sum::<f64>();
        let (cylinder, cone) = (weight(false), weight(true));
        let least = MIN_FRACTION * (cylinder + cone);
        self.radius = self.radius.filter(|_| cylinder > least);
        self.cone = self.cone.filter(|_| cone > least);
    }

    /// Standard deviations from the sums of the residuals over blocks.
    fn add_deviations(&mut self, places: &[Place], blocks: usize) {
        let cylinder = self.of_part(places, false);
        let scores = cylinder.iter().map(|(p, w)| (p.block, [w * self.distance(p.rho, p.z).0]));
        let total: f64 = cylinder.iter().map(|(_, w)| w).sum();
        self.radius_std = sums(scores, blocks).iter().map(|s| s[0] * s[0]).sum::<f64>().sqrt() / total;
        let Some(Cone { slope, apex }) = self.cone else { return };
        let cone = self.of_part(places, true);
        // ρ − m(z_a − z) has the derivatives −(z_a − z) in m and −m in z_a.
        let row = |p: &Place| Vector2::new(apex - p.z, slope);
        let normal: Matrix2<f64> = cone.iter().map(|(p, w)| row(p) * row(p).transpose() * *w).sum();
        let residual = |p: &Place| p.rho - slope * (apex - p.z);
        let scores = cone.iter().map(|(p, w)| (p.block, (row(p) * (w * residual(p))).into()));
        let meat: Matrix2<f64> = sums(scores, blocks).into_iter().map(Vector2::from).map(|s| s * s.transpose()).sum();
        let bread = normal.try_inverse().unwrap_or_else(|| Matrix2::repeat(f64::NAN));
        self.cone_covariance = bread * meat * bread;
    }
}

fn weighted_mean(places: &[(Place, f64)]) -> Option<f64> {
    let weight: f64 = places.iter().map(|(_, w)| w).sum();
    (weight > 0.0).then(|| places.iter().map(|(p, w)| w * p.rho).sum::<f64>() / weight)
}

/// Line ρ = m(z_a − z) by weighted least squares; None where it is no cone.
fn weighted_cone(places: &[(Place, f64)]) -> Option<Cone> {
    let line = LineFit::of(places.iter().map(|(p, w)| (p.z, p.rho, *w)));
    let slope = -line.slope();
    SLOPES.contains(&slope).then(|| Cone { slope, apex: line.root() })
}
