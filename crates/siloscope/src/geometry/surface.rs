//! The silo's wall as a surface: a cylinder above a cone, its implicit functions, derivatives and ray intersections.
//!
//! In the silo frame, with ρ = √(x² + y²): the cylinder is ρ − R = 0 for z below `cylinder_bottom` in number, the cone
//! is ρ − m·(z_a − z) = 0 from there to its apex z_a. Either may be missing. A real silo is a little oval: both radii
//! then change with the azimuth φ by the factor 1 + c·cos 2φ + s·sin 2φ. The gradient of both has a radial part of 1, so
//! one residual formula serves both: the distance along a ray with direction q is F / (∇F·q).

use crate::SiloPose;
use crate::geometry::parameters::{CONE_INTERCEPT, CONE_SLOPE, OVALITY, Parameters, RADIUS};
use crate::geometry::sensor::DepthBias;

/// Which part of the wall a point belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The cylinder.
    Cylinder,
    /// The cone.
    Cone,
}

/// Cylinder and cone about one axis; a part that is not there is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SiloSurface {
    /// Camera in the silo.
    pub pose: SiloPose,
    /// Radius R of the cylinder, metres.
    pub radius: Option<f64>,
    /// The cone.
    pub cone: Option<Cone>,
    /// Ovality e = (c, s): the cross-section's radius is larger by the factor 1 + c·cos 2φ + s·sin 2φ.
    pub ovality: [f64; 2],
}

/// Slope m of a cone at an angle of 37.4° to the horizontal. A flatter cone may be feed, whose angle of repose goes up to
/// 36°: a fit to feed with some wall in it may come out a little steeper.
pub const FEED_SLOPE: f64 = 1.31;

/// A cone that opens upwards: ρ = m·(z_a − z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// m, radius gained per metre of height.
    pub slope: f64,
    /// z_a of the vertex in the silo frame, metres.
    pub apex: f64,
}

impl Cone {
    /// The cone with a slope m whose radius at the camera's height is m·z_a, metres.
    pub fn with_intercept(slope: f64, intercept: f64) -> Self {
        Self { slope, apex: intercept / slope }
    }

    /// Whether the cone is no steeper than a surface of feed may be.
    pub fn may_be_feed(&self) -> bool {
        self.slope > FEED_SLOPE
    }

    /// Radius m·z_a of the cone at the camera's height, metres.
    pub fn intercept(&self) -> f64 {
        self.slope * self.apex
    }
}

/// How far surfaces that are near each other may differ; lengths as shares of the silo's size.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceTolerance {
    /// Angle between the axes, radians.
    pub tilt: f64,
    /// Distance between the axes at the camera's height.
    pub shift: f64,
    /// Difference of the radii.
    pub radius: f64,
    /// Difference of the cones' slopes, metres of radius per metre of height.
    pub slope: f64,
    /// Difference of the vertices' heights.
    pub apex: f64,
}

impl SiloSurface {
    /// z where the cylinder meets the cone; infinite on the side of the missing part.
    pub fn cylinder_bottom(&self) -> f64 {
        match (self.radius, self.cone) {
            (Some(radius), Some(cone)) => cone.apex - radius / cone.slope,
            (Some(_), None) => f64::INFINITY,
            _ => f64::NEG_INFINITY,
        }
    }

    /// A length that tells how large the silo is: its radius, or the cone's radius halfway to the camera's height.
    pub fn size(&self) -> f64 {
        self.radius.or(self.cone.map(|c| 0.5 * c.intercept().abs())).unwrap_or(1.0)
    }

    /// The surface without a part.
    pub fn without(self, part: Option<Part>) -> Self {
        match part {
            Some(Part::Cylinder) => Self { radius: None, ..self },
            Some(Part::Cone) => Self { cone: None, ..self },
            None => self,
        }
    }

    /// Whether it has the same parts as another one, and in the same place.
    pub fn is_near(&self, other: &Self, reach: &SurfaceTolerance) -> bool {
        let size = other.size();
        let near = |a: Option<f64>, b: Option<f64>, reach: f64| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < reach,
            (a, b) => a.is_none() && b.is_none(),
        };
        let (a, b) = (&self.pose, &other.pose);
        (a.r_x - b.r_x).hypot(a.r_y - b.r_y) < reach.tilt
            && (a.t_x - b.t_x).hypot(a.t_y - b.t_y) < reach.shift * size
            && near(self.radius, other.radius, reach.radius * size)
            && near(self.cone.map(|c| c.slope), other.cone.map(|c| c.slope), reach.slope)
            && near(self.cone.map(|c| c.apex), other.cone.map(|c| c.apex), reach.apex * size)
    }

    /// Adds a step of the fit; the depth bias is not part of the surface.
    pub fn stepped(&self, step: &Parameters) -> Self {
        Self {
            pose: SiloPose {
                r_x: self.pose.r_x + step[0],
                r_y: self.pose.r_y + step[1],
                t_x: self.pose.t_x + step[2],
                t_y: self.pose.t_y + step[3],
            },
            radius: self.radius.map(|r| r + step[RADIUS]),
            cone: self
                .cone
                .map(|c| Cone::with_intercept(c.slope + step[CONE_SLOPE], c.intercept() + step[CONE_INTERCEPT])),
            ovality: [self.ovality[0] + step[OVALITY], self.ovality[1] + step[OVALITY + 1]],
        }
    }

    /// The parameters of the surface and a depth bias; NaN for a part that is missing.
    pub fn parameters(&self, bias: &DepthBias) -> Parameters {
        let SiloPose { r_x, r_y, t_x, t_y } = self.pose;
        let (slope, intercept) = self.cone.map_or((f64::NAN, f64::NAN), |c| (c.slope, c.intercept()));
        let radius = self.radius.unwrap_or(f64::NAN);
        let ([cos, sin], DepthBias { offset, scale, quadratic }) = (self.ovality, *bias);
        Parameters::from([r_x, r_y, t_x, t_y, radius, slope, intercept, offset, scale, quadratic, cos, sin])
    }

    /// The surface of parameters; a part whose parameters are not finite is missing.
    pub fn of_parameters(p: &Parameters) -> Self {
        let pose = SiloPose { r_x: p[0], r_y: p[1], t_x: p[2], t_y: p[3] };
        let radius = Some(p[RADIUS]).filter(|r| r.is_finite());
        let cone = Cone::with_intercept(p[CONE_SLOPE], p[CONE_INTERCEPT]);
        let cone = Some(cone).filter(|c| c.slope.is_finite() && c.apex.is_finite());
        Self { pose, radius, cone, ovality: [p[OVALITY], p[OVALITY + 1]] }
    }
}
