//! Start values for the surface fit: cylinders and cones through random patches, scored by what else agrees with them.
//!
//! Two oriented patches fix a cylinder (its axis is the cross product of the normals, Eq. 3), three fix a cone. Each
//! hypothesis is scored by the patches whose position and normal both agree; then the other part of the silo is looked
//! for about the same axis.

use crate::Vec3;
use crate::geometry::pose::SiloPose;
use crate::geometry::surface::{Cone, SiloSurface};
use crate::geometry::view::View;
use crate::surface_fit::profile_parts::{
    Oriented, SCORED, SHALLOWEST, STEEPEST, best_cone, best_cylinder, in_profile, profile_score, soft, thinned,
};
use nalgebra::Matrix3;

/// A start value with its score, the soft number of patches that agree.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// The surface.
    pub surface: SiloSurface,
    /// Whether the camera side of the wall is its inside.
    pub inside: bool,
    /// Soft count of agreeing patches.
    pub score: f64,
}

/// Shape of one hypothesis about an axis through `a` along `x`.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Cylinder { radius: f64, inside: bool },
    Cone { slope: f64 },
}

#[derive(Debug, Clone, Copy)]
struct Hypothesis {
    x: Vec3,
    a: Vec3,
    shape: Shape,
    score: f64,
}

/// Deterministic random numbers (SplitMix64): the same frame gives the same answer.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// Most and fewest trials.
const TRIALS: (usize, usize) = (1500, 250);
/// How often three patches should have been drawn that all agree with the best hypothesis.
const HITS: f64 = 40.0;
/// Most hypotheses that are kept.
const KEPT: usize = 6;
/// Tolerated distance from a hypothesis, as a share of its radius.
const REACH: f64 = 0.04;

/// The best few distinct start values, best first.
pub fn starts(patches: &[Oriented], view: View) -> Vec<Start> {
    if patches.len() < 8 {
        return Vec::new();
    }
    let mut random = Random(0x51_10);
    let curved = without_planes(patches, &mut random);
    let patches = curved.as_slice();
    if patches.len() < 8 {
        return Vec::new();
    }
    let sample = thinned(patches, SCORED);
    let mut kept: Vec<Hypothesis> = Vec::new();
    for trial in 0..TRIALS.0 {
        if trial >= enough(&kept, sample.len()) {
            break;
        }
        let mut pick = || &patches[random.below(patches.len())];
        let found = if trial % 5 < 2 || view == View::Outside {
            cylinder(pick(), pick(), view)
        } else {
            cone(pick(), pick(), pick())
        };
        let Some(mut hypothesis) = found else { continue };
        let bar = kept.first().map_or(0.0, |best| best.score);
        hypothesis.score = score(&hypothesis, &sample, 0.3 * bar);
        if hypothesis.score > 0.3 * bar && hypothesis.score > 0.0 {
            keep(&mut kept, hypothesis);
        }
    }
    let mut starts: Vec<Start> = kept.iter().flat_map(|h| complete(h, &sample)).collect();
    starts.sort_by(|a, b| b.score.total_cmp(&a.score));
    starts
}

/// Number of trials after which the hypotheses have been found as often as it takes to tell which one is best.
fn enough(kept: &[Hypothesis], sample: usize) -> usize {
    let share = kept.first().map_or(0.0, |best| best.score) / sample as f64;
    ((HITS / share.powi(3)) as usize).clamp(TRIALS.1, TRIALS.0)
}

/// Leaves out what lies on large planes: flat feed or flat walls would outvote a narrow strip of the silo's wall.
fn without_planes(patches: &[Oriented], random: &mut Random) -> Vec<Oriented> {
    const PLANE_TRIALS: usize = 40;
    let mut rest = patches.to_vec();
    while rest.len() >= 8 {
        let sample = thinned(&rest, SCORED);
        let on = |o: &Oriented, plane: &Oriented| {
            let reach = 0.01 * plane.p.norm() + o.slack + plane.slack;
            (o.p - plane.p).dot(&plane.n).abs() < reach && o.n.dot(&plane.n) > 0.99
        };
        let count = |plane: &Oriented| sample.iter().filter(|o| on(o, plane)).count();
        let planes = (0..PLANE_TRIALS).map(|_| rest[random.below(rest.len())]).map(|p| (count(&p), p));
        match planes.max_by_key(|(n, _)| *n) {
            Some((n, plane)) if n * 4 > sample.len() && !is_curved(sample.iter().filter(|o| on(o, &plane))) => {
                rest.retain(|o| !on(o, &plane))
            }
            _ => break,
        }
    }
    rest
}

/// Least fraction of the normals' scatter over a surface that follows the position where the surface is curved.
const CURVED: f64 = 0.25;

/// Whether the normals of patches turn with their position: those of a plane scatter without regard to it.
fn is_curved<'a>(patches: impl Iterator<Item = &'a Oriented> + Clone) -> bool {
    let (n, p, normal) =
        patches.clone().fold((0.0, Vec3::zeros(), Vec3::zeros()), |(n, p, normal), o| (n + 1.0, p + o.p, normal + o.n));
    let (p, normal) = (p / f64::max(n, 1.0), normal / f64::max(n, 1.0));
    let (mut pp, mut np, mut nn) = (Matrix3::zeros(), Matrix3::zeros(), 0.0);
    for o in patches {
        let (dp, dn) = (o.p - p, o.n - normal);
        pp += dp * dp.transpose();
        np += dn * dp.transpose();
        nn += dn.norm_squared();
    }
    // regression on the position, of which the plane's own normal direction has hardly any scatter
    let ridge = Matrix3::identity() * (1e-3 * pp.trace());
    let Some(inverse) = (pp + ridge).try_inverse() else { return false };
    (np * inverse * np.transpose()).trace() > CURVED * nn
}

/// Keeps the best hypotheses that differ from each other.
fn keep(kept: &mut Vec<Hypothesis>, new: Hypothesis) {
    let same = |h: &Hypothesis| {
        let across = (new.a - h.a) - h.x * (new.a - h.a).dot(&h.x);
        std::mem::discriminant(&h.shape) == std::mem::discriminant(&new.shape)
            && h.x.dot(&new.x).abs() > 0.996
            && across.norm() < 0.03 * (h.a.norm() + new.a.norm()) + 0.02
    };
    if let Some(twin) = kept.iter_mut().find(|h| same(h)) {
        if new.score > twin.score {
            *twin = new;
        }
    } else {
        kept.push(new);
    }
    kept.sort_by(|a, b| b.score.total_cmp(&a.score));
    kept.truncate(KEPT);
}

fn cylinder(i: &Oriented, j: &Oriented, view: View) -> Option<Hypothesis> {
    let cross = i.n.cross(&j.n);
    let sine = cross.norm();
    if sine < 0.17 {
        return None;
    }
    let x = cross / sine * (if cross.z < 0.0 { -1.0 } else { 1.0 });
    let between = j.p - i.p;
    let signed_sine = i.n.cross(&j.n).dot(&x);
    let (li, lj) = (between.cross(&j.n).dot(&x) / signed_sine, between.cross(&i.n).dot(&x) / signed_sine);
    let seen = view == View::Either || (view.allows(li) && view.allows(lj));
    if !seen || (li.abs() - lj.abs()).abs() > 0.2 * li.abs().min(lj.abs()) {
        return None;
    }
    let radius = (li.abs() + lj.abs()) / 2.0;
    let mean = (i.p + i.n * li + j.p + j.n * lj) / 2.0;
    Some(Hypothesis { x, a: mean - x * mean.dot(&x), shape: Shape::Cylinder { radius, inside: li > 0.0 }, score: 0.0 })
}

fn cone(i: &Oriented, j: &Oriented, k: &Oriented) -> Option<Hypothesis> {
    let normals = Matrix3::from_rows(&[i.n.transpose(), j.n.transpose(), k.n.transpose()]);
    if normals.determinant().abs() < 0.02 {
        return None;
    }
    let inverse = normals.try_inverse()?;
    let a = inverse * Vec3::new(i.n.dot(&i.p), j.n.dot(&j.p), k.n.dot(&k.p));
    let x = (inverse * Vec3::new(1.0, 1.0, 1.0)).normalize();
    let x = if i.n.dot(&x) > 0.0 { -x } else { x }; // inner normals of a cone that opens upwards point up
    let sine = -i.n.dot(&x);
    let slope = sine / (1.0 - sine * sine).max(1e-12).sqrt();
    let above = |o: &Oriented| (o.p - a).dot(&x) < 0.0;
    if x.z <= 0.0 || !(0.8 * STEEPEST..SHALLOWEST).contains(&slope) || !(above(i) && above(j) && above(k)) {
        return None;
    }
    Some(Hypothesis { x, a, shape: Shape::Cone { slope }, score: 0.0 })
}

/// Soft count of the patches that agree; gives up early where `bar` can't be reached.
fn score(h: &Hypothesis, sample: &[Oriented], bar: f64) -> f64 {
    let mut total = 0.0;
    for (i, o) in sample.iter().enumerate() {
        total += agreement(h, o);
        if i == sample.len() / 4 && total * 6.0 < bar {
            return 0.0;
        }
    }
    total
}

#[inline]
fn agreement(h: &Hypothesis, o: &Oriented) -> f64 {
    let v = o.p - h.a;
    let z = v.dot(&h.x);
    let radial = v - h.x * z;
    let rho = radial.norm().max(1e-9);
    let (distance, expected, scale) = match h.shape {
        Shape::Cylinder { radius, inside } => (rho - radius, radial * (if inside { -1.0 } else { 1.0 } / rho), radius),
        Shape::Cone { slope } => {
            let c = 1.0 / (1.0 + slope * slope).sqrt();
            ((rho + slope * z) * c, (radial / rho + h.x * slope) * -c, rho)
        }
    };
    soft(distance, REACH * scale + o.slack, o.cosine(o.n.dot(&expected)), o.angle)
}

/// The hypothesis as it is, and with the other part of the silo where patches ask for one.
fn complete(h: &Hypothesis, sample: &[Oriented]) -> Vec<Start> {
    let pose = SiloPose::from_axis(&h.x, &h.a);
    let local = in_profile(&pose, sample);
    let alone = match h.shape {
        Shape::Cylinder { radius, inside } => {
            (SiloSurface { pose, radius: Some(radius), cone: None, ovality: [0.0; 2] }, inside)
        }
        Shape::Cone { slope } => {
            let apex = pose.to_silo(&h.a).z;
            (SiloSurface { pose, radius: None, cone: Some(Cone { slope, apex }), ovality: [0.0; 2] }, true)
        }
    };
    let mut found = vec![alone];
    match h.shape {
        Shape::Cylinder { inside: true, .. } => {
            found.extend(best_cone(&alone.0, STEEPEST..SHALLOWEST, REACH, &local).map(|s| (s, true)))
        }
        Shape::Cone { .. } => found.extend(best_cylinder(&alone.0, REACH, &local).map(|s| (s, true))),
        Shape::Cylinder { .. } => {}
    }
    found
        .iter()
        .map(|&(surface, inside)| Start { surface, inside, score: profile_score(&surface, inside, REACH, &local) })
        .collect()
}
