//! Which pixel shows what: cylinder, cone, feed, or something else.

use crate::geometry::depth_image::DepthImage;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::label::Label;
use crate::geometry::surface::Part;
use crate::surface_fit::SurfaceFit;
use crate::surface_fit::tiles::Patch;

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
    let placed = SurfaceEvaluator::new(found.fit.surface);
    let pixels = (0..image.height).flat_map(|v| (0..image.width).map(move |u| (u, v)));
    pixels.map(|at| label(image, found, &placed, at) as u8).collect()
}

fn label(image: &DepthImage, found: &SurfaceFit, placed: &SurfaceEvaluator, (u, v): (usize, usize)) -> Label {
    let i = v * image.width + u;
    let measured = f64::from(image.depth[i]);
    if !(measured > 0.0 && measured.is_finite()) {
        return Label::None;
    }
    let [x, y] = image.ray(i);
    let surface = has_company(image, (u, v), 0.02 * measured + 4.0 * found.noise.sigma(measured));
    label_of(found, placed, &crate::Vec3::new(x, y, 1.0), measured, surface)
}

/// The label of a measured depth on a ray; `surface` tells whether its surroundings lie about as deep.
fn label_of(found: &SurfaceFit, placed: &SurfaceEvaluator, q: &crate::Vec3, measured: f64, surface: bool) -> Label {
    let (wall, part) = placed.depth(q);
    let residual = measured - found.fit.bias.measured(wall);
    let sigma = found.noise.sigma(wall.min(2.0 * measured));
    let at = placed.local_of(placed.to_silo(&(q * wall)), part);
    let cosine = (at.gradient.dot(&placed.turn(q)) / (at.gradient.norm() * q.norm())).abs().max(0.02);
    let tolerance = 4.0 * sigma + 3.0 * found.fit.misfit / cosine;
    if residual.abs() <= tolerance {
        return if part == Part::Cylinder { Label::Cylinder } else { Label::Cone };
    }
    if surface && (residual <= 0.0 || residual.is_nan()) { Label::Feed } else { Label::Other }
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
    let placed = SurfaceEvaluator::new(found.fit.surface);
    let mut coverage = Coverage::default();
    for (patch, rays) in found.patches.list.iter().zip(&found.patches.rays) {
        let label = label_of(found, &placed, &patch.q, patch.measured, true);
        let d = found.fit.bias.true_depth(patch.measured);
        let [along, down] = rays.steps(found.patches.side);
        let pixel = along.cross(&down).norm() * d * d;
        coverage.counts[label as usize] += patch.count;
        coverage.areas[label as usize] += patch.count * pixel / facing(label, patch, &placed, d);
    }
    coverage
}

/// |n·q| of a tile: of the fitted wall for wall pixels, of the tile's own normal for the rest.
fn facing(label: Label, patch: &Patch, placed: &SurfaceEvaluator, d: f64) -> f64 {
    let part = match label {
        Label::Cylinder => Part::Cylinder,
        Label::Cone => Part::Cone,
        _ => return patch.normal.dot(&patch.q).abs().max(0.02),
    };
    let at = placed.local_of(placed.to_silo(&patch.at(d)), part);
    (at.gradient.dot(&placed.turn(&patch.q)) / at.gradient.norm()).abs().max(0.02)
}
