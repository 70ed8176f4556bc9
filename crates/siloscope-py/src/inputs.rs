//! What the package hands to the core: frozen dataclasses, read by the names of their fields.

use crate::arrays::in_c_order;
use crate::convert::{self, value_error};
use numpy::{Element, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use siloscope::geometry::depth_image::{Depth, DepthImage};
use siloscope::geometry::sensor::{DepthBias, DepthError, NoiseLaw};
use siloscope::shape_tensor::instrument::SensorErrors;
use siloscope::surface_fit::Knowledge;
use siloscope::{Camera, Vec3};
use std::borrow::Cow;

/// Offset, scale and quadratic part of a depth bias.
pub fn depth_bias([offset, scale, quadratic]: [f64; 3]) -> DepthBias {
    DepthBias { offset, scale, quadratic }
}

/// A noise law from its six numbers in the order of `siloscope.parameters.NOISE`.
pub fn noise_law([floor, constant, linear, quadratic, power_factor, power]: [f64; 6]) -> NoiseLaw {
    NoiseLaw { floor, constant, linear, quadratic, power_factor, power }
}

/// `siloscope.sensors.SensorProfile`.
#[derive(FromPyObject)]
struct SensorProfile {
    bias: [f64; 3],
    bias_std: [f64; 3],
    noise: Option<[f64; 6]>,
}

/// `siloscope.estimation.priors.Priors`.
#[derive(FromPyObject)]
pub struct Priors {
    profile: SensorProfile,
    diameter: Option<f64>,
    diameter_std: f64,
    gravity: Option<[f64; 3]>,
    gravity_std: f64,
    camera_std: [f64; 5],
    told_cone: bool,
    judged: bool,
}

impl Priors {
    /// As the six steps take them.
    pub fn sensor_errors(self) -> SensorErrors {
        let SensorProfile { bias, bias_std, .. } = self.profile;
        SensorErrors { bias: depth_bias(bias), bias_std, camera_std: self.camera_std }
    }

    /// As the surface fit takes them.
    pub fn knowledge(self) -> Knowledge {
        let SensorProfile { bias, bias_std, noise } = self.profile;
        Knowledge {
            error: DepthError { bias: depth_bias(bias), bias_std, noise: noise.map(noise_law) },
            radius: self.diameter.map(|diameter| (diameter / 2.0, self.diameter_std / 2.0)),
            gravity: self.gravity.map(|gravity| (Vec3::from(gravity), self.gravity_std)),
            camera_std: self.camera_std,
            told_cone: self.told_cone,
            judged: self.judged,
        }
    }
}

/// A stored depth image: metres as float32 or float64, raw units as uint16.
#[derive(FromPyObject)]
pub enum DepthArray<'py> {
    /// Metres.
    Single(PyReadonlyArray2<'py, f32>),
    /// Metres.
    Double(PyReadonlyArray2<'py, f64>),
    /// Raw units.
    Raw(PyReadonlyArray2<'py, u16>),
}

/// `siloscope.types.depth_frame.DepthFrame`.
#[derive(FromPyObject)]
pub struct DepthFrame<'py> {
    /// Depths (H, W).
    pub depth: DepthArray<'py>,
    #[pyo3(from_py_with = convert::camera)]
    camera: Camera,
    rays: Option<PyReadonlyArray3<'py, f64>>,
    unit: f64,
    mask: Option<PyReadonlyArray2<'py, bool>>,
}

/// A depth frame with its arrays row by row.
pub struct FrameBuffers<'a, T: Clone> {
    depth: Cow<'a, [T]>,
    camera: &'a Camera,
    rays: Option<Cow<'a, [f64]>>,
    unit: f64,
    mask: Option<Cow<'a, [bool]>>,
}

impl<'py> DepthFrame<'py> {
    /// The arrays of a frame, of which `depth` is the depth, row by row.
    pub fn buffers<'a, T: Element + Copy>(
        &'a self,
        depth: &'a PyReadonlyArray2<'py, T>,
    ) -> PyResult<FrameBuffers<'a, T>> {
        let expected = [self.camera.height, self.camera.width];
        if depth.shape() != expected {
            return Err(value_error(format!("the depth has shape {:?}, its camera {expected:?}", depth.shape())));
        }
        if let Some(rays) = self.rays.as_ref().filter(|rays| rays.shape() != [expected[0], expected[1], 2]) {
            return Err(value_error(format!("the rays have shape {:?}, the camera {expected:?}", rays.shape())));
        }
        if let Some(mask) = self.mask.as_ref().filter(|mask| mask.shape() != expected) {
            return Err(value_error(format!("the mask has shape {:?}, the camera {expected:?}", mask.shape())));
        }
        let rays = self.rays.as_ref().map(in_c_order).transpose()?;
        let mask = self.mask.as_ref().map(in_c_order).transpose()?;
        Ok(FrameBuffers { depth: in_c_order(depth)?, camera: &self.camera, rays, unit: self.unit, mask })
    }

    /// The arrays of a frame in metres of single precision, which the surface fit and the content take.
    pub fn metres(&self) -> PyResult<FrameBuffers<'_, f32>> {
        match &self.depth {
            DepthArray::Single(depth) if self.unit == 1.0 && self.mask.is_none() => self.buffers(depth),
            _ => Err(value_error("the depth must be float32 metres, 0 where there is no measurement")),
        }
    }
}

impl<T: Depth> FrameBuffers<'_, T> {
    /// The core's image of it.
    pub fn image(&self) -> PyResult<DepthImage<'_, T>> {
        let rays = self.rays.as_ref().map(|rays| rays.as_chunks::<2>().0);
        let image = DepthImage::new(&self.depth, self.camera, rays);
        let image = image.and_then(|image| image.with_unit(self.unit)).map_err(value_error)?;
        self.mask.as_ref().map_or(Ok(image), |mask| image.with_mask(mask)).map_err(value_error)
    }
}
