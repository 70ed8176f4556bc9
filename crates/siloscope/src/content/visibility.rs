//! How much of the silo the sensor sees at all.

use super::silo_points::{SiloPoints, Source};
use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::surface::Part;
use crate::geometry::vessel::Vessel;
use crate::{SiloPose, Vec3};

/// What the sensor sees of what it should.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Visibility {
    /// Share of the pixels or points with a measurement.
    pub measured: f64,
    /// Share of the image's tiles that look at the silo within the sensor's range and show next to nothing.
    pub blind: f64,
    /// Share of the measurements far nearer than the sensor can measure.
    pub near: f64,
}

/// Measurements nearer than this share of the sensor's least range are none of the silo.
const TOO_NEAR: f64 = 0.5;
/// Tiles along a line and along a column.
const TILES: [usize; 2] = [16, 12];
/// A tile with a smaller share of measurements is blind.
const BLIND: f64 = 0.02;
/// Pixel stride.
const STRIDE: usize = 4;

/// Looks at the raw frame; `range` is what the sensor can measure.
pub fn visibility(
    source: Source<'_>,
    returns: &SiloPoints<'_>,
    vessel: &Vessel,
    pose: &SiloPose,
    range: [f64; 2],
) -> Visibility {
    let (mut measured, mut near, mut all) = (0.0, 0.0, 0.0);
    returns.visit_depths(STRIDE, |depth| {
        all += depth.len() as f64;
        measured += depth.iter().filter(|&&d| d > 0.0).count() as f64;
        near += depth.iter().filter(|&&d| d > 0.0 && f64::from(d) < TOO_NEAR * range[0]).count() as f64;
    });
    Visibility {
        measured: measured / f64::max(all, 1.0),
        blind: if let Source::Depth(image) = source { blind(&image, vessel, pose, range) } else { 0.0 },
        near: near / f64::max(measured, 1.0),
    }
}

fn blind(image: &DepthImage, vessel: &Vessel, pose: &SiloPose, range: [f64; 2]) -> f64 {
    let wall = EmptyVessel::new(vessel, pose);
    let (mut expected, mut blind) = (0.0, 0.0);
    for tile in 0..TILES[0] * TILES[1] {
        let (u, v) = (tile % TILES[0], tile / TILES[0]);
        let span = |i: usize, tiles: usize, size: usize| (i * size / tiles, (i + 1) * size / tiles);
        let ((u0, u1), (v0, v1)) = (span(u, TILES[0], image.width), span(v, TILES[1], image.height));
        let ray = image.ray((v0 + v1) / 2 * image.width + (u0 + u1) / 2);
        if wall.depth(ray).is_some_and(|d| (range[0]..range[1]).contains(&d)) {
            expected += 1.0;
            blind += f64::from(u8::from(measured_fraction(image, [u0, u1], [v0, v1]) < BLIND));
        }
    }
    if expected > 0.0 { blind / expected } else { 0.0 }
}

fn measured_fraction(image: &DepthImage, [u0, u1]: [usize; 2], [v0, v1]: [usize; 2]) -> f64 {
    let (mut all, mut measured) = (0.0, 0.0);
    for v in (v0..v1).step_by(STRIDE) {
        let line = image.depth.get(v * image.width + u0..v * image.width + u1).unwrap_or(&[]);
        for &d in line.iter().step_by(STRIDE) {
            all += 1.0;
            measured += f64::from(u8::from(d > 0.0));
        }
    }
    if all > 0.0 { measured / all } else { 0.0 }
}

/// The empty vessel as a camera sees it.
struct EmptyVessel<'a> {
    vessel: &'a Vessel,
    wall: SurfaceEvaluator,
}

impl<'a> EmptyVessel<'a> {
    fn new(vessel: &'a Vessel, pose: &SiloPose) -> Self {
        Self { vessel, wall: SurfaceEvaluator::new(vessel.surface(pose)) }
    }

    /// Depth at which a ray meets the wall or the floor; None where it leaves through the top.
    fn depth(&self, ray: [f64; 2]) -> Option<f64> {
        let q = Vec3::new(ray[0], ray[1], 1.0);
        let (down, (wall, part)) = (self.wall.down(ray), self.wall.depth(&q));
        let floor = self.vessel.cylinder_bottom / down;
        let on_floor = part == Part::Cylinder && down > 0.0 && (wall > floor || wall.is_nan());
        let depth = if on_floor { floor } else { wall };
        (depth > 0.0 && depth.is_finite() && depth * down >= self.vessel.top).then_some(depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Distortion};
    use proptest::prelude::*;

    const VESSEL: Vessel = Vessel {
        radius: 1.2,
        cylinder_bottom: 2.0,
        apex: 3.4,
        top: -0.1,
        outlet_radius: 0.0,
        outlet_length: 0.0,
        ovality: [0.0; 2],
    };
    const POSE: SiloPose = SiloPose { r_x: 0.1, r_y: -0.2, t_x: 0.4, t_y: 0.1 };

    proptest! {
        #[test]
        fn the_wall_is_where_the_ray_meets_it(x in -0.5f64..0.5, y in -0.4f64..0.4) {
            let depth = EmptyVessel::new(&VESSEL, &POSE).depth([x, y]);
            prop_assert!(depth.is_some());
            let p = POSE.to_silo(&(Vec3::new(x, y, 1.0) * depth.unwrap_or(f64::NAN)));
            let r = p.x.hypot(p.y);
            let on_cylinder = (r - 1.2).abs() < 1e-9 && p.z <= 2.0 + 1e-9;
            let on_cone = (VESSEL.cone(r) - p.z).abs() < 1e-9 && p.z >= 2.0 - 1e-9;
            prop_assert!(on_cylinder || on_cone, "{} {}", r, p.z);
        }
    }

    #[test]
    fn a_dark_corner_is_blind_and_a_whole_frame_is_not() {
        let distortion = Distortion::None;
        let camera = Camera { width: 64, height: 48, fx: 80.0, fy: 80.0, cx: 31.5, cy: 23.5, distortion };
        let look = |depth: &[f32]| {
            DepthImage::new(depth, &camera, None).map(|image| blind(&image, &VESSEL, &POSE, [0.2, 8.0]))
        };
        let mut depth = vec![2.0f32; 64 * 48];
        assert_eq!(look(&depth), Ok(0.0));
        depth.chunks_exact_mut(64).for_each(|row| row[..32].fill(0.0));
        assert!(look(&depth).is_ok_and(|blind| (blind - 0.5).abs() < 0.1));
        assert_eq!(look(&[0.0; 64 * 48]), Ok(1.0));
    }
}
