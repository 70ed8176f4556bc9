//! Tiles of a cloud's wall: the points near the surface that was found, by where they lie on it.
//!
//! Voxels cut through a noisy wall, sort its points by their noise, and have their mean off a curved wall. Tiles of the
//! surface take points as far before it as behind it.

use crate::Vec3;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::Parameters;
use crate::geometry::surface::{Part, SiloSurface};
use crate::stats::robust::{MAD_TO_STD, upper_median};
use crate::surface_fit::equation::{Equation, TileEquation};
use crate::surface_fit::solver::{Fit, Prior, Problem};
use crate::surface_fit::tiles::{DOWN, NONE, Patch, Patches, RIGHT};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Points further from their tile's median than so many standard deviations are something else.
const REACH: f64 = 4.0;
/// Smallest standard deviation of a point, metres.
const FINEST: f64 = 1e-6;
/// Fraction of a tile's points that must lie in voxels of the wall.
const LEAST_WALL: f64 = 0.9;
/// As many points of usual scatter are counted among a tile's.
const USUAL: f64 = 8.0;
/// Degrees of freedom from which on points tell their scatter about their tile's mean.
const ENOUGH: f64 = 30.0;

/// A point near the surface: its index, its distance from it, and whether its voxel is wall.
type Near = (usize, f64, bool);

/// Place of a tile: cone, row along the wall, sector about the axis.
type Place = (bool, i64, i64);

/// What of a cloud lies near the wall that was found on its voxels.
#[derive(Debug, Clone)]
pub struct CloudWall<'a> {
    /// The points, camera frame, metres.
    pub points: Cow<'a, [Vec3]>,
    /// For each whether its voxel is wall.
    pub on_wall: &'a [bool],
    /// Side of a tile, metres; points further from the surface are left out.
    pub grid: f64,
    /// Whether a camera in the origin has seen it, along whose rays the points scatter.
    pub by_rays: bool,
}

/// The wall in tiles of a surface, and the mean distance of each one's points from it, metres.
#[derive(Debug, Clone, Default)]
pub struct WallTiles {
    /// A patch for each tile.
    pub patches: Patches,
    distances: Vec<f64>,
}

impl CloudWall<'_> {
    /// The wall in tiles of a surface.
    pub fn tiles(&self, surface: SiloSurface) -> WallTiles {
        let placed = SurfaceEvaluator::new(surface);
        let sectors = self.sectors(&placed);
        let mut near: BTreeMap<Place, Vec<Near>> = BTreeMap::new();
        for ((number, point), &on_wall) in self.points.iter().enumerate().zip(self.on_wall) {
            let at = placed.local(point);
            let stretch = at.gradient.norm();
            let (cone, distance) = (at.part == Part::Cone, at.value / stretch);
            let beside_joint = (at.p.z - placed.bottom()).abs() < self.grid;
            if distance.abs() < self.grid && !beside_joint {
                let turn = at.p.y.atan2(at.p.x) / TAU + 0.5;
                let place =
                    (cone, (at.p.z * stretch / self.grid).floor() as i64, (turn * sectors[usize::from(cone)]) as i64);
                near.entry(place).or_default().push((number, distance, on_wall));
            }
        }
        let found = near.iter().filter_map(|(place, near)| Some((*place, self.tile(&placed, near)?)));
        arranged(found.collect(), sectors)
    }

    /// Sectors about the axis, as wide as tiles are high in the middle of each part's wall.
    fn sectors(&self, placed: &SurfaceEvaluator) -> [f64; 2] {
        let mut radii = [Vec::new(), Vec::new()];
        for (point, _) in self.points.iter().zip(self.on_wall).filter(|(_, on_wall)| **on_wall) {
            let at = placed.local(point);
            radii[usize::from(at.part == Part::Cone)].push(at.p.xy().norm());
        }
        radii.map(|mut radii| upper_median(&mut radii).map_or(1.0, |radius| (TAU * radius / self.grid).ceil()))
    }

    /// The points of a tile that agree: their patch and their mean distance; `None` where most of them are no wall.
    fn tile(&self, placed: &SurfaceEvaluator, near: &[Near]) -> Option<(Patch, f64)> {
        let of_wall = near.iter().filter(|(_, _, on_wall)| *on_wall).count();
        if (of_wall as f64) < LEAST_WALL * near.len() as f64 {
            return None;
        }
        let middle = upper_median(&mut near.iter().map(|one| one.1).collect::<Vec<_>>())?;
        let spread = upper_median(&mut near.iter().map(|one| (one.1 - middle).abs()).collect::<Vec<_>>())?;
        let reach = REACH * (MAD_TO_STD * spread).max(FINEST);
        let (mut sum, mut count, mut total, mut squares) = (Vec3::zeros(), 0.0, 0.0, 0.0);
        for (number, distance, _) in near.iter().filter(|one| (one.1 - middle).abs() <= reach) {
            sum += self.points.get(*number)?;
            count += 1.0;
            total += distance - middle;
            squares += (distance - middle).powi(2);
        }
        let (mut origin, about) = (sum / count, squares - total * total / count);
        let outwards = placed.surface.pose.rotation().transpose() * placed.local(&origin).gradient.normalize();
        if self.by_rays {
            // on the wall, derivatives do not carry the points' own noise
            origin -= origin * ((middle + total / count) / outwards.dot(&origin));
        }
        let normal = if outwards.dot(&origin) > 0.0 { -outwards } else { outwards };
        let scatter = (about / f64::max(count - 1.0, 1.0)).max(0.0).sqrt();
        let (q, tile) = (normal, (0, 0));
        let patch = Patch { q, measured: 0.0, origin, normal, sigma_normal: 0.0, scatter, count, smooth: true, tile };
        Some((patch, middle + total / count))
    }
}

/// Tiles in rows and columns, with the next one to the right and below of each.
fn arranged(found: Vec<(Place, (Patch, f64))>, sectors: [f64; 2]) -> WallTiles {
    let columns = sectors[0].max(sectors[1]) as usize + 1;
    let top = found.iter().map(|((_, row, _), _)| *row).min().unwrap_or(0);
    let index: BTreeMap<Place, u32> = found.iter().map(|(place, _)| *place).zip(0..).collect();
    let mut tiles = WallTiles::default();
    (tiles.patches.side, tiles.patches.columns, tiles.patches.cloud) = (1, columns, true);
    for ((cone, row, sector), (patch, distance)) in found {
        let next = |down: i64, right: i64| index.get(&(cone, row + down, sector + right)).copied().unwrap_or(NONE);
        let mut neighbours = [NONE; 8];
        (neighbours[RIGHT], neighbours[DOWN]) = (next(0, 1), next(1, 0));
        tiles.patches.list.push(Patch { tile: (sector as u32, (row - top) as u32), ..patch });
        tiles.patches.neighbours.push(neighbours);
        tiles.distances.push(distance);
    }
    tiles
}

/// Derivative of a tile's distance from the wall by the depth bias, where that is not known and a camera in the origin has
/// seen it.
fn by_bias(prior: &Prior, fit: &Fit, placed: &SurfaceEvaluator, seen: &Patch) -> Parameters {
    let mut row = Parameters::zeros();
    if prior.bias_std != [0.0; 3] {
        let (at, d) = (placed.local(&seen.origin), seen.origin.z);
        let rate = at.gradient.normalize().dot(&placed.turn(&(seen.origin / d))) / fit.bias.slope(d);
        (row[7], row[8], row[9]) = (-rate, -rate * d, -rate * d * d);
    }
    row
}

impl WallTiles {
    /// An equation for each tile.
    pub fn equations(&self, problem: &Problem, fit: &Fit) -> Vec<TileEquation> {
        let placed = SurfaceEvaluator::new(fit.surface);
        let usual = self.usual_variance();
        let equation = |(patch, seen): (usize, &Patch)| {
            let equation = problem.equation(fit, &placed, patch)?;
            let freedom = (seen.count - 1.0).max(0.0);
            let squares = seen.scatter * seen.scatter * freedom + USUAL * usual;
            let single = (squares / (freedom + USUAL)).max(FINEST * FINEST);
            let (noise, spread) = (single / seen.count, 1.0 / equation.cosine);
            let residual = *self.distances.get(patch)?;
            let jacobian = equation.jacobian + by_bias(problem.prior, fit, &placed, seen);
            Some(TileEquation {
                patch,
                equation: Equation { residual, jacobian, variance: noise, ..equation },
                noise,
                spread,
            })
        };
        self.patches.list.iter().enumerate().filter_map(equation).collect()
    }

    /// Variance of a point about its tile's mean, over all tiles, m²; that of the means where tiles have single points.
    fn usual_variance(&self) -> f64 {
        let freedom = |patch: &Patch| (patch.count - 1.0).max(0.0);
        let total: f64 = self.patches.list.iter().map(freedom).sum();
        if total >= ENOUGH {
            return self.patches.list.iter().map(|p| p.scatter * p.scatter * freedom(p)).sum::<f64>() / total;
        }
        let spread = upper_median(&mut self.distances.iter().map(|d| d.abs()).collect::<Vec<_>>());
        spread.map_or(0.0, |spread| (MAD_TO_STD * spread).powi(2))
    }
}
