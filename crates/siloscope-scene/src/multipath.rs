//! Light that goes round: a time-of-flight sensor also sees what other surfaces throw onto the one it looks at.
//!
//! Surfaces are Lambertian, the lamp is at the camera, and light goes round once. The echo of such light is later by half
//! its detour, and the reading is the mean of all echoes by their strength.

use crate::render::Exact;
use siloscope::{Camera, Vec3};
use std::f64::consts::PI;

/// Pixels across the patches that the image is cut into, for 40 patches across.
const PATCHES: usize = 40;

/// Relative depth error over the image: a lattice, between whose nodes it is straight.
#[derive(Default)]
pub(crate) struct Multipath {
    pitch: f64,
    columns: usize,
    rows: usize,
    values: Vec<f64>,
}

/// A patch of surface: its middle, normal, distance, the light that falls on it, and its area.
struct Patch {
    middle: Vec3,
    normal: Vec3,
    distance: f64,
    light: f64,
    area: f64,
}

impl Multipath {
    /// Of a frame whose surfaces throw back the share `reflectance` of the light.
    pub(crate) fn new(exact: &Exact, camera: &Camera, reflectance: f64) -> Self {
        if reflectance == 0.0 {
            return Self::default();
        }
        let side = camera.width.div_ceil(PATCHES).max(1);
        let (columns, rows) = (camera.width.div_ceil(side), camera.height.div_ceil(side));
        let patch = |i: usize| Patch::at(exact, camera, (i % columns) * side, (i / columns) * side, side);
        let patches: Vec<Option<Patch>> = (0..columns * rows).map(patch).collect();
        let error = |patch: &Option<Patch>| patch.as_ref().map_or(f64::NAN, |patch| patch.error(&patches, reflectance));
        Self { pitch: side as f64, columns, rows, values: patches.iter().map(error).collect() }
    }

    /// The error at column u and row v; 0 where nothing is known around.
    pub(crate) fn at(&self, u: f64, v: f64) -> f64 {
        if self.values.is_empty() {
            return 0.0;
        }
        let place = |pixel: f64, count: usize| {
            let place = (pixel / self.pitch - 0.5).clamp(0.0, (count - 1) as f64);
            (place.floor() as usize, place.fract())
        };
        let ((i, x), (j, y)) = (place(u, self.columns), place(v, self.rows));
        let (mut sum, mut weight) = (0.0, 0.0);
        for (di, dj, share) in
            [(0, 0, (1.0 - x) * (1.0 - y)), (1, 0, x * (1.0 - y)), (0, 1, (1.0 - x) * y), (1, 1, x * y)]
        {
            let (column, row) = ((i + di).min(self.columns - 1), (j + dj).min(self.rows - 1));
            if let Some(value) = self.values.get(row * self.columns + column).filter(|value| value.is_finite()) {
                (sum, weight) = (sum + share * value, weight + share);
            }
        }
        if weight > 0.0 { sum / weight } else { 0.0 }
    }
}

impl Patch {
    /// The patch of `side` pixels from a corner on, told by its middle pixel; None where that shows nothing.
    fn at(exact: &Exact, camera: &Camera, column: usize, row: usize, side: usize) -> Option<Self> {
        let (u, v) = ((column + side / 2).min(camera.width - 1), (row + side / 2).min(camera.height - 1));
        let pixel = v * camera.width + u;
        let depth = exact.depth.get(pixel).copied().filter(|&depth| depth > 0.0)?;
        let [x, y] = camera.ray(u as f64, v as f64);
        let middle = Vec3::new(x, y, 1.0) * depth;
        let normal = exact.normals.get(pixel).map(|n| Vec3::new(n[0], n[1], n[2]))?;
        let distance = middle.norm();
        let cosine = (-normal.dot(&middle) / distance).max(0.02);
        // the solid angle of a pixel is that of a plane at unit depth, seen aslant
        let angle = (side * side) as f64 / (camera.fx * camera.fy) * (depth / distance).powi(3);
        let area = angle * distance * distance / cosine;
        Some(Self { middle, normal, distance, light: cosine / (distance * distance), area })
    }

    /// Relative error of the distance: the detours' mean by strength.
    fn error(&self, patches: &[Option<Patch>], reflectance: f64) -> f64 {
        let (mut strength, mut detours) = (self.light, 0.0);
        for other in patches.iter().flatten() {
            let gap = other.middle - self.middle;
            let squared = gap.norm_squared();
            let length = squared.sqrt();
            let facing = (self.normal.dot(&gap) * -other.normal.dot(&gap)).max(0.0);
            if facing > 0.0 && length > 0.0 {
                // what a patch as near as it is wide throws is bounded by its own size
                let form = facing / squared / (PI * squared + other.area) * other.area;
                let thrown = reflectance * other.light * form;
                strength += thrown;
                detours += thrown * 0.5 * (other.distance + length - self.distance);
            }
        }
        detours / strength / self.distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Silo, SiloWorld, render};
    use siloscope::{Distortion, SiloPose};

    fn frame(depth: f64) -> (Exact, Camera) {
        let camera =
            Camera { width: 80, height: 60, fx: 71.3, fy: 71.3, cx: 39.5, cy: 29.5, distortion: Distortion::None };
        let silo = Silo { radius: 1.2, cylinder_height: depth, cone_height: 1.0, ..Silo::default() };
        let world = SiloWorld { silo, wall: None, feed: None, clutter: vec![] };
        let pose = SiloPose { r_x: 0.0, r_y: 0.0, t_x: 0.2, t_y: 0.1 };
        (render(&world, &camera, &pose, 1).unwrap(), camera)
    }

    #[test]
    fn nothing_goes_round_before_a_plane() {
        let (mut exact, camera) = frame(3.0);
        exact.depth.fill(2.0);
        exact.normals.fill([0.0, 0.0, -1.0]);
        let field = Multipath::new(&exact, &camera, 0.5);
        assert!((0..80).all(|u| field.at(f64::from(u), 20.0) == 0.0));
    }

    #[test]
    fn a_silo_reads_long_by_its_reflectance() {
        let (exact, camera) = frame(3.0);
        let mean = |reflectance: f64| {
            let field = Multipath::new(&exact, &camera, reflectance);
            (0..4800).map(|i| field.at(f64::from(i % 80), f64::from(i / 80))).sum::<f64>() / 4800.0
        };
        let (dark, bright) = (mean(0.1), mean(0.3));
        assert_eq!(mean(0.0), 0.0);
        assert!(dark > 0.002 && dark < 0.03, "{dark}");
        assert!(bright > 2.0 * dark && bright < 3.0 * dark, "{bright} and {dark}");
    }
}
