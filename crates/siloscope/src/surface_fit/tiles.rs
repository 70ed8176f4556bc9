//! Patches: the frame in small pieces, each with its mean position, its normal and how sure both are.
//!
//! A depth image is cut into square tiles and a plane is fitted to each, against pixels that don't belong to it
//! (dust, edges). Everything up to the last step of the surface fit works on a few thousand patches, not pixels.

use crate::Vec3;
use crate::geometry::depth_image::DepthImage;
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::stats::robust::{MEDIAN_OF_CHI_SQUARE, median};
pub use crate::surface_fit::tile_plane::MAX_SIDE;
use crate::surface_fit::tile_plane::{Tile, robust_tile, tiles};
use crate::surface_fit::tile_rays::TileRays;

/// A small piece of surface.
#[derive(Debug, Clone, Copy)]
pub struct Patch {
    /// Direction along which the position is uncertain: the ray with z = 1 (image), the normal (cloud).
    pub q: Vec3,
    /// Measured position along `q` of the patch's centre: depth (image); 0 (cloud).
    pub measured: f64,
    /// Where `q` starts: the camera (image), the mean point (cloud).
    pub origin: Vec3,
    /// Unit normal towards the camera.
    pub normal: Vec3,
    /// Standard deviation of the normal's direction, radians.
    pub sigma_normal: f64,
    /// Scatter of the single measurements about the patch's plane, metres along `q`.
    pub scatter: f64,
    /// Number of measurements.
    pub count: f64,
    /// Whether one plane describes the patch.
    pub smooth: bool,
    /// Position in the grid of tiles (column, row); (0, 0) for clouds.
    pub tile: (u32, u32),
}

impl Patch {
    /// The centre for a given value along `q`.
    #[inline]
    pub fn at(&self, s: f64) -> Vec3 {
        self.origin + self.q * s
    }
}

/// Places of two of a patch's eight neighbours.
pub const RIGHT: usize = 4;
/// The one below.
pub const DOWN: usize = 6;

/// No neighbour: outside the image, or without depth.
pub const NONE: u32 = u32::MAX;

/// The patches of a frame and who lies beside whom.
#[derive(Debug, Clone, Default)]
pub struct Patches {
    /// The patches.
    pub list: Vec<Patch>,
    /// Their rays (images).
    pub rays: Vec<TileRays>,
    /// The eight neighbours of each; `NONE` where there is none.
    pub neighbours: Vec<[u32; 8]>,
    /// Side of a tile in pixels (images).
    pub side: usize,
    /// Tiles per row (images).
    pub columns: usize,
    /// Variance of a tile's mean over that of as many independent pixels (images).
    pub common_noise: f64,
    /// Whether these come from a cloud without rays.
    pub cloud: bool,
}

/// Side of the tiles: about 80 of them across the image, or as few as 40 where they would be narrower than 8 pixels.
pub fn tile_side(width: usize) -> usize {
    let across = |tiles: f64| (width as f64 / tiles).round() as usize;
    across(80.0).max(across(40.0).min(8)).clamp(4, MAX_DENSE_SIDE)
}

/// Largest side of a tile that has most of its pixels.
const MAX_DENSE_SIDE: usize = 16;
/// A tile of this fraction of its pixels tells as much as is needed: where fewer are there, tiles are larger.
const DENSE: f64 = 0.5;
/// Fraction of the expected pixels that a tile needs, and that a smooth one has.
const ENOUGH: f64 = 0.3;
const MOST: f64 = 0.5;

/// Fraction of the pixels that were measured where any was: over squares of a tile's size that have one at least.
fn density(image: &DepthImage, side: usize) -> f64 {
    let is_there = |z: &&f32| **z > 0.0 && **z < f32::INFINITY;
    let (mut measured, mut squares) = (0, 0);
    let mut band = vec![0usize; image.width / side];
    for rows in image.depth.chunks_exact(image.width * side) {
        band.fill(0);
        for row in rows.chunks_exact(image.width) {
            for (count, depths) in band.iter_mut().zip(row.chunks_exact(side)) {
                *count += depths.iter().filter(is_there).count();
            }
        }
        measured += band.iter().sum::<usize>();
        squares += band.iter().filter(|n| **n > 0).count();
    }
    measured as f64 / (squares * side * side).max(1) as f64
}

/// Side of the tiles for a density, and the pixels that are expected in one.
fn sparse_side(side: usize, density: f64) -> (usize, f64) {
    let wider = side as f64 * (DENSE / density.max(1e-3)).sqrt().max(1.0);
    let side = (wider.round() as usize).min(MAX_SIDE);
    (side, (side * side) as f64 * if density < DENSE { density } else { 1.0 })
}

/// Cuts a depth image into tiles. `noise` is the expected noise where it is known.
pub fn tile_patches(image: &DepthImage, noise: Option<&NoiseLaw>) -> Patches {
    let dense = tile_side(image.width);
    let (side, pixels) = sparse_side(dense, density(image, dense));
    let (columns, rows) = (image.width / side, image.height / side);
    let place = |i: usize| ((i % columns) * side, (i / columns) * side);
    let mut tiles = tiles(image, side, (columns, rows), ENOUGH * pixels);
    let law = noise.copied().unwrap_or_else(|| noise_of(&tiles));
    for (i, tile) in tiles.iter_mut().enumerate() {
        if let Some(rough) = tile.filter(|t| t.scatter > 1.5 * law.sigma(t.depth()) + 3e-4 * t.depth()) {
            *tile = Some(robust_tile(image, place(i), side).unwrap_or(rough));
        }
    }
    let common_noise = common_noise(&tiles, columns, &law);
    let n = tiles.iter().flatten().count();
    let (list, rays) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let mut patches = Patches { list, rays, side, columns, common_noise, ..Patches::default() };
    let mut index = vec![NONE; columns * rows];
    for (i, index) in index.iter_mut().enumerate() {
        if let Some((patch, rays)) =
            patch(image, &tiles, (i % columns, i / columns), (columns, rows), (side, common_noise, MOST * pixels))
        {
            *index = patches.list.len() as u32;
            patches.list.push(patch);
            patches.rays.push(rays);
        }
    }
    patches.neighbours = patches.list.iter().map(|p| neighbours(&index, p.tile, columns, rows)).collect();
    patches
}

fn noise_of(tiles: &[Option<Tile>]) -> NoiseLaw {
    let mut samples: Vec<(f64, f64)> = tiles.iter().flatten().map(|t| (t.depth(), t.scatter)).collect();
    noise_from_scatter(&mut samples, 1e-4)
}

/// Most relief that walls have, metres: corrugated sheet 13 mm deep has 4.6 mm. What scatters more is the sensor.
pub const DEEPEST: f64 = 5e-3;

/// Variance of a tile's mean over that of as many independent pixels; 1 where they are independent.
///
/// What neighbouring pixels' noise has in common does not average out within a tile. Third differences between the tiles
/// of a row show it: a smooth surface has next to none, edges are few, and no wall's relief makes more than `DEEPEST`.
fn common_noise(tiles: &[Option<Tile>], columns: usize, law: &NoiseLaw) -> f64 {
    const PLAIN: f64 = 1.5; // chance and the surface's own shape reach this
    let ratio = |relief: f64| {
        let rows = tiles.chunks(columns.max(1)); // none in an image smaller than a tile
        let differences = rows.flat_map(|row| row.windows(4).filter_map(|four| third_difference(four, law, relief)));
        median(differences.collect()).unwrap_or(1.0)
    };
    if ratio(DEEPEST) > PLAIN { ratio(0.0) } else { 1.0 }
}

/// Square of the third difference of four tiles' depths over what is expected of independent noise and of relief.
fn third_difference(four: &[Option<Tile>], law: &NoiseLaw, relief: f64) -> Option<f64> {
    let [Some(a), Some(b), Some(c), Some(d)] = four else { return None };
    let bend = a.plane.a - d.plane.a + 3.0 * (c.plane.a - b.plane.a);
    let variance = |t: &Tile| law.sigma(t.depth()).powi(2) / t.sums.n + relief * relief;
    let expected = variance(a) + 9.0 * (variance(b) + variance(c)) + variance(d);
    Some(bend * bend / (MEDIAN_OF_CHI_SQUARE * expected))
}

/// The patch of one tile; its normal comes from the tile and those neighbours that continue its plane.
fn patch(
    image: &DepthImage,
    tiles: &[Option<Tile>],
    (column, row): (usize, usize),
    (columns, rows): (usize, usize),
    (side, common, most): (usize, f64, f64),
) -> Option<(Patch, TileRays)> {
    let tile = tiles[row * columns + column].as_ref()?;
    let Tile { sums: own, plane, scatter } = *tile;
    let depth = tile.depth();
    let step = side as f64;
    let mut pooled = own;
    let mut joined = 1;
    for dv in -1i64..=1 {
        for du in -1i64..=1 {
            let (c, r) = (column as i64 + du, row as i64 + dv);
            if (du, dv) == (0, 0) || c < 0 || r < 0 || c >= columns as i64 || r >= rows as i64 {
                continue;
            }
            if let Some(Tile { sums: other, .. }) = &tiles[r as usize * columns + c as usize] {
                let (u, v) = (du as f64 * step + other.u / other.n, dv as f64 * step + other.v / other.n);
                let gap = other.z / other.n - plane.a - plane.b * u - plane.c * v;
                if gap.abs() < 3.0 * scatter + 0.01 * depth {
                    pooled.add_shifted(other, du as f64 * step, dv as f64 * step);
                    joined += 1;
                }
            }
        }
    }
    let wide = pooled.plane()?;
    let (mu, mv) = (own.u / own.n, own.v / own.n);
    let z = depth;
    let rays = TileRays::of(image, row * side * image.width + column * side, side, [wide, plane]);
    let steps = rays.steps(side);
    let [q_u, q_v] = &steps;
    let q = rays.mean() + q_u * mu + q_v * mv;
    let (normal, length) = normal_of(&q, z, rays.slopes, &steps)?;
    let spread = (pooled.uu - pooled.u * pooled.u / pooled.n).min(pooled.vv - pooled.v * pooled.v / pooled.n);
    let sigma_slope = scatter * (common / spread.max(1e-9)).sqrt();
    let sigma_normal = sigma_slope * z * (q_u.norm() + q_v.norm()) / 1.4 / length;
    let patch = Patch {
        q,
        measured: z,
        origin: Vec3::zeros(),
        normal,
        sigma_normal,
        scatter,
        count: own.n,
        smooth: joined >= 3 && own.n >= most,
        tile: (column as u32, row as u32),
    };
    Some((patch, rays))
}

/// Normal of the surface with depth z and slopes on ray q, towards the camera; and the length of the tangents' product.
fn normal_of(q: &Vec3, z: f64, slopes: [f64; 2], steps: &[Vec3; 2]) -> Option<(Vec3, f64)> {
    let normal = (q * slopes[0] + steps[0] * z).cross(&(q * slopes[1] + steps[1] * z));
    let length = normal.norm();
    let side = if normal.dot(q) > 0.0 { -1.0 } else { 1.0 };
    (length > 0.0).then(|| (normal * (side / length), length))
}

impl Patches {
    /// Works out the normals again for depths freed from their bias.
    pub fn unbias_normals(&mut self, bias: &DepthBias) {
        for (patch, rays) in self.list.iter_mut().zip(&self.rays) {
            let d = bias.true_depth(patch.measured);
            let slope = bias.slope(d);
            let slopes = rays.slopes.map(|s| s / slope);
            if let Some((normal, _)) = normal_of(&patch.q, d, slopes, &rays.steps(self.side)) {
                patch.normal = normal;
            }
        }
    }
}

fn neighbours(index: &[u32], (column, row): (u32, u32), columns: usize, rows: usize) -> [u32; 8] {
    const AROUND: [(i64, i64); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    AROUND.map(|(du, dv)| {
        let (c, r) = (i64::from(column) + du, i64::from(row) + dv);
        let inside = c >= 0 && r >= 0 && c < columns as i64 && r < rows as i64;
        if inside { index[r as usize * columns + c as usize] } else { NONE }
    })
}

/// Noise law that explains the patches' own scatter: σ² = a² + b²·d⁴, from medians over depth.
pub fn noise_from_scatter(samples: &mut [(f64, f64)], floor: f64) -> NoiseLaw {
    const BINS: usize = 8;
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = samples.len().div_ceil(BINS).max(1);
    let (mut n, mut x, mut xx, mut y, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for bin in samples.chunks_mut(size) {
        let middle = bin.len() / 2;
        let depth = bin[middle].0;
        let (_, &mut (_, sigma), _) = bin.select_nth_unstable_by(middle, |a, b| a.1.total_cmp(&b.1));
        let (d4, s2) = (depth.powi(4), sigma * sigma);
        n += 1.0;
        x += d4;
        xx += d4 * d4;
        y += s2;
        xy += d4 * s2;
    }
    if n == 0.0 {
        return NoiseLaw::uniform(floor);
    }
    let det: f64 = n * xx - x * x;
    let slope = if det > 1e-12 * n * xx { ((n * xy - x * y) / det).max(0.0) } else { 0.0 };
    let constant = ((y - slope * x) / n).max(0.0);
    let slope = if constant == 0.0 && x > 0.0 { slope.min(y / x) } else { slope };
    NoiseLaw {
        floor: floor.max(constant.sqrt()),
        constant: 0.0,
        linear: 0.0,
        quadratic: slope.sqrt(),
        power_factor: 0.0,
        power: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_of_small_images_stay_wide_enough_for_a_plane() {
        let sides = [[80, 4], [160, 4], [224, 6], [320, 8], [512, 8], [640, 8], [1024, 13], [4096, MAX_DENSE_SIDE]];
        for [width, side] in sides {
            assert_eq!(tile_side(width), side, "{width}");
        }
    }
}
