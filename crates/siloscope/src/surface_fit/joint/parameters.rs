//! Order of the joint fit's parameters: what all tiles share, then what only the cylinder or only the cone has.
//!
//! A row of the normal equations is therefore dense: a tile of the cylinder has the columns `0..CYLINDER_END`, a tile of
//! the cone the columns `0..COMMON` and `SLOPE..SIZE`.

use crate::SiloPose;
use crate::geometry::convex_vessel::{ConvexVessel, LeaningCone};
use crate::geometry::sensor::DepthBias;
use crate::surface_fit::joint::form::{CONE_TERMS, CYLINDER_TERMS};

/// Depth bias: offset (m), scale, quadratic (1/m).
pub const BIAS: usize = 4;
/// Errors of the given intrinsics: focal lengths (relative), principal point (rays), k1.
pub const CAMERA: usize = 7;
/// End of the columns that every tile has; the pose comes first.
pub const COMMON: usize = 12;
/// Radius of the cylinder, metres.
pub const RADIUS: usize = 12;
/// The cylinder's form, metres.
pub const CYLINDER_FORM: usize = 13;
/// The cylinder's ovality, the same at all heights, two columns: after the rings' 8 and the bend's 8.
pub const OVAL_COLUMN: usize = CYLINDER_FORM + 16;
/// End of the cylinder's columns.
pub const CYLINDER_END: usize = CYLINDER_FORM + CYLINDER_TERMS;
/// Slope of the cone.
pub const SLOPE: usize = CYLINDER_END;
/// Intercept of the cone, metres.
pub const INTERCEPT: usize = SLOPE + 1;
/// Offset of the cone, two columns, metres.
pub const OFFSET: usize = SLOPE + 2;
/// Obliquity of the cone, two columns.
pub const OBLIQUITY: usize = SLOPE + 4;
/// The cone's form, metres.
pub const CONE_FORM: usize = SLOPE + 6;
/// Number of parameters.
pub const SIZE: usize = CONE_FORM + CONE_TERMS;

/// Values of all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct JointState {
    /// The values, in the order above.
    pub x: [f64; SIZE],
    /// Whether there is a cylinder.
    pub has_cylinder: bool,
    /// Whether there is a cone.
    pub has_cone: bool,
    /// Height z_b at which the cone's offset is its centre and the form's height scale ends, metres.
    pub reference: f64,
}

impl JointState {
    /// The camera's pose.
    pub fn pose(&self) -> SiloPose {
        SiloPose { r_x: self.x[0], r_y: self.x[1], t_x: self.x[2], t_y: self.x[3] }
    }

    /// The depth bias.
    pub fn bias(&self) -> DepthBias {
        DepthBias { offset: self.x[BIAS], scale: self.x[BIAS + 1], quadratic: self.x[BIAS + 2] }
    }

    /// The vessel.
    pub fn vessel(&self) -> ConvexVessel {
        let cone = LeaningCone {
            slope: self.x[SLOPE],
            intercept: self.x[INTERCEPT],
            offset: [self.x[OFFSET], self.x[OFFSET + 1]],
            obliquity: [self.x[OBLIQUITY], self.x[OBLIQUITY + 1]],
            reference: self.reference,
        };
        ConvexVessel {
            pose: self.pose(),
            radius: self.has_cylinder.then_some(self.x[RADIUS]),
            cone: self.has_cone.then_some(cone),
        }
    }

    /// A length that tells how large the silo is: its radius, or that of the cone halfway to the camera's height.
    pub fn size(&self) -> f64 {
        if self.has_cylinder { self.x[RADIUS] } else { 0.5 * self.x[INTERCEPT].abs() }
    }

    /// z at which the cylinder meets the cone on their axes; infinite on the side of a missing part.
    pub fn joint(&self) -> f64 {
        match (self.has_cylinder, self.has_cone) {
            (true, true) => (self.x[INTERCEPT] - self.x[RADIUS]) / self.x[SLOPE].max(LEAST_SLOPE),
            (true, false) => f64::INFINITY,
            _ => f64::NEG_INFINITY,
        }
    }

    /// Adds a step.
    pub fn add(&mut self, step: &[f64; SIZE], factor: f64) {
        self.x.iter_mut().zip(step).for_each(|(x, step)| *x += factor * step);
    }

    /// A ray of the told intrinsics, corrected by their errors.
    #[inline(always)]
    pub fn corrected(&self, ray: [f64; 2]) -> [f64; 2] {
        corrected(
            ray,
            &[self.x[CAMERA], self.x[CAMERA + 1], self.x[CAMERA + 2], self.x[CAMERA + 3], self.x[CAMERA + 4]],
        )
    }
}

/// A ray of the told intrinsics, corrected by their errors: focal lengths (relative), principal point (rays), k1.
#[inline(always)]
pub fn corrected([x, y]: [f64; 2], [fx, fy, cx, cy, k1]: &[f64; 5]) -> [f64; 2] {
    let radial = k1 * (x * x + y * y);
    [x - cx - x * (fx + radial), y - cy - y * (fy + radial)]
}

/// Cones flatter in radius per height than this are cylinders.
pub const LEAST_SLOPE: f64 = 0.05;
