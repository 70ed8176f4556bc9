//! The frame's returns as points in the silo frame.

use super::depth::DepthTable;
use crate::{Camera, Distortion, Error, Result, SiloPose};

/// What a frame is made of.
#[derive(Debug, Clone, Copy)]
pub enum Source<'a> {
    /// A depth image in metres, row by row, with its camera.
    Depth(&'a [f32], &'a Camera),
    /// Points in the camera frame, in metres.
    Points(&'a [[f32; 3]]),
}

/// A frame whose depths are corrected by the sensor's profile and moved into the silo frame.
#[derive(Debug)]
pub struct Returns<'a> {
    source: Source<'a>,
    table: &'a DepthTable,
    rays: Rays,
    rotation: [[f64; 3]; 3],
    translation: [f64; 2],
}

/// One return.
#[derive(Debug, Clone, Copy)]
pub struct Return {
    /// Point in the silo frame.
    pub point: [f64; 3],
    /// The ray in the silo frame: how the point moves for each metre of depth.
    pub ray: [f64; 3],
    /// True depth.
    pub depth: f64,
    /// Standard deviation of the depth.
    pub sigma: f64,
}

#[derive(Debug)]
enum Rays {
    /// An ideal pinhole: one number a column and one a row.
    Grid(Vec<f64>, Vec<f64>),
    /// One ray a pixel.
    Each(Vec<[f64; 2]>),
    /// Points carry their own.
    Own,
}

impl<'a> Returns<'a> {
    /// Puts a frame into the silo frame by the camera's pose.
    pub fn new(source: Source<'a>, table: &'a DepthTable, pose: &SiloPose) -> Result<Self> {
        let r = pose.rotation();
        Ok(Self {
            source,
            table,
            rays: rays(source)?,
            rotation: [0, 1, 2].map(|row| [0, 1, 2].map(|column| r[(row, column)])),
            translation: [pose.t_x, pose.t_y],
        })
    }

    /// Number of pixels or points, measured or not.
    pub fn len(&self) -> usize {
        match self.source {
            Source::Depth(depth, _) => depth.len(),
            Source::Points(points) => points.len(),
        }
    }

    /// Calls `see` for every return of every `stride`-th pixel along both sides (or of every `stride²`-th point).
    ///
    /// The visits come row by row; `row` starts a new one.
    #[inline]
    pub fn visit(&self, stride: usize, mut see: impl FnMut(Return)) {
        let stride = stride.max(1);
        match (self.source, &self.rays) {
            (Source::Points(points), _) => {
                for p in points.iter().step_by(stride * stride) {
                    self.see([f64::from(p[0] / p[2]), f64::from(p[1] / p[2])], p[2], &mut see);
                }
            }
            (Source::Depth(depth, camera), Rays::Grid(xs, ys)) => {
                for (row, &y) in depth.chunks_exact(camera.width).zip(ys).step_by(stride) {
                    for (&d, &x) in row.iter().zip(xs).step_by(stride) {
                        self.see([x, y], d, &mut see);
                    }
                }
            }
            (Source::Depth(depth, camera), Rays::Each(rays)) => {
                let rows = depth.chunks_exact(camera.width).zip(rays.chunks_exact(camera.width));
                for (row, rays) in rows.step_by(stride) {
                    for (&d, &ray) in row.iter().zip(rays).step_by(stride) {
                        self.see(ray, d, &mut see);
                    }
                }
            }
            (Source::Depth(..), Rays::Own) => {}
        }
    }

    #[inline]
    fn see(&self, [x, y]: [f64; 2], measured: f32, see: &mut impl FnMut(Return)) {
        let Some((depth, sigma)) = self.table.look_up(measured) else { return };
        let ray = self.rotation.map(|[a, b, c]| a * x + b * y + c);
        let [tx, ty] = self.translation;
        see(Return { point: [depth * ray[0] + tx, depth * ray[1] + ty, depth * ray[2]], ray, depth, sigma });
    }
}

fn rays(source: Source<'_>) -> Result<Rays> {
    let Source::Depth(depth, camera) = source else { return Ok(Rays::Own) };
    camera.validate()?;
    let pixels = camera.width * camera.height;
    if depth.len() != pixels {
        return Err(Error::Shape { what: "depth", got: depth.len(), expected: pixels });
    }
    if camera.distortion != Distortion::None {
        return Ok(Rays::Each(camera.rays()));
    }
    let columns = (0..camera.width).map(|u| camera.ray(u as f64, camera.cy)[0]).collect();
    let rows = (0..camera.height).map(|v| camera.ray(camera.cx, v as f64)[1]).collect();
    Ok(Rays::Grid(columns, rows))
}
