//! What a fit starts from and what it finds: priors and state.

use crate::Vec3;
use crate::geometry::parameters::Parameters;
use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::{Cone, SiloSurface};

/// What is known before the frame is looked at.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Expected depth bias.
    pub bias: DepthBias,
    /// Its standard deviations (offset, scale, quadratic); zero pins a value.
    pub bias_std: [f64; 3],
    /// Known radius and its standard deviation, metres.
    pub radius: Option<(f64, f64)>,
    /// Direction of gravity in the camera frame and its standard deviation, radians.
    pub gravity: Option<(Vec3, f64)>,
    /// Standard deviation of the ovality's two parts; zero for a round silo.
    pub ovality_std: f64,
}

/// Standard deviation of each part of a real silo's ovality.
pub const OVALITY_STD: f64 = 0.005;

impl Prior {
    /// The same for a silo that may be oval.
    pub fn with_ovality(&self) -> Self {
        Self { ovality_std: OVALITY_STD, ..self.clone() }
    }
}

/// State of the fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The wall.
    pub surface: SiloSurface,
    /// The depth bias.
    pub bias: DepthBias,
    /// Whether the wall is seen from inside.
    pub inside: bool,
    /// Misfit of the wall beside the sensor's noise, metres across the wall.
    pub misfit: f64,
    /// Weight of each patch, 0 to 1.
    pub weights: Vec<f64>,
}

impl Fit {
    /// Adds a step of the fit, shortened where it goes too far.
    pub fn apply(&mut self, step: &Parameters) {
        let shrink = |value: f64, share: f64, of: f64| value.clamp(-share * of, share * of);
        let mut step = *step;
        let reach = self.surface.radius.or(self.surface.cone.map(|c| c.intercept())).unwrap_or(1.0).abs();
        for k in 0..2 {
            step[k] = shrink(step[k], 0.2, 1.0);
        }
        for k in 2..=4 {
            step[k] = shrink(step[k], 0.3, reach);
        }
        if let Some(cone) = self.surface.cone {
            // far from the answer a cone's vertex is surer than its radius at the camera's height
            let slope = cone.slope + shrink(step[5], 0.3, cone.slope);
            let apex = cone.apex + shrink((step[6] - cone.apex * step[5]) / cone.slope, 0.3, reach);
            (step[5], step[6]) = (slope - cone.slope, slope * apex - cone.intercept());
        }
        self.surface = self.surface.stepped(&step);
        self.bias = self.bias.stepped(&step);
    }
}

impl Fit {
    /// Gives the cylinder a known radius by scaling every length, and the depth bias so that nothing measured changes.
    pub fn rescale_to(&mut self, radius: f64) {
        let Some(now) = self.surface.radius else { return };
        let factor = radius / now;
        let SiloSurface { pose, cone, .. } = self.surface;
        self.surface = SiloSurface {
            ovality: self.surface.ovality,
            pose: crate::SiloPose { t_x: pose.t_x * factor, t_y: pose.t_y * factor, ..pose },
            radius: Some(radius),
            cone: cone.map(|c| Cone { apex: c.apex * factor, ..c }),
        };
        self.bias.scale = (1.0 + self.bias.scale) / factor - 1.0;
        self.bias.quadratic /= factor * factor;
    }
}
