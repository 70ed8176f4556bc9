//! The six steps from a depth frame to the silo's axis (section 2.3). Read this page first.

use crate::axis::{self, Wall};
use crate::backproject::DepthImage;
use crate::candidates::{self, View};
use crate::grid::{self, Cloud};
use crate::neighbours::nearest_neighbours;
use crate::normals::normals;
use crate::shape_tensor::shape_tensors;
use crate::workers::Workers;
use crate::{Result, SiloPose, Vec3};
use std::time::Instant;

/// Settings of the six steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Side of the voxels, metres.
    pub grid: f64,
    /// Neighbours k of normals and shape tensors.
    pub neighbours: usize,
    /// Share of the points kept as candidates.
    pub share: f64,
    /// Robust standard deviations by which a candidate's E1 may be off; infinite to keep all.
    pub agreement: f64,
    /// Partners s of each candidate in step 5.
    pub partners: usize,
    /// From which side the walls are seen.
    pub view: View,
    /// Threads.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { grid: 0.05, neighbours: 30, share: 0.5, agreement: 2.0, partners: 50, view: View::Inside, threads: 1 }
    }
}

/// Pose of a silo in one frame.
pub fn locate_in_image(image: &DepthImage, settings: &Settings) -> Result<(Option<SiloPose>, Vec<f64>)> {
    let workers = Workers::new(settings.threads);
    let start = Instant::now();
    let cloud = grid::voxel_grid_of_image(image, settings.grid, &workers)?;
    let t0 = start.elapsed().as_secs_f64() * 1e3;
    let (pose, mut t) = locate_in_cloud(&cloud, settings, &workers)?;
    t.insert(0, t0);
    t.push(cloud.points.len() as f64);
    Ok((pose, t))
}

fn locate_in_cloud(cloud: &Cloud, settings: &Settings, workers: &Workers) -> Result<(Option<SiloPose>, Vec<f64>)> {
    let mut times = Vec::new();
    let mut last = Instant::now();
    let mut lap = || {
        times.push(last.elapsed().as_secs_f64() * 1e3);
        last = Instant::now();
    };
    let points = &cloud.points;
    let near = nearest_neighbours(points, settings.neighbours, workers)?;
    lap();
    let normal = normals(points, &near, workers);
    lap();
    let tensors = shape_tensors(points, &near, &normal, workers);
    lap();
    let candidates = candidates::select_candidates(points, &tensors, settings.share, settings.view);
    lap();
    let (direction, kept) = axis::consistent_direction(&candidates, settings.agreement);
    lap();
    let walls: Vec<Wall> = kept.iter().map(|c| Wall { p: points[c.index], normal: normal[c.index] }).collect();
    let estimates = axis::axis_points(&walls, &direction.x, settings.partners, workers);
    let a = axis::axis_point(&estimates);
    lap();
    let turn = SiloPose::from_axis(&direction.x, &Vec3::zeros()).rotation();
    let a = a.map(|a| turn.transpose() * Vec3::new(a.x, a.y, 0.0));
    let pose = a.map(|a: Vec3| SiloPose::from_axis(&direction.x, &a));
    Ok((pose, times))
}
