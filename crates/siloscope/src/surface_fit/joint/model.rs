//! The vessel models that compete, and the prior of each: one code path, only widths differ.

use crate::SiloPose;
use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::FEED_SLOPE;
use crate::surface_fit::joint::form::{Form, GROUPS, Group};
use crate::surface_fit::joint::parameters::{
    BIAS, CAMERA, CONE_FORM, CYLINDER_FORM, INTERCEPT, JointState, OBLIQUITY, OFFSET, RADIUS, SIZE, SLOPE,
};
use crate::surface_fit::joint::system::Prior;

/// A cone less steep than this needs feed that lies in it to be a hopper's: 48°, above all drained angles of repose.
pub(crate) const HOPPER_SLOPE: f64 = 0.90;

/// A model of the vessel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// C: a cylinder alone.
    Cylinder,
    /// CK: a cylinder on a coaxial cone.
    CoaxialCone,
    /// CKo: on an oblique cone that is joined to its rim.
    ObliqueCone,
    /// CKf: with a conical surface of its own.
    FreeCone,
    /// K: a right cone alone.
    ConeAlone,
    /// Ko: an oblique cone alone.
    ObliqueConeAlone,
}

impl Model {
    /// Every model.
    pub const ALL: [Self; 6] =
        [Self::Cylinder, Self::CoaxialCone, Self::ObliqueCone, Self::FreeCone, Self::ConeAlone, Self::ObliqueConeAlone];

    /// Models that differ by their priors alone, for the parts of a state.
    ///
    /// A cone as flat as feed lies is a surface of its own: nothing ties it to the cylinder, and alone it is no vessel.
    pub fn of(state: &JointState) -> &'static [Self] {
        let flat = state.has_cone && state.x[SLOPE] > FEED_SLOPE;
        match (state.has_cylinder, state.has_cone) {
            (true, true) if flat => &[Self::FreeCone],
            (true, true) => &[Self::CoaxialCone, Self::ObliqueCone, Self::FreeCone],
            (true, false) => &[Self::Cylinder],
            _ if flat => &[],
            _ => &[Self::ConeAlone, Self::ObliqueConeAlone],
        }
    }

    /// Stable name.
    pub fn slug(self) -> &'static str {
        match self {
            Self::Cylinder => "cylinder",
            Self::CoaxialCone => "coaxial-cone",
            Self::ObliqueCone => "oblique-cone",
            Self::FreeCone => "free-cone",
            Self::ConeAlone => "cone-alone",
            Self::ObliqueConeAlone => "oblique-cone-alone",
        }
    }

    /// ln of its probability before the frame is seen, up to a constant: coaxial hoppers are the rule.
    pub fn log_prior(self) -> f64 {
        match self {
            Self::Cylinder | Self::CoaxialCone => 0.0,
            Self::FreeCone | Self::ConeAlone => -1.0,
            Self::ObliqueCone => -2.0,
            Self::ObliqueConeAlone => -3.0,
        }
    }

    /// Whether the axis is that of a cone alone.
    pub fn is_cone_alone(self) -> bool {
        matches!(self, Self::ConeAlone | Self::ObliqueConeAlone)
    }

    /// Whether it is a hopper with its outlet aside.
    pub fn is_oblique(self) -> bool {
        matches!(self, Self::ObliqueCone | Self::ObliqueConeAlone)
    }

    /// Standard deviations of the cone's offset (as a fraction of the radius) and obliquity, with a building tolerance.
    fn cone_widths(self, tolerance: f64) -> [f64; 2] {
        match self {
            Self::Cylinder => [0.0, 0.0],
            Self::CoaxialCone => [tolerance, tolerance],
            Self::ObliqueCone => [tolerance, OBLIQUE],
            Self::FreeCone => [ECCENTRIC, OBLIQUE],
            Self::ConeAlone => [0.0, tolerance],
            Self::ObliqueConeAlone => [0.0, OBLIQUE],
        }
    }

    /// Puts the cone's widths into a prior; of a cone as good as ideal where its part of the vessel is `ideal`.
    pub fn place_cone(self, prior: &mut Prior, size: f64, ideal: bool) {
        let [offset, obliquity] = self.cone_widths(if ideal { IDEAL * TOLERANCE } else { TOLERANCE });
        for k in 0..2 {
            (prior.mean[OFFSET + k], prior.std[OFFSET + k]) = (0.0, offset * size);
            (prior.mean[OBLIQUITY + k], prior.std[OBLIQUITY + k]) = (0.0, obliquity);
        }
    }
}

/// Building tolerance of a cone against its cylinder: 5 mm per metre.
const TOLERANCE: f64 = 0.005;
/// An oblique hopper's obliquity: its outlet may lie under the wall.
const OBLIQUE: f64 = 0.4;
/// Offset of a conical surface of its own, as a fraction of the radius.
const ECCENTRIC: f64 = 0.3;
/// Slopes of cones: elevations from 37° to 71° are within one standard deviation.
const SLOPES: [f64; 2] = [0.85, 0.5];
/// The pose's prior, rad and fractions of the radius: proper and wide, so that models compare.
const ANY_TILT: f64 = 0.3;
const ANY_SHIFT: f64 = 0.5;
/// The intercept's, as a multiple of the radius.
const ANY_INTERCEPT: f64 = 4.0;

/// What is known before the frame is seen.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// Expected depth bias.
    pub bias: DepthBias,
    /// Standard deviations of offset, scale and quadratic; 0 where exact or held.
    pub bias_std: [f64; 3],
    /// Radius of the cylinder and its standard deviation, metres.
    pub radius: Option<(f64, f64)>,
    /// The pose's angles by gravity, and their standard deviation, rad.
    pub gravity: Option<(SiloPose, f64)>,
    /// Standard deviations of the intrinsics: focal lengths (relative), principal point (rays), k1; 0 where exact.
    pub camera_std: [f64; 5],
}

/// Learned widths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Amplitudes {
    /// Standard deviation of each group of the form, metres.
    pub form: [f64; 5],
    /// Factor on the intrinsics' standard deviations.
    pub camera: f64,
}

/// Pseudo-coefficients of an amplitude's prior: its first value counts as so many.
pub const PSEUDO_COEFFICIENTS: f64 = 1.0;
/// Form of a wall that is ideal to what pixels resolve, over the first amplitudes; and its cone's tolerance over the usual
/// one.
const IDEAL: f64 = 0.01;
/// The same for the intrinsics' common factor.
const CAMERA_PSEUDO: f64 = 4.0;
/// Range of that factor: deviations that are stated are not made smaller, and beyond five of them a frame contradicts
/// what is known of its camera; no vessel is likelier for it.
const CAMERA_FACTORS: [f64; 2] = [1.0, 5.0];

impl Amplitudes {
    /// Before anything is seen.
    pub fn first(size: f64) -> Self {
        Self { form: GROUPS.map(|g| g.bounds(size).first), camera: 1.0 }
    }

    /// Amplitudes of a wall that is as good as ideal.
    pub fn ideal(&self, size: f64) -> Self {
        Self { form: GROUPS.map(|g| IDEAL * g.bounds(size).first), camera: self.camera }
    }

    /// The group whose amplitude is at its cap, which is no wall's form.
    pub fn at_cap(&self, size: f64) -> Option<Group> {
        GROUPS.into_iter().zip(self.form).find(|(g, a)| *a >= g.bounds(size).cap).map(|(g, _)| g)
    }

    /// Fixed point of the marginal likelihood: a² = (Σ (c/shape)² + ν s²) / (Σ γ + ν), γ the coefficients' own
    /// information beside the prior's; `shrinkage` is posterior over prior variance.
    pub fn learned(&self, state: &JointState, form: &Form, shrinkage: &[f64; SIZE], inputs: &Inputs) -> Self {
        let mut next = *self;
        let columns = columns(form);
        for (k, group) in GROUPS.into_iter().enumerate() {
            let bounds = group.bounds(state.size());
            let (mut squares, mut gamma) = (0.0, 0.0);
            for &(column, _, shape) in columns.iter().filter(|(_, g, _)| *g == group) {
                squares += (state.x[column] / shape).powi(2);
                gamma += (1.0 - shrinkage[column]).max(0.0);
            }
            let nu = PSEUDO_COEFFICIENTS;
            next.form[k] = ((squares + nu * bounds.first.powi(2)) / (gamma + nu)).sqrt().min(bounds.cap);
        }
        let known = (0..5).filter(|&k| inputs.camera_std[k] > 0.0);
        let (squares, gamma) = known.fold((0.0, 0.0), |(s, g), k| {
            let off = state.x[CAMERA + k] / inputs.camera_std[k];
            (s + off * off, g + (1.0 - shrinkage[CAMERA + k]).max(0.0))
        });
        let factor = ((squares + CAMERA_PSEUDO) / (gamma + CAMERA_PSEUDO)).sqrt();
        next.camera = factor.clamp(CAMERA_FACTORS[0], CAMERA_FACTORS[1]);
        next
    }

    /// ln of the amplitudes' own prior, up to a constant.
    pub fn log_prior(&self, size: f64) -> f64 {
        let of = |(g, a): (Group, f64)| {
            let ratio = (a / g.bounds(size).first).powi(2);
            -0.5 * PSEUDO_COEFFICIENTS * (ratio.ln() + 1.0 / ratio - 1.0)
        };
        GROUPS.into_iter().zip(self.form).map(of).sum()
    }
}

/// Columns of the form with their group and shape.
pub fn columns(form: &Form) -> Vec<(usize, Group, f64)> {
    let cylinder = form.cylinder.iter().enumerate().map(|(k, t)| (CYLINDER_FORM + k, t.group, t.shape));
    let cone = form.cone.iter().enumerate().map(|(k, t)| (CONE_FORM + k, t.group, t.shape));
    cylinder.chain(cone).collect()
}

/// A model's prior about a start value; without `fields` form and intrinsics are held at 0.
pub fn prior(model: Model, start: &JointState, inputs: &Inputs, form: &Form, amplitudes: Option<&Amplitudes>) -> Prior {
    let size = start.size();
    let mut p = Prior { mean: start.x, std: [0.0; SIZE] };
    p.std[..4].copy_from_slice(&[ANY_TILT, ANY_TILT, ANY_SHIFT * size, ANY_SHIFT * size]);
    if let Some((pose, std)) = inputs.gravity {
        (p.mean[0], p.mean[1]) = (pose.r_x, pose.r_y);
        (p.std[0], p.std[1]) = (std / pose.r_y.cos().abs().max(1e-3), std);
    }
    if start.has_cylinder {
        p.std[RADIUS] = ANY_SHIFT * size;
        if let Some((radius, std)) = inputs.radius {
            (p.mean[RADIUS], p.std[RADIUS]) = (radius, std);
        }
    }
    if start.has_cone {
        (p.mean[SLOPE], p.std[SLOPE]) = (SLOPES[0], SLOPES[1]);
        p.std[INTERCEPT] = ANY_INTERCEPT * size;
        model.place_cone(&mut p, size, false);
    }
    let bias = [inputs.bias.offset, inputs.bias.scale, inputs.bias.quadratic];
    p.mean[BIAS..BIAS + 3].copy_from_slice(&bias);
    p.std[BIAS..BIAS + 3].copy_from_slice(&inputs.bias_std);
    p.mean[CAMERA..CAMERA + 5].fill(0.0);
    for (column, _, _) in columns(form) {
        p.mean[column] = 0.0;
    }
    if let Some(amplitudes) = amplitudes {
        for k in 0..5 {
            p.std[CAMERA + k] = inputs.camera_std[k] * amplitudes.camera;
        }
        for (column, group, shape) in columns(form) {
            let there = if column < CONE_FORM { start.has_cylinder } else { start.has_cone };
            let amplitude = GROUPS.iter().position(|g| *g == group).map_or(0.0, |g| amplitudes.form[g]);
            p.std[column] = if there { amplitude * shape } else { 0.0 };
        }
    }
    p
}
