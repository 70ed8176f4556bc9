//! Which pixel shows what: cylinder, cone, feed, or something else.

use crate::geometry::vessel::{Part, PlacedSurface};
use crate::surface_fit::SurfaceFit;
use crate::surface_fit::tiles::{DepthImage, Patch};

/// No measurement.
pub const NONE: u8 = 0;
/// The cylinder.
pub const CYLINDER: u8 = 1;
/// The cone.
pub const CONE: u8 = 2;
/// Feed, and whatever else lies in front of the wall as a surface.
pub const FEED: u8 = 3;
/// What is no surface: dust, flying pixels, returns from behind the wall.
pub const OTHER: u8 = 4;

/// How much of a frame each label covers.
#[derive(Debug, Clone, Default)]
pub struct Coverage {
    /// Number of pixels with each label.
    pub counts: [f64; 5],
    /// True surface with each label, m².
    pub areas: [f64; 5],
}

/// Labels every pixel by the fitted wall, row by row.
pub fn label_pixels(image: &DepthImage, found: &SurfaceFit) -> Vec<u8> {
    let placed = PlacedSurface::new(found.fit.surface);
    let pixels = (0..image.height).flat_map(|v| (0..image.width).map(move |u| (u, v)));
    pixels.map(|at| label(image, found, &placed, at)).collect()
}

fn label(image: &DepthImage, found: &SurfaceFit, placed: &PlacedSurface, (u, v): (usize, usize)) -> u8 {
    let i = v * image.width + u;
    let measured = f64::from(image.depth[i]);
    if !(measured > 0.0 && measured.is_finite()) {
        return NONE;
    }
    let [x, y] = image.rays[i];
    let surface = has_company(image, (u, v), 0.02 * measured + 4.0 * found.noise.sigma(measured));
    label_of(found, placed, &crate::Vec3::new(x, y, 1.0), measured, surface)
}

/// The label of a measured depth on a ray; `surface` tells whether its surroundings lie about as deep.
fn label_of(found: &SurfaceFit, placed: &PlacedSurface, q: &crate::Vec3, measured: f64, surface: bool) -> u8 {
    let (wall, part) = placed.depth(q);
    let residual = measured - found.fit.bias.measured(wall);
    let sigma = found.noise.sigma(wall.min(2.0 * measured));
    let at = placed.local_of(placed.to_silo(&(q * wall)), part);
    let cosine = (at.gradient.dot(&placed.turn(q)) / (at.gradient.norm() * q.norm())).abs().max(0.02);
    let tolerance = 4.0 * sigma + 3.0 * found.fit.misfit / cosine;
    if residual.abs() <= tolerance {
        return if part == Part::Cylinder { CYLINDER } else { CONE };
    }
    if surface && (residual <= 0.0 || residual.is_nan()) { FEED } else { OTHER }
}

/// Whether at least two of the four neighbours lie about as deep.
fn has_company(image: &DepthImage, (u, v): (usize, usize), reach: f64) -> bool {
    let own = image.depth[v * image.width + u];
    let near = |du: usize, dv: usize| {
        let (c, r) = ((u + du).wrapping_sub(1), (v + dv).wrapping_sub(1));
        c < image.width && r < image.height && f64::from((image.depth[r * image.width + c] - own).abs()) < reach
    };
    [(0, 1), (2, 1), (1, 0), (1, 2)].into_iter().filter(|&(du, dv)| near(du, dv)).count() >= 2
}

/// What each label covers, tile by tile: a tile counts as what its mean depth shows.
///
/// A pixel at depth d with ray q covers the surface d²·|q_u × q_v| / |n·q|.
pub fn coverage(found: &SurfaceFit) -> Coverage {
    let placed = PlacedSurface::new(found.fit.surface);
    let mut coverage = Coverage::default();
    for (patch, rays) in found.patches.list.iter().zip(&found.patches.rays) {
        let label = label_of(found, &placed, &patch.q, patch.measured, true);
        let d = found.fit.bias.true_depth(patch.measured);
        let [along, down] = rays.steps(found.patches.side);
        let pixel = along.cross(&down).norm() * d * d;
        coverage.counts[usize::from(label)] += patch.count;
        coverage.areas[usize::from(label)] += patch.count * pixel / facing(label, patch, &placed, d);
    }
    coverage
}

/// |n·q| of a tile: of the fitted wall for wall pixels, of the tile's own normal for the rest.
fn facing(label: u8, patch: &Patch, placed: &PlacedSurface, d: f64) -> f64 {
    let part = match label {
        CYLINDER => Part::Cylinder,
        CONE => Part::Cone,
        _ => return patch.normal.dot(&patch.q).abs().max(0.02),
    };
    let at = placed.local_of(placed.to_silo(&patch.at(d)), part);
    (at.gradient.dot(&placed.turn(&patch.q)) / at.gradient.norm()).abs().max(0.02)
}
