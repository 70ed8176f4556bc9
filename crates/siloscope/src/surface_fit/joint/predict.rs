//! What a state predicts on each tile, and the derivatives of the residual.
//!
//! The residual is r = reading − f(d) along the ray, f the depth bias. With F the wall's implicit function, D the ray's
//! direction in the silo frame and x the intrinsics' corrected ray,
//!
//! ```text
//! dr/dθ = f'(d) F_θ / (∇F·D)     F_rx = d ∇F·(∂M/∂r_x x)   F_t = radial   F_R = −1   F_w = −basis
//!                                F_m = z   F_b0 = −1   F_a0 = −radial   F_g = −radial (z − z_b)
//! dr/d(o, b, q) = −(1, d, d²)    F_k = d ∇F·(M ∂x/∂k)
//! ```

use crate::geometry::convex_vessel::{Direction, Incidence, Raycaster};
use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::Part;
use crate::surface_fit::joint::form::{Form, GROUPS};
use crate::surface_fit::joint::parameters::{
    BIAS, CAMERA, COMMON, CONE_FORM, CYLINDER_END, CYLINDER_FORM, INTERCEPT, JointState, OBLIQUITY, OFFSET, RADIUS,
    SIZE, SLOPE,
};
use crate::surface_fit::joint::readings::Readings;

/// A tile against the wall.
#[derive(Debug, Clone, Copy)]
pub struct Sight {
    /// Reading minus prediction along the ray, metres.
    pub residual: f64,
    /// True depth of the wall, metres.
    pub depth: f64,
    /// The wall there.
    pub at: Incidence,
    /// Change of F per metre of residual: residual × rate is the distance from the wall across the axis.
    pub rate: f64,
    /// Squared angle between the tile's normal and the wall's, rad².
    pub angle2: f64,
    /// The tile's ray by the told intrinsics.
    pub ray: [f64; 2],
    /// How the wall bends over the tile, where that counts.
    pub bend: Option<Bend>,
}

/// How the wall bends over a tile: it hardly changes while a fit settles.
#[derive(Debug, Clone, Copy)]
pub struct Bend {
    /// Part of the wall.
    pub part: Part,
    /// Mean of the readings over the tile's pixels minus that at its mean ray, metres.
    pub mean: f64,
    /// Whether a quadratic through the nodes is exact enough for that.
    pub even: bool,
}

/// A state with what its predictions need.
#[derive(Debug, Clone)]
pub struct Predictor<'a> {
    /// The state.
    pub state: &'a JointState,
    /// Its rays.
    pub caster: Raycaster,
    /// The form's terms.
    pub form: &'a Form,
    bias: DepthBias,
    joint: f64,
    vertex: f64,
    bulging: bool,
}

/// Cosine of the incidence below which a tile says nothing.
const GRAZING: f64 = 0.02;
/// Within this distance of the wall a tile's curvature counts, metres: it is a millimetre.
const NEAR: f64 = 0.1;
/// How far a quadratic through nine depths may be off the wall inside a tile, metres.
///
/// The nine lie symmetrically, so that the cubic rest has no mean over the tile, and only the mean is used.
const QUADRATIC_REST: f64 = 5e-5;
/// Weights of the nodes in the quadratic's value a quarter along the tile's diagonal, and three quarters.
const PROBES: [[f64; 9]; 2] = {
    const NEAR: [f64; 3] = [0.375, 0.75, -0.125];
    let mut weights = [[0.0; 9]; 2];
    let mut i = 0;
    while i < 9 {
        weights[0][i] = NEAR[i / 3] * NEAR[i % 3];
        weights[1][8 - i] = weights[0][i];
        i += 1;
    }
    weights
};
/// Depths beyond this are no wall, metres.
const FARTHEST: f64 = 80.0;

impl<'a> Predictor<'a> {
    /// Of a state.
    pub fn new(state: &'a JointState, form: &'a Form) -> Self {
        let bulging = state.x[CYLINDER_FORM..CYLINDER_END].iter().chain(&state.x[CONE_FORM..]).any(|c| *c != 0.0);
        let vertex = if state.has_cone { state.x[INTERCEPT] / state.x[SLOPE] } else { f64::INFINITY };
        let (caster, joint) = (Raycaster::new(state.vessel()), state.joint());
        Self { caster, joint, vertex, bias: state.bias(), bulging, state, form }
    }

    /// Height over a part, −1 to 1 and a little beyond.
    fn height(&self, part: Part, z: f64) -> f64 {
        let (low, high) = match part {
            Part::Cylinder => (0.0, self.state.reference),
            Part::Cone if self.state.has_cylinder => (self.joint, self.vertex),
            Part::Cone => (0.0, self.vertex),
        };
        (2.0 * (z - low) / (high - low).max(0.1) - 1.0).clamp(-1.3, 1.05)
    }

    /// The form's value on a part at a point of it.
    fn bulge(&self, at: &Incidence) -> f64 {
        let mut basis = [0.0; CYLINDER_END - CYLINDER_FORM];
        self.form.evaluate(at.part, self.height(at.part, at.z), at.radial, &mut basis);
        self.coefficients(at.part).iter().zip(basis).map(|(c, b)| c * b).sum()
    }

    /// The form's value at a tile's place on the wall, by groups.
    pub fn bulge_by_group(&self, sight: &Sight) -> [f64; GROUPS.len()] {
        let (mut basis, mut sums) = ([0.0; CYLINDER_END - CYLINDER_FORM], [0.0; GROUPS.len()]);
        let at = &sight.at;
        self.form.evaluate(at.part, self.height(at.part, at.z), at.radial, &mut basis);
        for ((term, coefficient), value) in self.form.of(at.part).iter().zip(self.coefficients(at.part)).zip(basis) {
            sums[term.group as usize] += coefficient * value;
        }
        sums
    }

    fn coefficients(&self, part: Part) -> &[f64] {
        match part {
            Part::Cylinder => &self.state.x[CYLINDER_FORM..CYLINDER_END],
            Part::Cone => &self.state.x[CONE_FORM..],
        }
    }

    /// Depth and place of the wall along a direction, with its form.
    #[inline]
    fn meet(&self, d: &Direction) -> Option<(f64, Incidence, f64)> {
        let (depth, part) = self.caster.depth(d, [0.0; 2]);
        if depth.is_nan() || depth >= FARTHEST {
            return None;
        }
        let at = self.caster.incidence(d, depth, part);
        if !self.bulging {
            return Some((depth, at, 0.0));
        }
        let bulge = self.bulge(&at);
        let depth = self.caster.part_depth(d, part, bulge);
        (depth < FARTHEST).then(|| (depth, self.caster.incidence(d, depth, part), bulge))
    }

    /// Reading of the wall with its form on a told ray, metres; `None` where it is not met.
    pub fn reading(&self, ray: [f64; 2]) -> Option<f64> {
        let (depth, ..) = self.meet(&self.caster.turn(self.state.corrected(ray)))?;
        Some(self.bias.measured(depth)).filter(|reading| reading.is_finite())
    }

    /// Tile `i` against the wall; `None` where its ray misses or grazes it, or where it straddles the joint.
    ///
    /// With `curved` the mean over the tile's pixels takes the place of the wall at its centre; `before` is how the same
    /// wall bent there.
    #[inline]
    pub fn sight(&self, readings: &Readings, i: usize, curved: bool, before: Option<Bend>) -> Option<Sight> {
        let patch = readings.patches.list.get(i)?;
        let ray = [patch.q.x, patch.q.y];
        let turned = self.caster.turn(self.state.corrected(ray));
        let (depth, at, bulge) = self.meet(&turned)?;
        let norm = at.gradient_norm();
        let length = (turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]).sqrt();
        let cosine = at.along / (norm * length);
        let half = 0.5 * readings.pixel * readings.patches.side as f64 * depth;
        let straddles = (at.z - self.joint).abs() * cosine < half;
        if cosine.is_nan() || cosine <= GRAZING || straddles {
            return None;
        }
        let rough = patch.measured - self.bias.measured(depth);
        let near = curved && (rough * cosine).abs() < NEAR;
        let bend = if near {
            let same = before.filter(|bend| bend.part == at.part);
            Some(same.map_or_else(|| self.bend(readings, i, (at.part, bulge), patch.measured - rough), Some)?)
        } else {
            None
        };
        let residual = rough - bend.map_or(0.0, |bend| bend.mean);
        let normal = self.caster.rotate(&patch.normal);
        let facing = -(at.radial[0] * normal.x + at.radial[1] * normal.y + at.rise * normal.z) / norm;
        Some(Sight {
            residual,
            depth,
            at,
            rate: at.along / self.bias.slope(depth),
            angle2: (2.0 - 2.0 * facing).max(0.0),
            ray,
            bend,
        })
    }

    /// How a part of the wall bends over a tile that reads `at_mean_ray` along its mean ray.
    #[inline]
    fn bend(&self, readings: &Readings, i: usize, (part, bulge): (Part, f64), at_mean_ray: f64) -> Option<Bend> {
        let patch = readings.patches.list.get(i)?;
        let rays = readings.patches.rays.get(i)?;
        let read = |ray: [f64; 2]| self.bias.measured(self.true_depth(ray, part, bulge));
        let values = rays.nodes().map(read);
        let sum = |weights: &[f64; 9]| values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>();
        let mean = sum(&readings.node_weights);
        let probes = rays.probes(readings.patches.side);
        let off = |k: usize| (sum(&PROBES[k]) - read(probes[k].1)).abs();
        let side = readings.patches.side as f64;
        let full = patch.count >= side * side;
        // a tile that lacks pixels has its mean ray elsewhere
        let mean = mean - if full { at_mean_ray } else { values[4] };
        let even = off(0) < QUADRATIC_REST && off(1) < QUADRATIC_REST;
        mean.is_finite().then_some(Bend { part, mean, even })
    }

    /// True depth of a part of the wall on a told ray, with a bulge held; not finite where it is not met.
    #[inline(always)]
    pub fn true_depth(&self, ray: [f64; 2], part: Part, bulge: f64) -> f64 {
        self.caster.part_depth(&self.caster.turn(self.state.corrected(ray)), part, bulge)
    }

    /// Whether a told ray ends on a part.
    #[inline(always)]
    pub fn ends_on(&self, ray: [f64; 2], part: Part, bulge: f64) -> bool {
        let turned = self.caster.turn(self.state.corrected(ray));
        let bulges = [bulge; 2];
        self.caster.depth(&turned, bulges).1 == part
    }

    /// The form's value at a tile's place on the wall.
    pub fn bulge_at(&self, sight: &Sight) -> f64 {
        if self.bulging { self.bulge(&sight.at) } else { 0.0 }
    }

    /// Derivative of the residual, in the compact order of the tile's part: the common columns, then the part's own.
    /// Without `form` its columns are left out. Returns the number of columns.
    #[inline]
    pub fn derivative(&self, sight: &Sight, form: bool, row: &mut [f64; SIZE]) -> usize {
        let Sight { depth, at, rate, ray, .. } = *sight;
        let inverse = 1.0 / rate;
        let [by_rx, by_ry] = self.caster.turn_derivatives(self.state.corrected(ray));
        let [gx, gy] = self.caster.ray_derivatives().map(|d| depth * at.dot(&d) * inverse);
        let [x, y] = ray;
        let r2 = x * x + y * y;
        row[0] = depth * at.dot(&by_rx) * inverse;
        row[1] = depth * at.dot(&by_ry) * inverse;
        (row[2], row[3]) = (at.radial[0] * inverse, at.radial[1] * inverse);
        (row[BIAS], row[BIAS + 1], row[BIAS + 2]) = (-1.0, -depth, -depth * depth);
        (row[CAMERA], row[CAMERA + 1]) = (-gx * x, -gy * y);
        (row[CAMERA + 2], row[CAMERA + 3]) = (-gx, -gy);
        row[CAMERA + 4] = -r2 * (gx * x + gy * y);
        let own = match at.part {
            Part::Cylinder => {
                row[COMMON] = -inverse;
                1
            }
            Part::Cone => {
                let up = at.z - self.state.reference;
                (row[COMMON], row[COMMON + 1]) = (at.z * inverse, -inverse);
                (row[COMMON + 2], row[COMMON + 3]) = (-at.radial[0] * inverse, -at.radial[1] * inverse);
                (row[COMMON + 4], row[COMMON + 5]) = (up * row[COMMON + 2], up * row[COMMON + 3]);
                6
            }
        };
        let first = COMMON + own;
        if !form {
            return first;
        }
        let n = self.form.of(at.part).len();
        if let Some(basis) = row.get_mut(first..first + n) {
            self.form.evaluate(at.part, self.height(at.part, at.z), at.radial, basis);
            basis.iter_mut().for_each(|b| *b *= -inverse);
        }
        first + n
    }
}

/// Where the part's own columns begin in the order of all parameters.
pub fn own_columns(part: Part) -> usize {
    match part {
        Part::Cylinder => RADIUS,
        Part::Cone => SLOPE,
    }
}

const _: () = assert!(OFFSET == SLOPE + 2 && OBLIQUITY == SLOPE + 4 && INTERCEPT == SLOPE + 1);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn state() -> JointState {
        let mut x = [0.0; SIZE];
        x[..4].copy_from_slice(&[0.2, -0.15, 0.3, -0.2]);
        (x[RADIUS], x[SLOPE], x[INTERCEPT]) = (1.25, 0.8, 4.0);
        x[OFFSET..OFFSET + 4].copy_from_slice(&[0.05, -0.03, 0.1, 0.07]);
        (x[BIAS], x[BIAS + 1], x[BIAS + 2]) = (0.003, -0.02, 0.02);
        x[CAMERA..COMMON].copy_from_slice(&[0.002, -0.001, 0.001, 0.002, 0.01]);
        JointState { x, has_cylinder: true, has_cone: true, reference: 3.4375 }
    }

    /// Reading of a ray and its sight, where it does not end near the joint.
    fn read(state: &JointState, ray: [f64; 2]) -> Option<(f64, Sight)> {
        let form = Form::default();
        let predictor = Predictor::new(state, &form);
        let (depth, at, _) = predictor.meet(&predictor.caster.turn(state.corrected(ray)))?;
        let bias = state.bias();
        let rate = at.along / bias.slope(depth);
        let sight = Sight { residual: 0.0, depth, at, rate, angle2: 0.0, ray, bend: None };
        ((at.z - predictor.joint).abs() > 0.1).then(|| (bias.measured(depth), sight))
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_the_readings(x in -0.5..0.5f64, y in -0.4..0.4f64) {
            let (base, form, ray) = (state(), Form::default(), [x, y]);
            let Some((_, sight)) = read(&base, ray) else { return Ok(()) };
            prop_assume!(sight.at.along > 0.05 && sight.at.radial[0].is_finite());
            let mut row = [0.0; SIZE];
            let width = Predictor::new(&base, &form).derivative(&sight, true, &mut row);
            let own = own_columns(sight.at.part);
            for (k, analytic) in row[..width].iter().enumerate() {
                let column = if k < COMMON { k } else { own + k - COMMON };
                let h = 1e-6;
                let moved = |by: f64| {
                    let mut moved = base.clone();
                    moved.x[column] += by;
                    read(&moved, ray)
                };
                let (Some((above, _)), Some((below, _))) = (moved(h), moved(-h)) else { continue };
                let numeric = -(above - below) / (2.0 * h);
                prop_assert!((numeric - analytic).abs() < 2e-4 * (1.0 + numeric.abs()), "{column}: {numeric} {analytic}");
            }
        }
    }
}
