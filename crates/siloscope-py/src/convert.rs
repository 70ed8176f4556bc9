//! Conversions shared by all bindings.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use siloscope::{Camera, Distortion};

/// The core's error as Python's `ValueError`; the package wraps it into its own classes.
pub fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Reads a Python `siloscope.Camera` by its fields and checks it.
pub fn camera(object: &Bound<'_, PyAny>) -> PyResult<Camera> {
    let number = |name: &str| object.getattr(name)?.extract::<f64>();
    let model: String = object.getattr("distortion_model")?.extract()?;
    let coefficients: Vec<f64> = object.getattr("distortion")?.extract()?;
    let camera = Camera {
        width: object.getattr("width")?.extract()?,
        height: object.getattr("height")?.extract()?,
        fx: number("fx")?,
        fy: number("fy")?,
        cx: number("cx")?,
        cy: number("cy")?,
        distortion: distortion(&model, &coefficients)?,
    };
    camera.validate().map_err(value_error)?;
    Ok(camera)
}

fn distortion(model: &str, k: &[f64]) -> PyResult<Distortion> {
    fn padded<const N: usize>(model: &str, k: &[f64]) -> PyResult<[f64; N]> {
        if k.len() > N || k.iter().any(|x| !x.is_finite()) {
            return Err(value_error(format!("{model} takes up to {N} finite distortion coefficients, got {k:?}")));
        }
        let mut out = [0.0; N];
        out[..k.len()].copy_from_slice(k);
        Ok(out)
    }
    Ok(match model {
        "none" => Distortion::None,
        "brown_conrady" => Distortion::BrownConrady(padded(model, k)?),
        "inverse_brown_conrady" => Distortion::InverseBrownConrady(padded(model, k)?),
        "rational" => Distortion::Rational(padded(model, k)?),
        "kannala_brandt" => Distortion::KannalaBrandt(padded(model, k)?),
        other => return Err(value_error(format!("unknown distortion model '{other}'"))),
    })
}
