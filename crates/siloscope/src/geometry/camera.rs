//! Camera intrinsics, lens distortion, and the rays of the pixels (Eqs. 1 and 2).

use crate::{Error, Result};

/// Lens distortion models, with coefficients in the order of OpenCV and ROS.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Distortion {
    /// An ideal pinhole.
    #[default]
    None,
    /// Brown–Conrady (`plumb_bob`): k1, k2, p1, p2, k3; maps ideal to observed coordinates.
    BrownConrady([f64; 5]),
    /// Inverse Brown–Conrady: the same polynomial, maps observed to ideal coordinates.
    InverseBrownConrady([f64; 5]),
    /// Rational: k1, k2, p1, p2, k3, k4, k5, k6.
    Rational([f64; 8]),
    /// Kannala–Brandt (`equidistant`, fisheye): k1, k2, k3, k4.
    KannalaBrandt([f64; 4]),
}

/// Intrinsics of a depth camera, in pixels; pixel centres are at integers.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Image width.
    pub width: usize,
    /// Image height.
    pub height: usize,
    /// Horizontal focal length.
    pub fx: f64,
    /// Vertical focal length.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Lens distortion.
    pub distortion: Distortion,
}

/// Largest width or height accepted, in pixels.
pub const MAX_SIDE: usize = 20_000;

impl Camera {
    /// Checks every field; a camera with NaN, zero or negative focal lengths is refused by the field's name.
    pub fn validate(&self) -> Result<()> {
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if side == 0 || side > MAX_SIDE {
                return Err(Error::Setting { name, bounds: "between 1 and 20000 pixels", value: side as f64 });
            }
        }
        for (name, f) in [("fx", self.fx), ("fy", self.fy)] {
            if !(f.is_finite() && f > 0.0) {
                return Err(Error::Setting { name, bounds: "a positive number of pixels", value: f });
            }
        }
        for (name, c) in [("cx", self.cx), ("cy", self.cy)] {
            if !c.is_finite() {
                return Err(Error::Setting { name, bounds: "a finite number of pixels", value: c });
            }
        }
        Ok(())
    }

    /// Ray of a pixel: the point at depth 1, `(x/z, y/z)` (Eqs. 1 and 2 divided by z), undistorted.
    pub fn ray(&self, u: f64, v: f64) -> [f64; 2] {
        let observed = [(u - self.cx) / self.fx, (v - self.cy) / self.fy];
        match &self.distortion {
            Distortion::None => observed,
            Distortion::InverseBrownConrady(k) => brown_conrady(k, observed),
            Distortion::BrownConrady(k) => invert(observed, |p| brown_conrady(k, p)),
            Distortion::Rational(k) => invert(observed, |p| rational(k, p)),
            Distortion::KannalaBrandt(k) => invert_kannala_brandt(k, observed),
        }
    }

    /// Rays of all pixels, row by row: `width * height` entries.
    pub fn rays(&self) -> Vec<[f64; 2]> {
        let row = |v| (0..self.width).map(move |u| self.ray(u as f64, v as f64));
        (0..self.height).flat_map(row).collect()
    }
}

fn brown_conrady(k: &[f64; 5], [x, y]: [f64; 2]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    tangential(k[2], k[3], [x, y], radial)
}

fn rational(k: &[f64; 8], [x, y]: [f64; 2]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    let below = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    tangential(k[2], k[3], [x, y], above / below)
}

fn tangential(p1: f64, p2: f64, [x, y]: [f64; 2], radial: f64) -> [f64; 2] {
    let r2 = x * x + y * y;
    [x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y]
}

/// Solves `distort(p) = observed` by Newton steps with a numeric 2×2 Jacobian.
fn invert(observed: [f64; 2], distort: impl Fn([f64; 2]) -> [f64; 2]) -> [f64; 2] {
    const H: f64 = 1e-6;
    let mut p = observed;
    for _ in 0..20 {
        let f = distort(p);
        let (ex, ey) = (f[0] - observed[0], f[1] - observed[1]);
        if ex.abs() + ey.abs() < 1e-13 {
            break;
        }
        let (dx, dy) = (distort([p[0] + H, p[1]]), distort([p[0], p[1] + H]));
        let (a, b) = ((dx[0] - f[0]) / H, (dy[0] - f[0]) / H);
        let (c, d) = ((dx[1] - f[1]) / H, (dy[1] - f[1]) / H);
        let det = a * d - b * c;
        if det.abs() < 1e-12 {
            break;
        }
        p = [p[0] - (d * ex - b * ey) / det, p[1] - (a * ey - c * ex) / det];
    }
    p
}

/// Kannala–Brandt: the observed radius is θ(1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), the ideal one tan θ.
fn invert_kannala_brandt(k: &[f64; 4], [x, y]: [f64; 2]) -> [f64; 2] {
    let observed = x.hypot(y);
    if observed < 1e-12 {
        return [x, y];
    }
    let mut theta = observed;
    for _ in 0..20 {
        let t2 = theta * theta;
        let value = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
        let slope = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
        theta -= (value - observed) / slope;
    }
    let scale = theta.tan() / observed;
    [x * scale, y * scale]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(distortion: Distortion) -> Camera {
        Camera { width: 640, height: 480, fx: 504.6, fy: 504.7, cx: 332.8, cy: 248.8, distortion }
    }

    #[test]
    fn rays_undo_the_distortion() {
        let k = [0.54794, -0.020971, -7.21e-5, 2.06e-5, -0.0026522, 0.88968, 0.08613, -0.01391];
        let plumb_bob = [0.1, -0.05, 1e-3, -2e-3, 0.01];
        for (u, v) in [(0.0, 0.0), (332.8, 248.8), (639.0, 479.0), (100.0, 400.0)] {
            let ideal = camera(Distortion::Rational(k)).ray(u, v);
            let again = rational(&k, ideal);
            assert!((again[0] * 504.6 + 332.8 - u).abs() < 1e-8 && (again[1] * 504.7 + 248.8 - v).abs() < 1e-8);
            let ideal = camera(Distortion::BrownConrady(plumb_bob)).ray(u, v);
            let again = brown_conrady(&plumb_bob, ideal);
            assert!((again[0] * 504.6 + 332.8 - u).abs() < 1e-8 && (again[1] * 504.7 + 248.8 - v).abs() < 1e-8);
        }
    }

    #[test]
    fn bad_intrinsics_are_refused_by_name() {
        for fx in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let bad = Camera { fx, ..camera(Distortion::None) };
            assert!(matches!(bad.validate(), Err(Error::Setting { name: "fx", .. })));
        }
    }
}
