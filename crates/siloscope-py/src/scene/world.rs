//! Reads a `siloscope.simulation.Scene`: what is seen, and how its wall differs from the ideal one.

use super::fields::{number, seed, whole};
use super::silo::{feed, silo};
use crate::convert;
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope_scene::rooms::{Noise, Room, Sphere};
use siloscope_scene::{
    Bar, Bend, Bundle, Corrugation, Courses, Dent, Film, Relief, Seams, Silo, SiloWorld, Wall, World,
};

pub fn world(scene: &Bound<'_, PyAny>) -> PyResult<Box<dyn World>> {
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
