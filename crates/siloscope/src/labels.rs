//! Which pixel shows what: cylinder, cone, feed, or something else.

use crate::fit::SurfaceFit;
use crate::patches::{DepthImage, Patch};
use crate::surface::{Part, PlacedSurface};

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

/// Labels of a frame and how much of it each one covers.
#[derive(Debug, Clone, Default)]
pub struct Labels {
    /// Label of each pixel, row by row.
    pub pixels: Vec<u8>,
    /// Number of pixels with each label.
    pub counts: [f64; 5],
    /// True surface with each label, m².
    pub areas: [f64; 5],
}

/// Labels every pixel by the fitted wall.
pub fn label_pixels(image: &DepthImage, found: &SurfaceFit) -> Labels {
    let placed = PlacedSurface::new(found.fit.surface);
    let mut labels = Labels { pixels: vec![NONE; image.depth.len()], ..Labels::default() };
    for (v, u) in (0..image.height).flat_map(|v| (0..image.width).map(move |u| (v, u))) {
        let i = v * image.width + u;
        let label = label(image, found, &placed, (u, v));
        labels.pixels[i] = label;
        labels.counts[label as usize] += 1.0;
    }
    add_areas(&mut labels, image, found, &placed);
    labels
}

fn label(image: &DepthImage, found: &SurfaceFit, placed: &PlacedSurface, (u, v): (usize, usize)) -> u8 {
    let i = v * image.width + u;
    let measured = f64::from(image.depth[i]);
    if !(measured > 0.0 && measured.is_finite()) {
        return NONE;
    }
    let [x, y] = image.rays[i];
    let q = crate::Vec3::new(x, y, 1.0);
    let (wall, part) = placed.depth(&q);
    let residual = measured - found.fit.bias.measured(wall);
    let sigma = found.noise.sigma(wall.min(2.0 * measured));
    let at = placed.local_of(placed.to_silo(&(q * wall)), part);
    let cosine = (at.gradient.dot(&placed.turn(&q)) / (at.gradient.norm() * q.norm())).abs().max(0.02);
    let tolerance = 4.0 * sigma + 3.0 * found.fit.misfit / cosine;
    if residual.abs() <= tolerance {
        return if part == Part::Cylinder { CYLINDER } else { CONE };
    }
    let surface = has_company(image, (u, v), 0.02 * measured + 4.0 * found.noise.sigma(measured));
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

/// Surface area: a pixel at depth d with ray q covers d²·|q_u × q_v| / |n·q|, by tiles.
fn add_areas(labels: &mut Labels, image: &DepthImage, found: &SurfaceFit, placed: &PlacedSurface) {
    let side = found.patches.side;
    for patch in &found.patches.list {
        let (u0, v0) = (patch.tile.0 as usize * side, patch.tile.1 as usize * side);
        let mut counts = [0.0; 5];
        for v in v0..v0 + side {
            for &label in &labels.pixels[v * image.width + u0..][..side] {
                counts[label as usize] += 1.0;
            }
        }
        let d = found.fit.bias.true_depth(patch.measured);
        let pixel = patch.ray_steps[0].cross(&patch.ray_steps[1]).norm() * d * d;
        for (label, count) in counts.into_iter().enumerate().filter(|(_, n)| *n > 0.0) {
            labels.areas[label] += count * pixel / facing(label as u8, patch, placed, d);
        }
    }
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
