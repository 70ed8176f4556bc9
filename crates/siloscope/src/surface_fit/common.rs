//! What the residuals of neighbouring tiles have in common: a wall's dents and stuck feed, or a sensor's smoothed noise.

use crate::surface_fit::equation::TileEquation;
use crate::surface_fit::solver::tukey;
use crate::surface_fit::tiles::{DOWN, NONE, Patches, RIGHT};

/// A share of so many standard deviations is none by chance.
const CERTAIN: f64 = 3.0;
/// Where tiles two apart have more than this share of the misfit in common, all of it is the wall's.
const MOST: f64 = 0.5;
/// How many tiles apart they are in a cloud.
const APART_IN_CLOUDS: usize = 4;
/// And at least this share of it always.
const LEAST: f64 = 0.25;

/// By how much larger the variance of many tiles together is because neighbours' residuals have something in common.
pub fn variance_of_neighbours(patches: &Patches, tiles: &[TileEquation]) -> f64 {
    let pulls = OfTiles::new(patches, tiles, |tile| tile.pull() * tile.equation.variance.sqrt());
    let own = tiles.iter().map(|tile| pulls.values[tile.patch].powi(2)).sum::<f64>() / tiles.len().max(1) as f64;
    let along = |direction: usize| {
        let shares = [1, 2].map(|apart| {
            let (product, pairs) = pulls.product(direction, apart);
            let share = product / own.max(1e-300);
            if share * pairs.sqrt() > CERTAIN { share } else { 0.0 }
        });
        1.0 + 2.0 * shares.iter().sum::<f64>()
    };
    along(RIGHT) * along(DOWN)
}

/// How much of the misfit is the wall's or a lasting warp's, metres across the wall.
///
/// All of it where neighbouring pixels' noise is independent, as what is warped over many tiles is mostly evened out into
/// the fit and leaves less in the residuals than it does; else what tiles two apart have in common, as the rest is noise.
/// Tiles of a cloud are as small as the caller likes, and may share noise with more of their neighbours.
pub fn lasting_misfit(patches: &Patches, misfit: f64, tiles: &[TileEquation]) -> f64 {
    if patches.common_noise == 1.0 {
        return misfit;
    }
    let across = OfTiles::new(patches, tiles, |tile| {
        let e = &tile.equation;
        e.residual / tile.spread * tukey(e.residual * e.residual / e.variance)
    });
    let apart = if patches.cloud { APART_IN_CLOUDS } else { 2 };
    let [(right, right_pairs), (down, down_pairs)] = [RIGHT, DOWN].map(|direction| across.product(direction, apart));
    let product = (right * right_pairs + down * down_pairs) / f64::max(right_pairs + down_pairs, 1.0);
    let common = product.max(0.0).sqrt();
    if common > MOST * misfit { misfit } else { common.max(LEAST * misfit) }
}

/// A value of each tile, by its patch; 0 where there is none.
struct OfTiles<'a> {
    patches: &'a Patches,
    tiles: &'a [TileEquation],
    values: Vec<f64>,
}

impl<'a> OfTiles<'a> {
    fn new(patches: &'a Patches, tiles: &'a [TileEquation], value: impl Fn(&TileEquation) -> f64) -> Self {
        let mut values = vec![0.0; patches.list.len()];
        for tile in tiles {
            values[tile.patch] = value(tile);
        }
        Self { patches, tiles, values }
    }

    /// Mean product of tiles so many apart in a direction, and how many such pairs there are.
    fn product(&self, direction: usize, apart: usize) -> (f64, f64) {
        let beside = |i: usize| match self.patches.neighbours[i][direction] {
            NONE => None,
            j => Some(j as usize),
        };
        let (mut product, mut pairs) = (0.0, 0.0);
        for TileEquation { patch, .. } in self.tiles {
            let other = (0..apart).try_fold(*patch, |i, _| beside(i)).map(|i| self.values[i]);
            if let Some(other) = other.filter(|value| *value != 0.0) {
                product += self.values[*patch] * other;
                pairs += 1.0;
            }
        }
        (product / f64::max(pairs, 1.0), pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::depth_image::DepthImage;
    use crate::geometry::parameters::Parameters;
    use crate::geometry::surface::Part;
    use crate::surface_fit::solver::Equation;
    use crate::surface_fit::tiles::tile_patches;

    const SIDE: usize = 60;

    /// A square of tiles whose residuals, metres, depend on their column and row.
    fn with_tiles<T>(residual: impl Fn(usize, usize) -> f64, ask: impl Fn(&Patches, &[TileEquation]) -> T) -> T {
        let (width, height) = (8 * SIDE, 8 * SIDE);
        let ray = |i: usize| [(i % width) as f64 / 500.0, (i / width) as f64 / 500.0];
        let (rays, depth): (Vec<_>, _) = ((0..width * height).map(ray).collect(), vec![2.0f32; width * height]);
        let patches = tile_patches(&DepthImage::with_rays(&depth, &rays, width, height).expect("sizes agree"), None);
        assert_eq!(patches.list.len(), SIDE * SIDE);
        let patches = Patches { common_noise: 2.0, ..patches };
        let equation = |i: usize| {
            let (column, row) = patches.list[i].tile;
            let residual = residual(column as usize, row as usize);
            let (jacobian, variance) = (Parameters::zeros(), 1e-4);
            Equation { residual, jacobian, variance, cosine: 1.0, part: Part::Cone, z: 1.0, across: [1.0, 0.0] }
        };
        let tile = |i: usize| TileEquation { patch: i, equation: equation(i), noise: 1e-6, spread: 1.0 };
        ask(&patches, &(0..patches.list.len()).map(tile).collect::<Vec<_>>())
    }

    /// Independent draws from −1 to 1 mm.
    fn chance(column: usize, row: usize) -> f64 {
        let mut mixed = (column * SIDE * 2 + row) as u64;
        for factor in [0x9E37_79B9_7F4A_7C15, 0xBF58_476D_1CE4_E5B9, 0x94D0_49BB_1331_11EB] {
            mixed = (mixed + 1).wrapping_mul(factor);
            mixed ^= mixed >> 31;
        }
        1e-3 * ((mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }

    #[test]
    fn independent_tiles_have_nothing_in_common() {
        assert_eq!(with_tiles(chance, variance_of_neighbours), 1.0);
        let lasting = with_tiles(chance, |patches, tiles| lasting_misfit(patches, 1e-3, tiles));
        assert!((lasting - LEAST * 1e-3).abs() < 1e-6, "{lasting}");
    }

    #[test]
    fn means_of_two_tiles_each_way_have_half_of_their_variance_in_common_with_the_next() {
        let two = |c: usize, r: usize| chance(c, r) + chance(c + 1, r) + chance(c, r + 1) + chance(c + 1, r + 1);
        let found = with_tiles(two, variance_of_neighbours);
        assert!((found - 4.0).abs() < 0.4, "{found}"); // (1 + 2/2)² of the whole
        assert!(with_tiles(two, |patches, tiles| lasting_misfit(patches, 1e-3, tiles)) < 0.3e-3);
    }

    #[test]
    fn dents_of_many_tiles_are_the_walls() {
        let dents = |c: usize, r: usize| chance(c / 7 * 13, r / 7 * 17);
        assert_eq!(with_tiles(dents, |patches, tiles| lasting_misfit(patches, 0.6e-3, tiles)), 0.6e-3);
    }
}
