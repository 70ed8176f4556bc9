//! What a frame shows about a known silo: cylinder, cone and feed, by pixels and by surface.

use crate::geometry::label::Label;
use crate::shape_tensor::profile::Profile;
use crate::stats::voxel_grid::Cloud;
use crate::{SiloPose, Vec3};

/// Pixels and surface by label (`Label`), the surface in units of its own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Coverage {
    /// Number of pixels with each label.
    pub pixels: [f64; 5],
    /// Surface with each label.
    pub areas: [f64; 5],
    /// Number of pixels that see clearly behind the wall, where nothing can be.
    pub behind: f64,
    /// Pixels that look towards the cone's vertex, and those of them that see something before it.
    pub apex: [f64; 2],
}

impl Coverage {
    /// Whether something lies before the cone all around its vertex: then the cone is no surface of feed.
    pub fn is_apex_covered(&self) -> bool {
        self.apex[1] > 0.7 * self.apex[0]
    }

    /// Share of the pixels that see clearly behind the wall.
    pub fn share_behind(&self) -> f64 {
        self.behind / self.pixels.iter().sum::<f64>().max(1.0)
    }
}

/// How near the axis is near the vertex, as a share of the silo's size.
const APEX: f64 = 0.15;

/// Labels voxels and adds up what their pixels cover.
///
/// A voxel within `tolerance` metres of the wall is wall, one before it is feed, one behind it something else. A pixel
/// at depth z covers z²/|n·q| of a surface with normal n, q being the ray (x/z, y/z, 1): of the wall's own normal
/// where it is wall, else of the voxel's. All pixels are taken as equally large.
pub fn coverage(cloud: &Cloud, normals: &[Vec3], pose: &SiloPose, profile: &Profile, tolerance: f64) -> Coverage {
    let turn = pose.rotation();
    let shift = Vec3::new(pose.t_x, pose.t_y, 0.0);
    let mut seen = Coverage::default();
    let reach = APEX * profile.size();
    for ((p, normal), count) in cloud.points.iter().zip(normals).zip(&cloud.counts) {
        let placed = turn * p + shift;
        let rho = placed.x.hypot(placed.y);
        let (off, angle) = profile.distance(rho, placed.z);
        let label = label(off, profile.is_cone(placed.z), tolerance);
        let facing = match label {
            Label::Cylinder | Label::Cone => wall_normal(&placed, rho, angle).dot(&(turn * p)),
            _ => normal.dot(p),
        };
        let pixels = f64::from(*count);
        seen.behind += if off > 0.05 * rho + tolerance { pixels } else { 0.0 };
        if rho < reach && profile.is_cone(placed.z) {
            seen.apex[0] += pixels;
            seen.apex[1] += if off < -0.02 * reach - tolerance { pixels } else { 0.0 };
        }
        seen.pixels[label as usize] += pixels;
        seen.areas[label as usize] += pixels * p.z.powi(3) / facing.abs().max(0.02 * p.norm());
    }
    seen
}

fn label(off: f64, cone: bool, tolerance: f64) -> Label {
    match (off.abs() <= tolerance, cone) {
        (true, false) => Label::Cylinder,
        (true, true) => Label::Cone,
        _ if off > 0.0 => Label::Other,
        _ => Label::Feed,
    }
}

/// Unit normal of the wall at a place in the silo frame.
fn wall_normal(placed: &Vec3, rho: f64, angle: f64) -> Vec3 {
    let radial = angle.cos() / rho.max(1e-12);
    Vec3::new(radial * placed.x, radial * placed.y, angle.sin())
}
