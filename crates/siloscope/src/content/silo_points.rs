//! The frame's returns as points in the silo frame, a line of pixels at a time.
//!
//! Plain loops over short slices: the compiler makes vector code of them, and half of a frame's time is spent here.

use crate::SiloPose;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::sensor::DepthBias;

/// What a frame is made of.
#[derive(Debug, Clone, Copy)]
pub enum Source<'a> {
    /// A depth image.
    Depth(DepthImage<'a>),
    /// Points in the camera frame, in metres.
    Points(&'a [[f32; 3]]),
}

/// A frame whose depths are corrected for the sensor's bias and moved into the silo frame.
#[derive(Debug)]
pub struct SiloPoints<'a> {
    source: Source<'a>,
    /// x/z of each column and y/z of each row of a depth image without distortion.
    axes: Option<[Vec<f32>; 2]>,
    bias: DepthBias,
    rotation: [[f32; 3]; 3],
    translation: [f32; 2],
    ovality: [f32; 2],
}

/// Points of one line of pixels in the silo frame. A depth of 0 is no measurement.
#[derive(Debug, Default)]
pub struct ScanLine {
    /// x of each point.
    pub x: Vec<f32>,
    /// y of each point.
    pub y: Vec<f32>,
    /// z of each point.
    pub z: Vec<f32>,
    /// True depth of each point.
    pub depth: Vec<f32>,
    rays: [Vec<f32>; 2],
    /// For each axis of the silo frame, what a pinhole's columns and the line's row add to the point at depth 1.
    along: [Vec<f32>; 3],
    row: Option<[f32; 3]>,
}

impl ScanLine {
    fn resize(&mut self, len: usize) {
        let [a, b] = &mut self.rays;
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.depth, a, b] {
            column.resize(len, 0.0);
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.depth.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.depth.is_empty()
    }
}

/// Points that are taken as one line.
const CHUNK: usize = 640;

impl<'a> SiloPoints<'a> {
    /// Puts a frame into the silo frame by the camera's pose.
    ///
    /// In an oval silo (`ovality` c, s) x and y are divided by 1 + c cos 2φ + s sin 2φ, which makes its wall round.
    pub fn new(source: Source<'a>, bias: DepthBias, pose: &SiloPose, ovality: [f64; 2]) -> Self {
        let axes = if let Source::Depth(image) = source { image.axes() } else { None };
        let single = |axis: Vec<f64>| axis.into_iter().map(|x| x as f32).collect();
        let axes = axes.map(|(columns, rows)| [single(columns), single(rows)]);
        let r = pose.rotation();
        let rotation = [0, 1, 2].map(|row| [0, 1, 2].map(|column| r[(row, column)] as f32));
        let translation = [pose.t_x as f32, pose.t_y as f32];
        Self { source, axes, bias, rotation, translation, ovality: ovality.map(|o| o as f32) }
    }

    /// Number of pixels or points, measured or not.
    pub fn len(&self) -> usize {
        match self.source {
            Source::Depth(image) => image.depth.len(),
            Source::Points(points) => points.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Calls `see` for every `stride`-th line, with every `stride`-th pixel of it.
    pub fn visit(&self, stride: usize, mut see: impl FnMut(&ScanLine)) {
        let stride = stride.max(1);
        let mut line = ScanLine::default();
        let mut finish = |line: &mut ScanLine| {
            self.place(line);
            see(line);
        };
        match self.source {
            Source::Points(points) => {
                for chunk in points.chunks(CHUNK).step_by(stride) {
                    line.resize(chunk.len().div_ceil(stride));
                    load_points(&mut line, chunk.iter().step_by(stride));
                    finish(&mut line);
                }
            }
            Source::Depth(image) => {
                line.resize(image.width.div_ceil(stride));
                if let Some([columns, _]) = &self.axes {
                    for (along, [a, _, _]) in line.along.iter_mut().zip(self.rotation) {
                        *along = columns.iter().step_by(stride).map(|u| a * u).collect();
                    }
                }
                for (v, row) in image.depth.chunks_exact(image.width.max(1)).enumerate().step_by(stride) {
                    copy(&mut line.depth, row, stride);
                    if let Some([_, rows]) = &self.axes {
                        line.row = Some(self.rotation.map(|[_, b, _]| b * rows[v]));
                    } else {
                        let rays = image.rays_of_row(v).unwrap_or_default();
                        load_rays(&mut line, rays.iter().step_by(stride));
                    }
                    finish(&mut line);
                }
            }
        }
    }

    /// Calls `see` for the true depths of every `stride`-th line, of every `stride`-th pixel of it; points as they are.
    pub fn visit_depths(&self, stride: usize, mut see: impl FnMut(&[f32])) {
        let Source::Depth(image) = self.source else { return self.visit(stride, |line| see(&line.depth)) };
        let mut depth = vec![0.0; image.width.div_ceil(stride)];
        for row in image.depth.chunks_exact(image.width.max(1)).step_by(stride) {
            copy(&mut depth, row, stride);
            self.correct(&mut depth);
            see(&depth);
        }
    }

    /// From measured depths and rays to true depths and points.
    fn place(&self, line: &mut ScanLine) {
        self.correct(&mut line.depth);
        let [tx, ty] = self.translation;
        let shifts = [tx, ty, 0.0];
        let outs = [&mut line.x, &mut line.y, &mut line.z];
        for (k, out) in outs.into_iter().enumerate() {
            let ([a, b, c], shift) = (self.rotation[k], shifts[k]);
            if let Some(row) = line.row {
                for ((out, &d), &au) in out.iter_mut().zip(&line.depth).zip(&line.along[k]) {
                    *out = d * (au + row[k] + c) + shift;
                }
            } else {
                let [rx, ry] = &line.rays;
                for (((out, &d), &u), &v) in out.iter_mut().zip(&line.depth).zip(rx).zip(ry) {
                    *out = d * (a * u + b * v + c) + shift;
                }
            }
        }
        self.round(line);
    }

    /// Makes an oval silo round: cos 2φ = (x² - y²)/r², sin 2φ = 2xy/r².
    fn round(&self, line: &mut ScanLine) {
        let [c, s] = self.ovality;
        if c == 0.0 && s == 0.0 {
            return;
        }
        for (x, y) in line.x.iter_mut().zip(&mut line.y) {
            let (square, across) = (*x * *x - *y * *y, 2.0 * *x * *y);
            let oval = 1.0 + (c * square + s * across) / (*x * *x + *y * *y).max(1e-12);
            (*x, *y) = (*x / oval, *y / oval);
        }
    }

    /// Undoes the sensor's bias; whatever is no depth becomes 0.
    fn correct(&self, depth: &mut [f32]) {
        let linear = 1.0 + self.bias.scale as f32;
        let (offset, quadratic) = (self.bias.offset as f32, 4.0 * self.bias.quadratic as f32);
        for d in depth {
            let rest = *d - offset;
            let depth = 2.0 * rest / (linear + (linear * linear + quadratic * rest).sqrt());
            *d = if *d > 0.0 && depth > 0.0 && depth < f32::INFINITY { depth } else { 0.0 };
        }
    }
}

fn copy(to: &mut [f32], from: &[f32], stride: usize) {
    if stride == 1 {
        to.copy_from_slice(from);
    } else {
        to.iter_mut().zip(from.iter().step_by(stride)).for_each(|(to, from)| *to = *from);
    }
}

fn load_rays<'r>(line: &mut ScanLine, rays: impl Iterator<Item = &'r [f64; 2]>) {
    let [x, y] = &mut line.rays;
    for ((x, y), ray) in x.iter_mut().zip(y).zip(rays) {
        (*x, *y) = (ray[0] as f32, ray[1] as f32);
    }
}

fn load_points<'p>(line: &mut ScanLine, points: impl Iterator<Item = &'p [f32; 3]>) {
    let [x, y] = &mut line.rays;
    for (((x, y), depth), &[px, py, pz]) in x.iter_mut().zip(y).zip(&mut line.depth).zip(points) {
        let measured = pz > 0.0 && px.is_finite() && py.is_finite();
        (*x, *y, *depth) = if measured { (px / pz, py / pz, pz) } else { (0.0, 0.0, 0.0) };
    }
}

#[cfg(test)]
#[allow(clippy::panic)]
mod tests {
    use super::*;
    use crate::{Camera, Distortion, Vec3};
    use proptest::prelude::*;

    const BIAS: DepthBias = DepthBias { offset: 3.4397e-3, scale: -0.017878, quadratic: 2.2093e-2 };
    const POSE: SiloPose = SiloPose { r_x: 0.2, r_y: -0.24, t_x: 0.6, t_y: 0.5 };

    fn all(source: Source<'_>, bias: DepthBias, stride: usize) -> Vec<[f32; 4]> {
        let mut points = Vec::new();
        let returns = SiloPoints::new(source, bias, &POSE, [0.0; 2]);
        returns.visit(stride, |l| (0..l.len()).for_each(|i| points.push([l.x[i], l.y[i], l.z[i], l.depth[i]])));
        points
    }

    fn one_pixel<'a>(depth: &'a [f32; 1], ray: &'a [[f64; 2]; 1]) -> Source<'a> {
        Source::Depth(DepthImage::with_rays(depth, ray, 1, 1).unwrap_or_else(|_| panic!("an image")))
    }

    proptest! {
        #[test]
        fn the_bias_is_undone_and_the_point_moved(d in 0.3f64..8.0, x in -0.6f64..0.6, y in -0.5f64..0.5) {
            let measured = [BIAS.measured(d) as f32];
            let found = all(one_pixel(&measured, &[[x, y]]), BIAS, 1)[0];
            let truth = POSE.to_silo(&(Vec3::new(x, y, 1.0) * d));
            for (found, truth) in found.iter().zip([truth.x, truth.y, truth.z, d]) {
                prop_assert!((f64::from(*found) - truth).abs() < 4e-6);
            }
        }
    }

    #[test]
    fn pinholes_rays_and_points_agree() {
        let distortion = Distortion::None;
        let camera = Camera { width: 3, height: 2, fx: 4.0, fy: 5.0, cx: 0.8, cy: -0.5, distortion };
        let (depth, rays) = ([1.0f32, 2.0, 0.0, 4.0, f32::NAN, 2.5], camera.rays());
        let points: Vec<[f32; 3]> =
            depth.iter().zip(&rays).map(|(&d, r)| [d * r[0] as f32, d * r[1] as f32, d]).collect();
        let (Ok(pinhole), Ok(each)) =
            (DepthImage::new(&depth, &camera, None), DepthImage::new(&depth, &camera, Some(&rays)))
        else {
            panic!("an image")
        };
        let grid = all(Source::Depth(pinhole), DepthBias::default(), 1);
        assert_eq!(grid, all(Source::Depth(each), DepthBias::default(), 1));
        let cloud = all(Source::Points(&points), DepthBias::default(), 1);
        assert!(grid.iter().zip(&cloud).all(|(a, b)| (0..4).all(|i| (a[i] - b[i]).abs() < 1e-6)));
        assert_eq!(grid.iter().filter(|p| p[3] > 0.0).count(), 4);
        let coarse = all(Source::Depth(pinhole), DepthBias::default(), 2);
        assert_eq!(coarse, vec![grid[0], grid[2]]);
    }

    #[test]
    fn what_is_no_measurement_has_depth_zero() {
        for measured in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for bias in [DepthBias::default(), BIAS] {
                assert_eq!(all(one_pixel(&[measured], &[[0.0, 0.0]]), bias, 1)[0][3], 0.0);
            }
        }
    }
}
