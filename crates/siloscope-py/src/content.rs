//! Content: surface map and volume.

use crate::convert::{self, value_error};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use siloscope::content::doubt::Covariance;
use siloscope::content::measure::{Content, Setup, measure};
use siloscope::content::returns::{Rays, Source};
use siloscope::content::vessel::Vessel;
use siloscope::SiloPose;
use siloscope::sensor::{DepthBias, NoiseLaw};

fn vessel([radius, cylinder_bottom, apex, top, outlet_radius, outlet_length]: [f64; 6]) -> Vessel {
    Vessel { radius, cylinder_bottom, apex, top, outlet_radius, outlet_length }
}

#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn measure_content<'py>(
    py: Python<'py>,
    depth: PyReadonlyArrayDyn<'py, f32>,
    camera: Option<&Bound<'py, PyAny>>,
    pose: [f64; 4],
    silo: [f64; 6],
    covariance: PyReadonlyArray2<'py, f64>,
    wall_std: f64,
    bias: [f64; 3],
    noise: [f64; 3],
) -> PyResult<Bound<'py, PyDict>> {
    let camera = camera.map(convert::camera).transpose()?;
    let covariance = Covariance::from_iterator(covariance.as_array().iter().copied());
    let [r_x, r_y, t_x, t_y] = pose;
    let setup = Setup { pose: SiloPose { r_x, r_y, t_x, t_y }, vessel: vessel(silo), covariance, wall_std,
        bias: DepthBias { offset: bias[0], scale: bias[1], quadratic: bias[2] },
        noise: NoiseLaw { floor: 0.0, constant: noise[0], linear: noise[1], quadratic: noise[2], power_factor: 0.0, power: 1.0 } };
    let depth = depth.as_slice()?;
    let content = py.detach(|| match &camera {
        Some(c) => {
            let columns: Vec<f32> = (0..c.width).map(|u| c.ray(u as f64, c.cy)[0] as f32).collect();
            let rows: Vec<f32> = (0..c.height).map(|v| c.ray(c.cx, v as f64)[1] as f32).collect();
            measure(Source::Depth(depth, Rays::Pinhole(&columns, &rows)), &setup)
        }
        None => measure(Source::Points(depth.as_chunks::<3>().0), &setup),
    });
    report(py, &content.map_err(value_error)?)
}

fn report<'py>(py: Python<'py>, content: &Content) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let n = content.grid.side;
    let heights = |f: &dyn Fn(usize) -> f64| {
        PyArray1::from_vec(py, (0..content.grid.len()).map(f).collect()).reshape([n, n])
    };
    out.set_item("reach", content.grid.reach)?;
    out.set_item("kinds", PyArray1::from_vec(py, content.kinds.iter().map(|k| *k as u8).collect()).reshape([n, n])?)?;
    out.set_item("z_cell", heights(&|i| content.cells[i].mean[2])?)?;
    out.set_item("count", heights(&|i| content.cells[i].count)?)?;
    if let (Some(s), Some(v)) = (&content.surface, &content.volume) {
        let at = |i: usize| content.grid.middle(i);
        out.set_item("z", heights(&|i| s.height(at(i)[0], at(i)[1]))?)?;
        out.set_item("volume", v.volume)?;
        out.set_item("area", v.area)?;
        out.set_item("seen", v.seen)?;
        out.set_item("roughness", s.roughness)?;
        out.set_item("patch", s.patch)?;
    }
    let d = &content.doubts;
    for (name, value) in [
        ("pose", d.pose), ("geometry", d.geometry), ("depth", d.depth), ("noise", d.noise), ("unseen", d.unseen),
        ("grid", d.grid), ("total", d.total),
    ] {
        out.set_item(format!("std_{name}"), value)?;
    }
    out.set_item("derivatives", content.derivatives.as_slice().to_vec())?;
    out.set_item("things", content.things.iter().map(|t| (t.cells.len(), t.above, t.at_wall)).collect::<Vec<_>>())?;
    let t = &content.tally;
    out.set_item("tally", [t.returns, t.wall, t.outside, t.above, t.coherent])?;
    Ok(out)
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(measure_content, m)?)
}
