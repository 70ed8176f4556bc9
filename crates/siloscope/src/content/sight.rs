//! How much of the silo the sensor sees at all.

use super::returns::{Rays, Returns, Source};
use crate::geometry::vessel::Vessel;
use crate::{SiloPose, Vec3};

/// What the sensor sees of what it should.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sight {
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
/// Every so manieth pixel is looked at.
const STRIDE: usize = 4;

/// Looks at the raw frame; `range` is what the sensor can measure.
pub fn sight(source: Source<'_>, returns: &Returns<'_>, vessel: &Vessel, pose: &SiloPose, range: [f64; 2]) -> Sight {
    let (mut measured, mut near, mut all) = (0.0, 0.0, 0.0);
    returns.visit(STRIDE, |line| {
        all += line.len() as f64;
        measured += line.depth.iter().filter(|&&d| d > 0.0).count() as f64;
        near += line.depth.iter().filter(|&&d| d > 0.0 && f64::from(d) < TOO_NEAR * range[0]).count() as f64;
    });
    Sight {
        measured: measured / f64::max(all, 1.0),
        blind: if let Source::Depth(depth, rays) = source { blind(depth, rays, vessel, pose, range) } else { 0.0 },
        near: near / f64::max(measured, 1.0),
    }
}

fn blind(depth: &[f32], rays: Rays<'_>, vessel: &Vessel, pose: &SiloPose, range: [f64; 2]) -> f64 {
    let columns = match rays {
        Rays::Pinhole(columns, _) => columns.len(),
        Rays::Each(_, columns) => columns,
    };
    let rows = depth.len() / columns.max(1);
    let (mut expected, mut blind) = (0.0, 0.0);
    for tile in 0..TILES[0] * TILES[1] {
        let (u, v) = (tile % TILES[0], tile / TILES[0]);
        let span = |i: usize, tiles: usize, size: usize| (i * size / tiles, (i + 1) * size / tiles);
        let ((u0, u1), (v0, v1)) = (span(u, TILES[0], columns), span(v, TILES[1], rows));
        let Some(ray) = ray(rays, (u0 + u1) / 2, (v0 + v1) / 2) else { continue };
        let there = wall_depth(vessel, pose, ray).is_some_and(|d| (range[0]..range[1]).contains(&d));
        if there {
            expected += 1.0;
            blind += f64::from(u8::from(share(depth, columns, [u0, u1], [v0, v1]) < BLIND));
        }
    }
    if expected > 0.0 { blind / expected } else { 0.0 }
}

fn ray(rays: Rays<'_>, u: usize, v: usize) -> Option<[f64; 2]> {
    match rays {
        Rays::Pinhole(columns, rows) => Some([f64::from(*columns.get(u)?), f64::from(*rows.get(v)?)]),
        Rays::Each(rays, columns) => rays.get(v * columns + u).copied(),
    }
}

fn share(depth: &[f32], columns: usize, [u0, u1]: [usize; 2], [v0, v1]: [usize; 2]) -> f64 {
    let (mut all, mut measured) = (0.0, 0.0);
    for v in (v0..v1).step_by(STRIDE) {
        let line = depth.get(v * columns + u0..v * columns + u1).unwrap_or(&[]);
        for &d in line.iter().step_by(STRIDE) {
            all += 1.0;
            measured += f64::from(u8::from(d > 0.0));
        }
    }
    if all > 0.0 { measured / all } else { 0.0 }
}

/// Depth at which a pixel's ray meets the empty silo; None where it leaves through the top.
pub fn wall_depth(vessel: &Vessel, pose: &SiloPose, ray: [f64; 2]) -> Option<f64> {
    let (p, q) = (Vec3::new(pose.t_x, pose.t_y, 0.0), pose.rotation() * Vec3::new(ray[0], ray[1], 1.0));
    let (a, b) = (q.x * q.x + q.y * q.y, p.x * q.x + p.y * q.y);
    let c = p.x * p.x + p.y * p.y;
    let leaving = |a: f64, b: f64, c: f64| {
        let root = (b * b - a * c).max(0.0).sqrt();
        let out = if a.abs() > 1e-12 { (-b + root) / a } else { -c / (2.0 * b) };
        (out > 0.0 && out.is_finite()).then_some(out)
    };
    let cylinder = if a > 1e-12 { leaving(a, b, c - vessel.radius * vessel.radius) } else { None };
    if let Some(t) = cylinder.filter(|t| t * q.z <= vessel.cylinder_bottom) {
        return (t * q.z >= vessel.top).then_some(t);
    }
    // the cone: r = m (apex - z), entered from above, so the nearest crossing below the cylinder counts
    let height = vessel.cone_height();
    if height <= 1e-9 {
        return (q.z > 0.0).then(|| vessel.apex / q.z);
    }
    let m = vessel.radius / height;
    let square = (a - m * m * q.z * q.z, b + m * m * vessel.apex * q.z, c - m * m * vessel.apex * vessel.apex);
    let root = (square.1 * square.1 - square.0 * square.2).max(0.0).sqrt();
    let crossings = [(-square.1 + root) / square.0, (-square.1 - root) / square.0, -square.2 / (2.0 * square.1)];
    let below =
        |t: f64| t.is_finite() && t > 0.0 && (vessel.cylinder_bottom - 1e-9..=vessel.apex + 1e-9).contains(&(t * q.z));
    crossings.into_iter().filter(|&t| below(t)).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let depth = wall_depth(&VESSEL, &POSE, [x, y]);
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
        let columns: Vec<f32> = (0..64).map(|u| (u as f32 - 31.5) / 80.0).collect();
        let rows: Vec<f32> = (0..48).map(|v| (v as f32 - 23.5) / 80.0).collect();
        let rays = Rays::Pinhole(&columns, &rows);
        let look = |depth: &[f32]| blind(depth, rays, &VESSEL, &POSE, [0.2, 8.0]);
        let mut depth = vec![2.0f32; 64 * 48];
        assert_eq!(look(&depth), 0.0);
        depth.chunks_exact_mut(64).for_each(|row| row[..32].fill(0.0));
        assert!((look(&depth) - 0.5).abs() < 0.1);
        assert_eq!(look(&[0.0; 64 * 48]), 1.0);
    }
}
