//! Reads silo, feed, camera pose and sensor model of a scene.

use super::fields::{number, numbers, seed};
use crate::convert;
use pyo3::prelude::*;
use siloscope_scene::feed_shape::{Base, Lumps, Shape};
use siloscope_scene::{Bottom, Feed, Rathole, Sensor, Silo};

pub fn pose(object: &Bound<'_, PyAny>) -> PyResult<siloscope::SiloPose> {
    Ok(siloscope::SiloPose {
        r_x: number(object, "r_x")?,
        r_y: number(object, "r_y")?,
        t_x: number(object, "t_x")?,
        t_y: number(object, "t_y")?,
    })
}

pub fn silo(object: &Bound<'_, PyAny>) -> PyResult<Silo> {
    let silo = Silo {
        radius: number(object, "radius")?,
        cylinder_height: number(object, "cylinder_height")?,
        cone_height: number(object, "cone_height")?,
        top: number(object, "top")?,
        floor: floor(object)?,
        courses: courses(object)?,
        roof: object.getattr("roof")?.extract()?,
        roof_height: number(object, "roof_height")?,
        outlet_radius: number(object, "outlet_radius")?,
        outlet_length: number(object, "outlet_length")?,
        outlet_offset: numbers(object, "outlet_offset")?,
    };
    silo.validate().map_err(convert::value_error)?;
    Ok(silo)
}

fn floor(object: &Bound<'_, PyAny>) -> PyResult<Bottom> {
    let kind: String = object.getattr("bottom")?.extract()?;
    Ok(match kind.as_str() {
        "cone" => Bottom::Cone,
        "oblique" => Bottom::Oblique,
        "two-stage" => {
            Bottom::TwoStage { waist: number(object, "waist_radius")?, depth: number(object, "waist_depth")? }
        }
        "pyramid" => Bottom::Pyramid { azimuth: number(object, "bottom_azimuth")? },
        "flat" => Bottom::Flat,
        other => {
            let message = format!("unknown bottom '{other}'; known are cone, oblique, two-stage, pyramid, flat");
            return Err(convert::value_error(message));
        }
    })
}

/// Rows (distance of the lower edge from the top edge, radius).
fn courses(object: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 2]>> {
    let rows = object.getattr("courses")?.extract();
    rows.map_err(|_| {
        convert::value_error("courses must be pairs: distance of the lower edge from the top edge, radius")
    })
}

/// Reads a `siloscope.simulation.Feed`; its `resolved` numbers have no None left.
pub fn feed(object: &Bound<'_, PyAny>, silo: &Silo) -> PyResult<Option<Feed>> {
    if object.is_none() {
        return Ok(None);
    }
    let plan = object.call_method1("resolved", (silo.radius,))?;
    let base: String = plan.getattr("base")?.extract()?;
    let tangent = slope(&plan, "angle")?;
    let shape = Shape {
        radius: silo.radius,
        base: match base.as_str() {
            "gaussian" => Base::Gaussian,
            "funnel" => Base::Conical(tangent, number(&plan, "tip")?),
            "crater" => Base::Crater(
                tangent,
                number(&plan, "tip")?,
                number(&plan, "crater_depth")?,
                0.2 * number(&plan, "tip")?,
            ),
            "mound" => Base::Conical(-tangent, number(&plan, "tip")?),
            _ => Base::Flat,
        },
        centre: numbers(&plan, "centre")?,
        tilt: tilt(slope(&plan, "tilt")?, number(&plan, "tilt_azimuth")?),
        lumps: lumps(&plan, silo.radius)?,
        ratholes: ratholes(&plan)?,
    };
    Feed::fill(silo, shape, number(&plan, "level")?).map(Some).map_err(convert::value_error)
}

/// Tangent of an angle between horizontal and nearly vertical.
fn slope(plan: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    let angle = number(plan, name)?;
    if (0.0..=1.47).contains(&angle) {
        return Ok(angle.tan());
    }
    Err(convert::value_error(format!("{name} must be between 0 and 1.47 rad, got {angle}")))
}

fn tilt(slope: f64, azimuth: f64) -> [f64; 2] {
    [slope * azimuth.cos(), slope * azimuth.sin()]
}

fn lumps(plan: &Bound<'_, PyAny>, radius: f64) -> PyResult<Option<Lumps>> {
    let height = number(plan, "lump_height")?;
    if height == 0.0 {
        return Ok(None);
    }
    let seed = seed(plan, "seed")?;
    Lumps::new(height, number(plan, "lump_size")?, radius, seed).map(Some).map_err(convert::value_error)
}

fn ratholes(plan: &Bound<'_, PyAny>) -> PyResult<Vec<Rathole>> {
    let hole = Rathole {
        centre: numbers(plan, "rathole_centre")?,
        radius: number(plan, "rathole_radius")?,
        depth: number(plan, "rathole_depth")?,
    };
    Ok(if hole.depth == 0.0 { vec![] } else { vec![hole] })
}

pub fn sensor(object: &Bound<'_, PyAny>) -> PyResult<Sensor> {
    Ok(Sensor {
        bias: numbers(object, "bias")?,
        noise: numbers(object, "noise")?,
        noise_scale: number(object, "noise_scale")?,
        noise_power: number(object, "noise_power")?,
        noise_floor: number(object, "noise_floor")?,
        incidence_gain: number(object, "incidence_gain")?,
        correlation: number(object, "correlation")?,
        correlation_length: number(object, "correlation_length")?,
        warp: number(object, "warp")?,
        warp_length: number(object, "warp_length")?,
        warp_seed: seed(object, "warp_seed")?,
        bowl: number(object, "bowl")?,
        multipath: number(object, "multipath")?,
        min_range: number(object, "min_range")?,
        max_range: number(object, "max_range")?,
        max_incidence: number(object, "max_incidence")?,
        dropout: number(object, "dropout")?,
        dropout_length: number(object, "dropout_length")?,
        baseline: number(object, "baseline")?,
        flying: number(object, "flying")?,
        flying_step: number(object, "flying_step")?,
        dust: number(object, "dust")?,
        unit: number(object, "unit")?,
    })
}
