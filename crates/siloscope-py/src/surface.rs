//! The surface fit.

use crate::convert::value_error;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use siloscope::base::refusal::Refusal;
use siloscope::base::workers::Workers;
use siloscope::fusion::frame_factor::FrameFactor;
use siloscope::fusion::relinearize::{Ray, seen_from};
use siloscope::geometry::depth_image::DepthImage;
use siloscope::geometry::parameters::{Information, PARAMETERS, Parameters};
use siloscope::geometry::sensor::{DepthBias, DepthError, NoiseLaw};
use siloscope::geometry::surface::{Cone, SiloSurface};
use siloscope::surface_fit::segmentation::{coverage, label_pixels};
use siloscope::surface_fit::warm_start::KnownWall;
use siloscope::surface_fit::{Knowledge, Outcome, SurfaceFit, fit_cloud, fit_image};
use siloscope::{SiloPose, Vec3};

/// Bias and noise as plain numbers: offset, scale, quadratic; floor, constant, linear, quadratic, factor, power.
type Bias = (f64, f64, f64);
type Noise = (f64, f64, f64, f64, f64, f64);

/// A wall found before: pose, radius, slope and apex of the cone, depth bias, whether it is seen from inside, misfit,
/// whether it is oval.
type Wall = ((f64, f64, f64, f64), Option<f64>, Option<(f64, f64)>, Bias, bool, f64, bool);

fn known_wall((pose, radius, cone, bias, inside, misfit, oval): Wall) -> KnownWall {
    let pose = SiloPose { r_x: pose.0, r_y: pose.1, t_x: pose.2, t_y: pose.3 };
    let cone = cone.map(|(slope, apex)| Cone { slope, apex });
    let bias = DepthBias { offset: bias.0, scale: bias.1, quadratic: bias.2 };
    KnownWall { surface: SiloSurface { pose, radius, cone, ovality: [0.0; 2] }, bias, inside, misfit, oval }
}

fn plain(wall: &KnownWall) -> Wall {
    let KnownWall { surface: SiloSurface { pose, radius, cone, .. }, bias, .. } = *wall;
    let pose = (pose.r_x, pose.r_y, pose.t_x, pose.t_y);
    let bias = (bias.offset, bias.scale, bias.quadratic);
    (pose, radius, cone.map(|c| (c.slope, c.apex)), bias, wall.inside, wall.misfit, wall.oval)
}

fn depth_error(bias: Bias, bias_std: Bias, noise: Option<Noise>) -> DepthError {
    DepthError {
        bias: DepthBias { offset: bias.0, scale: bias.1, quadratic: bias.2 },
        bias_std: [bias_std.0, bias_std.1, bias_std.2],
        noise: noise.map(|n| NoiseLaw {
            floor: n.0,
            constant: n.1,
            linear: n.2,
            quadratic: n.3,
            power_factor: n.4,
            power: n.5,
        }),
    }
}

/// Fits the wall to a depth image: float32 depth (H, W) in metres and float64 rays (H, W, 2).
///
/// Returns a dictionary of plain numbers and arrays; where there is no answer it holds only the reason, as `refusal`.
/// With `labels` it also holds each pixel's label, with `ratios` what each label covers. A `wall` found before is tried
/// first.
#[pyfunction]
#[pyo3(signature = (depth, rays, bias, bias_std, noise=None, radius=None, gravity=None, labels=false, wall=None, ratios=true))]
#[allow(clippy::too_many_arguments)]
fn surface_fit_image<'py>(
    py: Python<'py>,
    depth: PyReadonlyArray2<'py, f32>,
    rays: PyReadonlyArray3<'py, f64>,
    bias: Bias,
    bias_std: Bias,
    noise: Option<Noise>,
    radius: Option<(f64, f64)>,
    gravity: Option<(f64, f64, f64, f64)>,
    labels: bool,
    wall: Option<Wall>,
    ratios: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let (height, width) = (depth.shape()[0], depth.shape()[1]);
    if rays.shape() != [height, width, 2] {
        return Err(value_error(format!("rays have shape {:?}, the depth {:?}", rays.shape(), depth.shape())));
    }
    let depth = depth.as_slice().map_err(value_error)?;
    let rays = rays.as_slice().map_err(value_error)?.as_chunks::<2>().0;
    let know = Knowledge {
        error: depth_error(bias, bias_std, noise),
        radius,
        gravity: gravity.map(|(x, y, z, std)| (Vec3::new(x, y, z), std)),
    };
    let image = DepthImage::with_rays(depth, rays, width, height).map_err(value_error)?;
    let wall = wall.map(known_wall);
    let found = py.detach(|| {
        let found = fit_image(&image, &know, wall.as_ref());
        let labels = found.as_ref().ok().filter(|_| labels).map(|fit| label_pixels(&image, fit));
        let seen = found.as_ref().ok().filter(|_| ratios).map(coverage);
        (found, labels, seen)
    });
    let out = outcome(py, found.0)?;
    if let Some(seen) = found.2 {
        out.set_item("pixel_counts", seen.counts)?;
        out.set_item("areas", seen.areas)?;
    }
    if let Some(labels) = found.1 {
        out.set_item("labels", PyArray1::from_vec(py, labels).reshape([height, width])?)?;
    }
    Ok(out)
}

/// Fits the wall to a cloud: float64 points (N, 3) in metres; rows that aren't finite are left out.
#[pyfunction]
#[pyo3(signature = (points, grid, radius=None, gravity=None, threads=1))]
fn surface_fit_cloud<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    grid: f64,
    radius: Option<(f64, f64)>,
    gravity: Option<(f64, f64, f64, f64)>,
    threads: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let points = points.as_array();
    if points.shape()[1] != 3 {
        return Err(value_error(format!("points have shape {:?}, expected (N, 3)", points.shape())));
    }
    let points: Vec<Vec3> = points.rows().into_iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect();
    let know = Knowledge {
        error: DepthError::unknown(),
        radius,
        gravity: gravity.map(|(x, y, z, std)| (Vec3::new(x, y, z), std)),
    };
    let found = py.detach(|| fit_cloud(&points, grid, &Workers::new(threads), &know)).map_err(value_error)?;
    outcome(py, found)
}

fn outcome(py: Python<'_>, found: Outcome) -> PyResult<Bound<'_, PyDict>> {
    match found {
        Ok(fit) => result(py, &fit),
        Err(refusal) => {
            let out = PyDict::new(py);
            out.set_item("refusal", refusal.slug())?;
            Ok(out)
        }
    }
}

fn add_share(py: Python<'_>, out: &Bound<'_, PyDict>, share: &FrameFactor) -> PyResult<()> {
    for (name, m) in [("information", &share.information), ("scatter", &share.scatter), ("noise_share", &share.noise)] {
        out.set_item(name, matrix(py, m)?)?;
    }
    out.set_item("step", PyArray1::from_slice(py, share.step.as_slice()))?;
    out.set_item("gradient", PyArray1::from_slice(py, share.gradient.as_slice()))?;
    out.set_item("base", PyArray1::from_slice(py, share.base.as_slice()))?;
    out.set_item("rays", PyArray1::from_vec(py, share.rays.concat()).reshape([share.rays.len(), 3])?)?;
    out.set_item("prior", PyArray1::from_slice(py, share.prior.as_slice()))
}

fn matrix<'py>(
    py: Python<'py>,
    m: &siloscope::geometry::parameters::Information,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, m.transpose().as_slice()).reshape([PARAMETERS, PARAMETERS])
}

fn result<'py>(py: Python<'py>, found: &SurfaceFit) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let pose = found.fit.surface.pose;
    out.set_item("pose", (pose.r_x, pose.r_y, pose.t_x, pose.t_y))?;
    out.set_item("radius", found.fit.surface.radius)?;
    out.set_item("cone", found.fit.surface.cone.map(|c| (c.slope, c.intercept())))?;
    out.set_item("ovality", found.fit.surface.ovality)?;
    let bias = found.fit.bias;
    out.set_item("bias", (bias.offset, bias.scale, bias.quadratic))?;
    out.set_item("inside", found.fit.inside)?;
    out.set_item("wall", (!found.patches.cloud).then(|| plain(&found.wall)))?;
    out.set_item("misfit", found.fit.misfit)?;
    out.set_item("chi_square", found.chi_square)?;
    out.set_item("free", found.free.to_vec())?;
    out.set_item("covariance", matrix(py, &found.covariance)?)?;
    add_share(py, &out, &found.share)?;
    let n = found.noise;
    out.set_item("noise", (n.floor, n.constant, n.linear, n.quadratic, n.power_factor, n.power))?;
    let points: Vec<f64> = found.patch_points().into_iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    out.set_item("points", PyArray1::from_vec(py, points).reshape([found.residuals.len(), 3])?)?;
    out.set_item("residuals", PyArray1::from_slice(py, &found.residuals))?;
    let e = found.evidence;
    let evidence = PyDict::new(py);
    evidence.set_item("patches", e.patches)?;
    for (key, value) in [
        ("share", e.share),
        ("turn", e.turn),
        ("turn_std", e.turn_std),
        ("bend", e.bend),
        ("bend_std", e.bend_std),
        ("arc", e.arc),
        ("behind", e.behind),
    ] {
        evidence.set_item(key, value)?;
    }
    out.set_item("evidence", evidence)?;
    out.set_item("timing", found.timing.clone())?;
    Ok(out)
}

type StepsAndTurns<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// Steps (N, 12) and their derivatives (N, 12, 12): what of N frames' equations, made at `bases` (N, 12) with `rays`
/// (N, K, 3) and `free` parameters (N, 12), predicts the readings of the walls at `places` (N, 12).
#[pyfunction]
fn surface_seen_from<'py>(
    py: Python<'py>,
    bases: PyReadonlyArray2<'py, f64>,
    rays: PyReadonlyArray3<'py, f64>,
    free: PyReadonlyArray2<'py, bool>,
    places: PyReadonlyArray2<'py, f64>,
) -> PyResult<StepsAndTurns<'py>> {
    let count = bases.shape()[0];
    let whole = bases.shape()[1] == PARAMETERS && rays.shape()[2] == 3;
    if !whole || rays.shape()[0] != count || free.shape() != bases.shape() || places.shape() != bases.shape() {
        let shapes = (bases.shape(), rays.shape(), free.shape(), places.shape());
        return Err(value_error(format!("bases, rays, free and places have shapes {shapes:?}")));
    }
    let (bases, rays, free, places) = (bases.as_array(), rays.as_array(), free.as_array(), places.as_array());
    let vector = |row: numpy::ndarray::ArrayView1<f64>| Parameters::from_iterator(row.iter().copied());
    let seen: Vec<(Parameters, Information)> = py.detach(|| {
        let frame = |n: usize| {
            let (base, place) = (vector(bases.row(n)), vector(places.row(n)));
            let of_frame: Vec<Ray> = (0..rays.shape()[1]).map(|k| [0, 1, 2].map(|c| rays[(n, k, c)])).collect();
            seen_from(&base, &of_frame, std::array::from_fn(|k| free[(n, k)]), &place)
        };
        (0..count).map(frame).collect()
    });
    let steps: Vec<f64> = seen.iter().flat_map(|(step, _)| step.iter().copied()).collect();
    let turns: Vec<f64> =
        seen.iter().flat_map(|(_, turn)| turn.transpose().iter().copied().collect::<Vec<_>>()).collect();
    let steps = PyArray1::from_vec(py, steps).reshape([count, PARAMETERS])?;
    Ok((steps, PyArray1::from_vec(py, turns).reshape([count, PARAMETERS, PARAMETERS])?))
}

/// Every reason for which the surface fit refuses a frame: stable name, what it means, what to try.
#[pyfunction]
fn surface_refusals() -> Vec<(&'static str, &'static str, &'static str)> {
    Refusal::ALL.into_iter().map(Refusal::row).collect()
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(surface_fit_image, m)?)?;
    m.add_function(wrap_pyfunction!(surface_fit_cloud, m)?)?;
    m.add_function(wrap_pyfunction!(surface_seen_from, m)?)?;
    m.add_function(wrap_pyfunction!(surface_refusals, m)?)
}
