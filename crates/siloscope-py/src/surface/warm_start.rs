//! Where a frame's tiles show the wall, for other frames of the camera to start from.

use crate::inputs::depth_bias;
use pyo3::prelude::*;
use siloscope::SiloPose;
use siloscope::geometry::surface::{Cone, SiloSurface};
use siloscope::surface_fit::warm_start::KnownWall;

/// A wall found before; made by `SurfaceFit.warm_start`.
#[pyclass(frozen, eq, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct WarmStart(pub KnownWall);

/// Wall, bias, model error, inside: the arguments of `WarmStart`.
type State = ([f64; 7], [f64; 3], f64, bool);

impl WarmStart {
    fn bits(&self) -> ([u64; 7], [u64; 3], u64, bool) {
        let (wall, bias, error, inside) = self.__getnewargs__();
        (wall.map(f64::to_bits), bias.map(f64::to_bits), error.to_bits(), inside)
    }
}

impl PartialEq for WarmStart {
    fn eq(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }
}

#[pymethods]
impl WarmStart {
    #[new]
    fn new(wall: [f64; 7], bias: [f64; 3], model_error_std: f64, inside: bool) -> Self {
        let [r_x, r_y, t_x, t_y, radius, slope, apex] = wall;
        let surface = SiloSurface {
            pose: SiloPose { r_x, r_y, t_x, t_y },
            radius: Some(radius).filter(|radius| !radius.is_nan()),
            cone: Some(Cone { slope, apex }).filter(|cone| !cone.slope.is_nan()),
            ovality: [0.0; 2],
        };
        Self(KnownWall { surface, bias: depth_bias(bias), inside, misfit: model_error_std })
    }

    /// r_x, r_y, t_x, t_y, radius, slope of the cone and z of its vertex; NaN for a part that was not seen.
    #[getter]
    fn wall(&self) -> [f64; 7] {
        let SiloSurface { pose, radius, cone, .. } = self.0.surface;
        let (slope, apex) = cone.map_or((f64::NAN, f64::NAN), |cone| (cone.slope, cone.apex));
        [pose.r_x, pose.r_y, pose.t_x, pose.t_y, radius.unwrap_or(f64::NAN), slope, apex]
    }

    /// Offset, scale and quadratic part of the depth bias that it was seen with.
    #[getter]
    fn bias(&self) -> [f64; 3] {
        [self.0.bias.offset, self.0.bias.scale, self.0.bias.quadratic]
    }

    /// Standard deviation of the wall about its model beyond the sensor's noise, m.
    #[getter]
    fn model_error_std(&self) -> f64 {
        self.0.misfit
    }

    /// Whether it was seen from inside.
    #[getter]
    fn inside(&self) -> bool {
        self.0.inside
    }

    fn __getnewargs__(&self) -> State {
        (self.wall(), self.bias(), self.0.misfit, self.0.inside)
    }

    fn __repr__(&self) -> String {
        let (wall, bias, error, inside) = self.__getnewargs__();
        let side = if inside { "inside" } else { "outside" };
        format!("WarmStart(wall={wall:.6?}, bias={bias:.6?}, model_error_std={error:.6}, {side})")
    }
}
