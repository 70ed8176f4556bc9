//! Frames of a world, exact.

use crate::hit::Label;
use crate::world::World;
pub use siloscope::base::workers::check_threads;
use siloscope::{Camera, Result, SiloPose, Vec3};

/// An exact frame; row by row.
#[derive(Debug, Clone)]
pub struct Exact {
    /// Depth z in the camera frame, 0 where nothing is hit.
    pub depth: Vec<f64>,
    /// What each pixel shows.
    pub labels: Vec<u8>,
    /// Unit normal towards the camera's side, in the camera frame; 0 where nothing is hit.
    pub normals: Vec<[f64; 3]>,
}

/// Casts a ray through every pixel. The camera sits at `(t_x, t_y, 0)` of the silo frame; depths are float64.
pub fn render(world: &dyn World, camera: &Camera, pose: &SiloPose, threads: usize) -> Result<Exact> {
    camera.validate()?;
    check_threads(threads)?;
    check_pose(pose)?;
    let origin = Vec3::new(pose.t_x, pose.t_y, 0.0);
    world.check_camera(&origin)?;
    let pixels = camera.width * camera.height;
    let mut exact = Exact { depth: vec![0.0; pixels], labels: vec![0; pixels], normals: vec![[0.0; 3]; pixels] };
    let rows = camera.height.div_ceil(threads);
    let band = rows * camera.width;
    std::thread::scope(|scope| {
        let parts = exact.depth.chunks_mut(band).zip(exact.labels.chunks_mut(band)).zip(exact.normals.chunks_mut(band));
        for (part, ((depth, labels), normals)) in parts.enumerate() {
            let mut job = move || cast_band(world, camera, pose, part * rows, depth, labels, normals);
            if threads == 1 { job() } else { drop(scope.spawn(job)) }
        }
    });
    Ok(exact)
}

fn cast_band(
    world: &dyn World,
    camera: &Camera,
    pose: &SiloPose,
    first_row: usize,
    depth: &mut [f64],
    labels: &mut [u8],
    normals: &mut [[f64; 3]],
) {
    let rotation = pose.rotation();
    let origin = Vec3::new(pose.t_x, pose.t_y, 0.0);
    for (i, ((depth, label), normal)) in depth.iter_mut().zip(labels).zip(normals).enumerate() {
        let [x, y] = camera.ray((i % camera.width) as f64, (first_row + i / camera.width) as f64);
        let ray = rotation * Vec3::new(x, y, 1.0);
        if let Some(hit) = world.cast(&origin, &ray).filter(|hit| hit.t > 0.0 && hit.label != Label::None) {
            *depth = hit.t;
            *label = hit.label as u8;
            *normal = rotation.tr_mul(&hit.normal).into();
        }
    }
}

fn check_pose(pose: &SiloPose) -> Result<()> {
    use std::f64::consts::PI;
    crate::limits::bounded("r_x", pose.r_x, -PI, PI, "between -π and π rad")?;
    crate::limits::bounded("r_y", pose.r_y, -PI, PI, "between -π and π rad")?;
    crate::limits::bounded("t_x", pose.t_x, -1e3, 1e3, "between -1000 and 1000 m")?;
    crate::limits::bounded("t_y", pose.t_y, -1e3, 1e3, "between -1000 and 1000 m")
}
