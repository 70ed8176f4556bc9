//! Smooth random fields over the image.

use crate::random::Stream;
use crate::spline::spline;
use siloscope::Camera;

/// A smooth random field over the image: a B-spline over random values on a lattice.
#[derive(Default)]
pub struct Lattice {
    pitch: f64,
    columns: usize,
    values: Vec<f64>,
}

impl Lattice {
    /// Random values of one stream on sites `pitch` pixels apart.
    pub fn new(stream: Stream, pitch: f64, camera: &Camera) -> Self {
        // A spline reaches over four sites.
        let sites = |pixels: usize| (pixels as f64 / pitch) as usize + 4;
        let (columns, rows) = (sites(camera.width), sites(camera.height));
        let site = |i: usize| ((i / columns) as u64) << 32 | (i % columns) as u64;
        let values = (0..columns * rows).map(|i| stream.normal(site(i))).collect();
        Self { pitch, columns, values }
    }

    /// The field at column u and row v, scaled to variance 1 at every pixel.
    pub fn at(&self, u: f64, v: f64) -> f64 {
        let (u, v) = (u / self.pitch, v / self.pitch);
        let (wx, wy) = (spline(u.fract()), spline(v.fract()));
        let (mut sum, mut power) = (0.0, 0.0);
        for (j, wy) in wy.iter().enumerate() {
            let first = (v as usize + j) * self.columns + u as usize;
            for (wx, value) in wx.iter().zip(self.values.iter().skip(first)) {
                sum += wx * wy * value;
                power += wx * wy * wx * wy;
            }
        }
        sum / power.sqrt()
    }
}
