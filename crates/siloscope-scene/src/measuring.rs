//! What a sensor makes of exact depths: one frame through one sensor (Eq. 10).

use crate::lattice::Lattice;
use crate::multipath::Multipath;
use crate::random::Stream;
use crate::render::{Exact, check_threads};
use crate::sensor::Sensor;
use siloscope::{Camera, Error, Result};

/// A pixel after the sensor: its depth (0 for none) and whether it shows something that is not there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reading {
    depth: f64,
    false_return: bool,
}

const NO_READING: Reading = Reading { depth: 0.0, false_return: false };

/// Depths as the sensor gives them, and which pixels are flying or dust.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Depth, 0 where there is none.
    pub depth: Vec<f64>,
    /// Flying pixels and dust.
    pub false_returns: Vec<bool>,
}

impl Sensor {
    /// Measures an exact frame. The same seed gives the same noise, whatever the number of threads.
    pub fn measure(&self, exact: &Exact, camera: &Camera, seed: u64, threads: usize) -> Result<Measured> {
        self.validate()?;
        check_threads(threads)?;
        let pixels = camera.width * camera.height;
        for (what, got) in [("depth", exact.depth.len()), ("normals", exact.normals.len())] {
            if got != pixels {
                return Err(Error::Shape { what, got, expected: pixels });
            }
        }
        let mut out = Measured { depth: vec![0.0; pixels], false_returns: vec![false; pixels] };
        let band = camera.height.div_ceil(threads) * camera.width;
        let multipath = Multipath::new(exact, camera, self.multipath);
        let pass = &Pass { sensor: self, exact, camera, seed, lattices: self.lattices(camera, seed), multipath };
        std::thread::scope(|scope| {
            for (part, (depth, flags)) in out.depth.chunks_mut(band).zip(out.false_returns.chunks_mut(band)).enumerate()
            {
                let mut job = move || pass.read_band(part * band, depth, flags);
                if threads == 1 { job() } else { drop(scope.spawn(job)) }
            }
        });
        Ok(out)
    }

    /// Whether pixels are lost in patches; one that is no longer than a pixel is a pixel.
    fn loses_patches(&self) -> bool {
        self.dropout > 0.0 && self.dropout_length >= 1.0
    }

    /// The smooth random fields of a frame.
    fn lattices(&self, camera: &Camera, seed: u64) -> Lattices {
        let field = |wanted: bool, seed, purpose: Purpose, pitch: f64| {
            let stream = Stream::new(seed, purpose as u64);
            if wanted { Lattice::new(stream, pitch, camera) } else { Lattice::default() }
        };
        Lattices {
            common: field(self.correlation != 0.0, seed, Purpose::Common, self.correlation_length),
            dropout: field(self.loses_patches(), seed, Purpose::Dropout, self.dropout_length),
            warp: field(self.warp > 0.0, self.warp_seed, Purpose::Warp, self.warp_length),
        }
    }
}

/// Smooth random fields; those that a sensor has no use for are empty.
struct Lattices {
    common: Lattice,
    dropout: Lattice,
    warp: Lattice,
}

/// One frame through one sensor.
struct Pass<'a> {
    sensor: &'a Sensor,
    exact: &'a Exact,
    camera: &'a Camera,
    seed: u64,
    lattices: Lattices,
    multipath: Multipath,
}

/// What the random streams are for.
#[derive(Clone, Copy)]
enum Purpose {
    Noise = 16,
    Common,
    Dropout,
    Flying,
    FlyingDepth,
    Dust,
    DustDepth,
    Warp,
}

impl Pass<'_> {
    fn stream(&self, purpose: Purpose) -> Stream {
        Stream::new(self.seed, purpose as u64)
    }

    fn read_band(&self, first: usize, depth: &mut [f64], flags: &mut [bool]) {
        for (i, (depth, flag)) in depth.iter_mut().zip(flags).enumerate() {
            let reading = self.read(first + i);
            (*depth, *flag) = (reading.depth, reading.false_return);
        }
    }

    fn read(&self, pixel: usize) -> Reading {
        let sensor = self.sensor;
        let surface = self.exact.depth[pixel];
        let (true_depth, false_return) = match self.false_return(pixel, surface) {
            Some(depth) => (depth, true),
            None => (surface, false),
        };
        if true_depth <= 0.0 || self.is_lost(pixel, true_depth) {
            return NO_READING;
        }
        let angle = if false_return { 0.0 } else { self.incidence(pixel) };
        if angle > sensor.max_incidence {
            return NO_READING;
        }
        let depth = self.disturbed(pixel, true_depth, angle);
        if !(depth > 0.0 && (sensor.min_range..=sensor.max_range).contains(&depth)) {
            return NO_READING;
        }
        Reading { depth: self.rounded(depth), false_return }
    }

    /// Eq. 10: the true depth plus its error.
    fn disturbed(&self, pixel: usize, d: f64, angle: f64) -> f64 {
        let sensor = self.sensor;
        let sigma = sensor.sigma_at(d);
        let noise = if sigma > 0.0 { sigma * self.grazing_factor(angle) * self.unit_noise(pixel) } else { 0.0 };
        d + sensor.bias_at(d) + self.lasting_error(pixel, d) + noise
    }

    /// Warp and bowl, the same in every frame of a unit, and light that went round, the same in every frame of a scene.
    fn lasting_error(&self, pixel: usize, d: f64) -> f64 {
        let sensor = self.sensor;
        let mut error = 0.0;
        if sensor.warp > 0.0 {
            let (u, v) = self.place(pixel);
            error += sensor.warp * d * d * self.lattices.warp.at(u, v);
        }
        if sensor.bowl != 0.0 {
            let (u, v) = self.place(pixel);
            let (cx, cy) = (self.camera.cx, self.camera.cy);
            let corner =
                cx.max(self.camera.width as f64 - 1.0 - cx).hypot(cy.max(self.camera.height as f64 - 1.0 - cy));
            error += sensor.bowl * ((u - cx).powi(2) + (v - cy).powi(2)) / corner.powi(2).max(1e-12);
        }
        if sensor.multipath > 0.0 {
            let (u, v) = self.place(pixel);
            error += d * self.multipath.at(u, v);
        }
        error
    }

    /// Lost for no visible reason, or in the band that the second imager does not see.
    fn is_lost(&self, pixel: usize, depth: f64) -> bool {
        let sensor = self.sensor;
        if sensor.baseline > 0.0 && self.place(pixel).0 * depth < self.camera.fx * sensor.baseline {
            return true;
        }
        if !sensor.loses_patches() {
            return self.happens(Purpose::Dropout, sensor.dropout, pixel);
        }
        let (u, v) = self.place(pixel);
        normal_share(self.lattices.dropout.at(u, v)) < sensor.dropout
    }

    /// Column and row.
    fn place(&self, pixel: usize) -> (f64, f64) {
        ((pixel % self.camera.width) as f64, (pixel / self.camera.width) as f64)
    }

    fn grazing_factor(&self, angle: f64) -> f64 {
        if self.sensor.incidence_gain == 0.0 {
            return 1.0;
        }
        let ratio = angle / (std::f64::consts::FRAC_PI_2 - angle).max(0.02);
        1.0 + self.sensor.incidence_gain * ratio * ratio
    }

    /// Noise of variance 1: a part of its own and a part shared with the neighbours.
    fn unit_noise(&self, pixel: usize) -> f64 {
        let own = self.stream(Purpose::Noise).normal(pixel as u64);
        let share = self.sensor.correlation;
        if share == 0.0 { own } else { (1.0 - share).sqrt() * own + share.sqrt() * self.common_noise(pixel) }
    }

    fn common_noise(&self, pixel: usize) -> f64 {
        let (u, v) = self.place(pixel);
        self.lattices.common.at(u, v)
    }

    /// Depth of a dust grain or of a flying pixel, where there is one.
    fn false_return(&self, pixel: usize, surface: f64) -> Option<f64> {
        if self.happens(Purpose::Dust, self.sensor.dust, pixel) {
            let near = self.sensor.min_range.max(0.05);
            let far = if surface > 0.0 { surface } else { 10.0 };
            let u = self.stream(Purpose::DustDepth).uniform(pixel as u64);
            return (far > near).then_some(near + (far - near) * u * u); // dense near the sensor
        }
        if surface > 0.0 && self.happens(Purpose::Flying, self.sensor.flying, pixel) {
            let far = self.across_edge(pixel, surface)?;
            return Some(surface + (far - surface) * self.stream(Purpose::FlyingDepth).uniform(pixel as u64));
        }
        None
    }

    /// The depth of the 4-neighbour that lies across a depth edge.
    fn across_edge(&self, pixel: usize, depth: f64) -> Option<f64> {
        let (width, column) = (self.camera.width, pixel % self.camera.width);
        let left = (column > 0).then(|| pixel - 1);
        let right = (column + 1 < width).then_some(pixel + 1);
        let neighbours = [left, right, pixel.checked_sub(width), Some(pixel + width)];
        let depths = neighbours.into_iter().flatten().filter_map(|i| self.exact.depth.get(i).copied());
        depths.filter(|&d| d > 0.0).find(|d| (d - depth).abs() > self.sensor.flying_step * d.min(depth))
    }

    /// Angle between the ray and the surface's normal.
    fn incidence(&self, pixel: usize) -> f64 {
        if self.sensor.incidence_gain == 0.0 && self.sensor.max_incidence >= std::f64::consts::FRAC_PI_2 {
            return 0.0;
        }
        let (u, v) = self.place(pixel);
        let [x, y] = self.camera.ray(u, v);
        let n = self.exact.normals[pixel];
        let cosine = (n[0] * x + n[1] * y + n[2]).abs() / (x * x + y * y + 1.0).sqrt();
        cosine.min(1.0).acos()
    }

    fn happens(&self, purpose: Purpose, share: f64, pixel: usize) -> bool {
        share > 0.0 && self.stream(purpose).uniform(pixel as u64) < share
    }

    /// The depth in whole raw units; what does not fit into 16 bits is lost.
    fn rounded(&self, depth: f64) -> f64 {
        if self.sensor.unit == 0.0 {
            return depth;
        }
        let raw = (depth / self.sensor.unit).round();
        if (1.0..65535.0).contains(&raw) { raw * self.sensor.unit } else { 0.0 }
    }
}

/// Share of a standard normal law below `x`, to 1e-7 (Abramowitz and Stegun 7.1.26).
fn normal_share(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let tail = 0.5 * poly * (-z * z).exp();
    if x < 0.0 { tail } else { 1.0 - tail }
}
