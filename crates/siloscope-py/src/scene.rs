//! Synthetic scenes and their measures.

use crate::convert;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope_scene::feed::{Base, Lumps, Shape};
use siloscope_scene::rooms::{Noise, Room, Sphere};
use siloscope_scene::{
    Bar, Bend, Bottom, Bundle, Corrugation, Courses, Dent, Exact, Feed, Film, Rathole, Relief, Seams, Sensor, Silo,
    SiloWorld, Wall, World,
};

type Frame<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<u8>>, Bound<'py, PyArray2<f64>>);
type Reading<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>);
type Laws<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Exact depth (H*W,), labels (H*W,) and normals (H*W, 3) of a `siloscope.simulation.Scene`.
#[pyfunction]
fn render_scene<'py>(py: Python<'py>, scene: &Bound<'py, PyAny>, threads: usize) -> PyResult<Frame<'py>> {
    let world = world(scene)?;
    let camera = convert::camera(&scene.getattr("camera")?)?;
    let pose = pose(&scene.getattr("pose")?)?;
    let exact = py.detach(|| siloscope_scene::render(world.as_ref(), &camera, &pose, threads));
    let Exact { depth, labels, normals } = exact.map_err(convert::value_error)?;
    let count = normals.len();
    let normals = PyArray1::from_vec(py, normals.into_iter().flatten().collect()).reshape([count, 3])?;
    Ok((PyArray1::from_vec(py, depth), PyArray1::from_vec(py, labels), normals))
}

/// Depth (H*W,) as a `siloscope.simulation.SensorModel` gives it, and which pixels are false returns.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn measure_depth<'py>(
    py: Python<'py>,
    sensor: &Bound<'py, PyAny>,
    camera: &Bound<'py, PyAny>,
    depth: PyReadonlyArray1<'py, f64>,
    labels: PyReadonlyArray1<'py, u8>,
    normals: PyReadonlyArray2<'py, f64>,
    seed: u64,
    threads: usize,
) -> PyResult<Reading<'py>> {
    let sensor = self::sensor(sensor)?;
    let camera = convert::camera(camera)?;
    let normals = normals.as_array();
    if normals.ncols() != 3 || normals.nrows() != depth.as_array().len() {
        return Err(convert::value_error("normals must have the shape (number of depths, 3)"));
    }
    let exact = Exact {
        depth: depth.as_array().to_vec(),
        labels: labels.as_array().to_vec(),
        normals: normals.rows().into_iter().map(|n| [n[0], n[1], n[2]]).collect(),
    };
    let measured = py.detach(|| sensor.measure(&exact, &camera, seed, threads)).map_err(convert::value_error)?;
    Ok((PyArray1::from_vec(py, measured.depth), PyArray1::from_vec(py, measured.false_returns)))
}

/// Bias and standard deviation (metres) of a sensor model at true depths.
#[pyfunction]
fn sensor_laws<'py>(
    py: Python<'py>,
    sensor: &Bound<'py, PyAny>,
    depth: PyReadonlyArray1<'py, f64>,
) -> PyResult<Laws<'py>> {
    let sensor = self::sensor(sensor)?;
    sensor.validate().map_err(convert::value_error)?;
    let (bias, sigma) = depth.as_array().iter().map(|&d| (sensor.bias_at(d), sensor.sigma_at(d))).unzip();
    Ok((PyArray1::from_vec(py, bias), PyArray1::from_vec(py, sigma)))
}

/// Volume, surface area seen from above, and mean, highest and lowest height of a scene's feed; None without feed.
#[pyfunction]
fn feed_content(py: Python<'_>, silo: &Bound<'_, PyAny>, feed: &Bound<'_, PyAny>) -> PyResult<Option<[f64; 5]>> {
    let silo = self::silo(silo)?;
    let Some(feed) = self::feed(feed, &silo)? else { return Ok(None) };
    let c = py.detach(|| siloscope_scene::volume::content(&feed));
    Ok(Some([c.volume, c.area, c.mean_height, c.max_height, c.min_height]))
}

/// Heights of the feed surface over the vertex at places (N, 2); NaN where the cone lies higher or outside the silo.
#[pyfunction]
fn feed_heights<'py>(
    py: Python<'py>,
    silo: &Bound<'py, PyAny>,
    feed: &Bound<'py, PyAny>,
    places: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let silo = self::silo(silo)?;
    let feed = self::feed(feed, &silo)?;
    if places.as_array().ncols() != 2 {
        return Err(convert::value_error("places must have the shape (number of places, 2)"));
    }
    let wall = |x: f64, y: f64| match x.hypot(y) {
        0.0 => silo.floor_height(0.0, (1.0, 0.0)),
        r if r <= silo.radius => silo.floor_height(r, (x / r, y / r)),
        _ => f64::INFINITY,
    };
    let height = |x: f64, y: f64| {
        let surface = feed.as_ref().map_or(f64::NAN, |feed| feed.height(x, y));
        if surface > wall(x, y) { surface } else { f64::NAN }
    };
    let heights = places.as_array().rows().into_iter().map(|p| height(p[0], p[1])).collect();
    Ok(PyArray1::from_vec(py, heights))
}

/// Volume of cylinder and bottom down to the vertex, m³.
#[pyfunction]
fn silo_capacity(silo: &Bound<'_, PyAny>) -> PyResult<f64> {
    self::silo(silo).map(|silo| silo.capacity())
}

/// Raises `ValueError` naming the field where a silo or its feed can't be.
#[pyfunction]
fn check_silo(silo: &Bound<'_, PyAny>) -> PyResult<()> {
    self::silo(silo).map(|_| ())
}

/// Raises `ValueError` naming the field where a sensor model can't be used.
#[pyfunction]
fn check_sensor(sensor: &Bound<'_, PyAny>) -> PyResult<()> {
    self::sensor(sensor)?.validate().map_err(convert::value_error)
}

/// Distance (N,) from each query (N, 3) to the nearest reference point (M, 3).
#[pyfunction]
#[pyo3(signature = (queries, reference, threads=1))]
fn nearest_distances<'py>(
    py: Python<'py>,
    queries: PyReadonlyArray2<'py, f64>,
    reference: PyReadonlyArray2<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (queries, reference) = (points(&queries)?, points(&reference)?);
    let distances = py.detach(|| siloscope::nearest_distances(&queries, &reference, threads));
    Ok(PyArray1::from_vec(py, distances.map_err(convert::value_error)?))
}

fn points(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    let array = array.as_array();
    if array.ncols() != 3 {
        return Err(convert::value_error(format!("points must have the shape (N, 3), got {:?}", array.shape())));
    }
    Ok(array.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect())
}

fn number(object: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    object.getattr(name)?.extract().map_err(|_| convert::value_error(format!("{name} must be a number")))
}

fn numbers<const N: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<[f64; N]> {
    object.getattr(name)?.extract().map_err(|_| convert::value_error(format!("{name} must be {N} numbers")))
}

fn pose(object: &Bound<'_, PyAny>) -> PyResult<siloscope::SiloPose> {
    Ok(siloscope::SiloPose {
        r_x: number(object, "r_x")?,
        r_y: number(object, "r_y")?,
        t_x: number(object, "t_x")?,
        t_y: number(object, "t_y")?,
    })
}

fn world(scene: &Bound<'_, PyAny>) -> PyResult<Box<dyn World>> {
    let silo = silo(&scene.getattr("silo")?)?;
    let (half, bottom, apex) = (silo.radius, silo.bottom(), silo.apex());
    let kind: String = scene.getattr("world")?.extract()?;
    Ok(match kind.as_str() {
        "silo" => Box::new(silo_world(scene, silo)?),
        "wall" => Box::new(Room::wall(apex)),
        "corner" => Box::new(Room::corner(half, apex)),
        "shaft" => Box::new(Room::shaft(half, bottom, apex)),
        "sphere" => Box::new(Sphere { centre: Vec3::z() * (0.45 * apex), radius: 0.55 * apex }),
        "noise" => Box::new(Noise { near: 0.1 * apex, far: apex, seed: seed(scene, "seed")? }),
        "nothing" => Box::new(Room::default()),
        other => return Err(convert::value_error(format!("unknown world '{other}'"))),
    })
}

fn silo_world(scene: &Bound<'_, PyAny>, silo: Silo) -> PyResult<SiloWorld> {
    let feed = feed(&scene.getattr("feed")?, &silo)?;
    let defects = scene.getattr("defects")?;
    if defects.is_none() {
        let relief = Relief { courses: steps(&silo), ..even(&silo) };
        let stepped = !relief.courses.0.is_empty();
        let wall = stepped.then(|| Wall::new(&silo, relief, 0.0, 0.0)).transpose().map_err(convert::value_error)?;
        return Ok(SiloWorld { silo, wall, feed, clutter: vec![] });
    }
    let plan = defects.call_method1("resolved", (scene.getattr("silo")?,))?;
    Ok(SiloWorld { wall: wall(&plan, &silo)?, clutter: clutter(&plan)?, silo, feed })
}

/// Reads the wall of a resolved `siloscope.simulation.Defects`; None where it is perfect.
fn wall(plan: &Bound<'_, PyAny>, silo: &Silo) -> PyResult<Option<Wall>> {
    let relief = Relief {
        courses: steps(silo),
        bend: bend(plan)?,
        corrugation: corrugation(plan)?,
        seams: seams(plan)?,
        dents: dents(plan)?,
        films: films(plan)?,
        ..even(silo)
    };
    let ovality = number(plan, "ovality")?;
    if relief.is_flat() && ovality == 0.0 {
        return Ok(None);
    }
    let wall = Wall::new(silo, relief, ovality, number(plan, "ovality_azimuth")?);
    wall.map(Some).map_err(convert::value_error)
}

/// An even wall of the silo's lengths.
fn even(silo: &Silo) -> Relief {
    Relief { radius: silo.radius, bottom: silo.bottom(), top: silo.top, ..Relief::default() }
}

/// The silo's courses as steps of its wall.
fn steps(silo: &Silo) -> Courses {
    Courses(silo.courses.iter().map(|[end, radius]| [silo.top + end, radius - silo.radius]).collect())
}

fn bend(plan: &Bound<'_, PyAny>) -> PyResult<Option<Bend>> {
    let bend = Bend { depth: number(plan, "bend")?, azimuth: number(plan, "bend_azimuth")? };
    Ok((bend.depth != 0.0).then_some(bend))
}

fn corrugation(plan: &Bound<'_, PyAny>) -> PyResult<Option<Corrugation>> {
    let depth = number(plan, "corrugation_depth")?;
    let pitch = number(plan, "corrugation_pitch")?;
    Ok((depth != 0.0).then_some(Corrugation { pitch, depth }))
}

fn seams(plan: &Bound<'_, PyAny>) -> PyResult<Option<Seams>> {
    let seams = Seams {
        spacing: number(plan, "seam_spacing")?,
        uprights: whole(plan, "upright_seams")?,
        height: number(plan, "seam_height")?,
        half_width: 0.5 * number(plan, "seam_width")?,
        bolts: whole(plan, "bolts")?,
        bolt_height: number(plan, "bolt_height")?,
        bolt_radius: number(plan, "bolt_radius")?,
    };
    Ok((seams.spacing != 0.0 || seams.uprights > 0).then_some(seams))
}

fn dents(plan: &Bound<'_, PyAny>) -> PyResult<Vec<Dent>> {
    let rows: Vec<[f64; 4]> = plan.getattr("dents")?.extract()?;
    Ok(rows.into_iter().map(|[azimuth, z, radius, height]| Dent { azimuth, z, radius, height }).collect())
}

fn films(plan: &Bound<'_, PyAny>) -> PyResult<Vec<Film>> {
    let rows: Vec<[f64; 3]> = plan.getattr("film_bands")?.extract()?;
    let (lobes, azimuth) = (whole(plan, "film_lobes")?, number(plan, "film_azimuth")?);
    Ok(rows.into_iter().map(|[from, to, thickness]| Film { from, to, thickness, lobes, azimuth }).collect())
}

/// Bundles of bars, each `(x, y, z, x, y, z, radius)`.
fn clutter(plan: &Bound<'_, PyAny>) -> PyResult<Vec<Bundle>> {
    let bundles: Vec<Vec<[f64; 7]>> = plan.getattr("bundles")?.extract()?;
    let bar = |[a, b, c, d, e, f, radius]: [f64; 7]| Bar { from: Vec3::new(a, b, c), to: Vec3::new(d, e, f), radius };
    let bundle = |bars: Vec<[f64; 7]>| Bundle::new(bars.into_iter().map(bar).collect());
    bundles.into_iter().map(bundle).collect::<Result<_, _>>().map_err(convert::value_error)
}

fn seed(object: &Bound<'_, PyAny>, name: &str) -> PyResult<u64> {
    let message = || convert::value_error(format!("{name} must be a whole number between 0 and 2^64 - 1"));
    object.getattr(name)?.extract().map_err(|_| message())
}

fn whole(object: &Bound<'_, PyAny>, name: &str) -> PyResult<u32> {
    object.getattr(name)?.extract().map_err(|_| convert::value_error(format!("{name} must be a whole number")))
}

fn silo(object: &Bound<'_, PyAny>) -> PyResult<Silo> {
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
fn feed(object: &Bound<'_, PyAny>, silo: &Silo) -> PyResult<Option<Feed>> {
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

fn sensor(object: &Bound<'_, PyAny>) -> PyResult<Sensor> {
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

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(render_scene, m)?)?;
    m.add_function(wrap_pyfunction!(measure_depth, m)?)?;
    m.add_function(wrap_pyfunction!(sensor_laws, m)?)?;
    m.add_function(wrap_pyfunction!(feed_content, m)?)?;
    m.add_function(wrap_pyfunction!(feed_heights, m)?)?;
    m.add_function(wrap_pyfunction!(silo_capacity, m)?)?;
    m.add_function(wrap_pyfunction!(nearest_distances, m)?)?;
    m.add_function(wrap_pyfunction!(check_silo, m)?)?;
    m.add_function(wrap_pyfunction!(check_sensor, m)?)
}
