//! The last step's residuals: every pixel of the wall's tiles against the exact ray–surface intersection.

use crate::geometry::depth_image::DepthImage;
use crate::geometry::sensor::DepthBias;
use crate::surface_fit::tile_rays::TileRays;
use crate::surface_fit::tiles::{MAX_SIDE, Patch, Patches};

/// Mean residual of a tile's pixels; no count where the tile does not lie wholly on one part of the wall.
#[derive(Debug, Clone, Copy, Default)]
pub struct TileResidual {
    /// Number of pixels that agree.
    pub count: f64,
    /// Mean residual m − f(d), metres along the ray.
    pub mean: f64,
    /// Standard deviation of the pixels about their mean.
    pub scatter: f64,
}

/// How the pixels of a tile are taken: every `stride`-th row, without those that are further than `reach` metres off.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// Step between rows.
    pub stride: usize,
    /// Largest residual that still counts, metres along the ray.
    pub reach: f64,
}

/// Mean residual of tile `i` over its pixels against a wall whose true depth on a ray is `depth`, where `on_part` tells
/// whether a ray ends there.
pub fn tile_residual(
    image: &DepthImage,
    patches: &Patches,
    i: usize,
    bias: &DepthBias,
    sampling: Sampling,
    on_part: impl Fn([f64; 2], f64) -> bool,
    depth: impl Fn([f64; 2]) -> f64,
) -> TileResidual {
    Tile::of(image, patches, i, bias, sampling).residual(on_part, depth)
}

struct Tile<'a> {
    image: &'a DepthImage<'a>,
    patch: &'a Patch,
    corner: usize,
    side: usize,
    rays: &'a TileRays,
    bias: &'a DepthBias,
    sampling: Sampling,
}

/// How far the quadratic through nine depths may be off the wall inside a tile, metres.
///
/// The nine lie symmetrically, so that the cubic rest has no mean over the tile, and only the mean is used.
const QUADRATIC_REST: f64 = 5e-5;

impl<'a> Tile<'a> {
    fn of(image: &'a DepthImage<'a>, patches: &'a Patches, i: usize, bias: &'a DepthBias, sampling: Sampling) -> Self {
        let (patch, side) = (&patches.list[i], patches.side);
        let corner = patch.tile.1 as usize * side * image.width + patch.tile.0 as usize * side;
        Self { image, patch, corner, side, rays: &patches.rays[i], bias, sampling }
    }

    #[inline(always)]
    fn residual(&self, on_part: impl Fn([f64; 2], f64) -> bool, depth: impl Fn([f64; 2]) -> f64) -> TileResidual {
        let (mut nodes, mut whole) = ([0.0; 9], true);
        for (measured, ray) in nodes.iter_mut().zip(self.rays.nodes()) {
            let d = depth(ray);
            whole &= d > 0.0 && on_part(ray, d);
            *measured = self.bias.measured(d);
        }
        if !whole {
            return TileResidual::default();
        }
        let base = nodes[4] as f32;
        let above = |measured: f64| (measured - f64::from(base)) as f32;
        let seen = |ray: [f64; 2]| above(self.bias.measured(depth(ray)));
        let smooth = Quadratic::through(&nodes, base, self.side);
        let rest = |(at, ray): (f32, [f64; 2])| f64::from((smooth.row(at).value(at) - seen(ray)).abs());
        if self.rays.probes(self.side).into_iter().any(|probe| rest(probe) > QUADRATIC_REST) {
            let seen = |u: usize, v: usize| seen(self.image.ray(self.corner + v * self.image.width + u));
            let exact = |v: usize| std::array::from_fn(|u| if u < self.side { seen(u, v) } else { f32::NAN });
            return self.mean::<MAX_SIDE>(base, exact);
        }
        if let Some(mean) = self.mean_of_sums(&nodes) {
            return mean;
        }
        match self.side {
            ..=8 => self.mean::<8>(base, |v| smooth.row(v as f32).values()),
            9..=16 => self.mean::<16>(base, |v| smooth.row(v as f32).values()),
            _ => self.mean::<MAX_SIDE>(base, |v| smooth.row(v as f32).values()),
        }
    }

    /// The mean residual by the tile's own sums, where every pixel is there and they scatter too little for any to be out
    /// of reach.
    ///
    /// The pixels' scatter about the wall is that about their own plane, with that plane's slope against the wall's, and
    /// without the wall's bend, which the pixels follow.
    #[inline(always)]
    fn mean_of_sums(&self, wall: &[f64; 9]) -> Option<TileResidual> {
        let (n, side) = (self.patch.count, self.side as f64);
        let grid = Grid::of(side);
        let even = (self.sampling.reach / EVEN).powi(2);
        let bend = grid.bend(wall);
        let about_plane = (n - 3.0) * self.patch.scatter * self.patch.scatter - n * bend;
        if n < side * side || bend > BENT * even || about_plane > (n - 3.0) * even {
            return None;
        }
        let mean = self.patch.measured - grid.mean(wall);
        if mean.abs() > self.sampling.reach {
            return Some(TileResidual::default());
        }
        let [own, of_wall] = [self.rays.own_slopes, grid.slopes(wall)];
        let tilt = (own[0] - of_wall[0]).powi(2) + (own[1] - of_wall[1]).powi(2);
        let squares = about_plane + n * tilt * (side * side - 1.0) / 12.0;
        Some(TileResidual { count: n, mean, scatter: (squares.max(0.0) / (n - 1.0)).sqrt() })
    }

    /// Mean of the residuals that agree with what the wall measures in each row, in metres above `base`.
    ///
    /// Above a depth of the same tile, single precision resolves some nanometres.
    #[inline(always)]
    fn mean<const N: usize>(&self, base: f32, wall: impl Fn(usize) -> [f32; N]) -> TileResidual {
        let reach = self.sampling.reach as f32;
        let (mut count, mut sum, mut squares) = ([0.0f32; N], [0.0f32; N], [0.0f32; N]);
        for v in (0..self.side).step_by(self.sampling.stride) {
            let depths = self.image.row::<N>(self.corner + v * self.image.width, self.side);
            let wall = wall(v);
            for u in 0..N {
                let residual = (depths[u] - base) - wall[u];
                let counts = (depths[u] > 0.0) & (residual.abs() < reach);
                let kept = if counts { residual } else { 0.0 };
                count[u] += if counts { 1.0 } else { 0.0 };
                sum[u] += kept;
                squares[u] += kept * kept;
            }
        }
        let [n, sum, squares] = [count, sum, squares].map(|lanes| lanes.iter().map(|&of| f64::from(of)).sum::<f64>());
        if n < 3.0 {
            return TileResidual::default();
        }
        let mean = sum / n;
        TileResidual { count: n, mean, scatter: ((squares - sum * mean).max(0.0) / (n - 1.0)).sqrt() }
    }
}

/// How many of their standard deviations the pixels of a tile may be off before it is asked which of them agree.
const EVEN: f64 = 3.2;

/// How much of that variance the wall's bend may be: what the noise has in common with it would be taken for scatter.
const BENT: f64 = 0.03;

/// The pixels of a tile, at t from −1 to 1 both ways, with nine values of a quadratic at −1, 0 and 1.
struct Grid {
    last: f64,
    /// Mean of t² over the pixels, and variance of t².
    square: f64,
    spread: f64,
}

impl Grid {
    #[inline(always)]
    fn of(side: f64) -> Self {
        let (last, n2) = (side - 1.0, side * side);
        let square = (n2 - 1.0) / (3.0 * last * last);
        Self { last, square, spread: square * (3.0 * n2 - 7.0) / (5.0 * last * last) - square * square }
    }

    /// Mean over three values, at −1, 0 and 1.
    #[inline(always)]
    fn mean_of(&self, [start, middle, end]: [f64; 3]) -> f64 {
        middle + self.square * (0.5 * (start + end) - middle)
    }

    /// Mean over the pixels.
    #[inline(always)]
    fn mean(&self, [nw, n, ne, w, c, e, sw, s, se]: &[f64; 9]) -> f64 {
        self.mean_of([[*nw, *n, *ne], [*w, *c, *e], [*sw, *s, *se]].map(|row| self.mean_of(row)))
    }

    /// Change per pixel along u and v.
    #[inline(always)]
    fn slopes(&self, [nw, n, ne, w, _, e, sw, s, se]: &[f64; 9]) -> [f64; 2] {
        [[ne - nw, e - w, se - sw], [sw - nw, s - n, se - ne]].map(|steps| self.mean_of(steps) / self.last)
    }

    /// Variance about the plane through the pixels.
    #[inline(always)]
    fn bend(&self, [nw, n, ne, w, c, e, sw, s, se]: &[f64; 9]) -> f64 {
        let (across, down) = (0.5 * (w + e) - c, 0.5 * (n + s) - c);
        let twist = 0.25 * (nw - ne - sw + se);
        (across * across + down * down) * self.spread + (twist * self.square).powi(2)
    }
}

/// A polynomial of second degree in u and v each, over a tile.
struct Quadratic {
    /// Along u, of the rows v = 0, (side − 1)/2 and side − 1.
    rows: [Parabola; 3],
    last: f32,
}

/// a + b·u + c·u².
#[derive(Clone, Copy)]
struct Parabola {
    a: f32,
    b: f32,
    c: f32,
}

impl Parabola {
    /// Through the values at 0, `last`/2 and `last`.
    #[inline(always)]
    fn through([start, middle, end]: [f32; 3], last: f32) -> Self {
        let c = 2.0 * (start - 2.0 * middle + end) / (last * last);
        Self { a: start, b: (end - start) / last - c * last, c }
    }

    #[inline(always)]
    fn value(&self, u: f32) -> f32 {
        self.a + u * (self.b + u * self.c)
    }

    #[inline(always)]
    fn values<const N: usize>(&self) -> [f32; N] {
        std::array::from_fn(|u| self.value(u as f32))
    }
}

impl Quadratic {
    #[inline(always)]
    fn through(nodes: &[f64; 9], base: f32, side: usize) -> Self {
        let last = (side - 1) as f32;
        let above = |node: usize| (nodes[node] - f64::from(base)) as f32;
        let row = |v: usize| Parabola::through([above(3 * v), above(3 * v + 1), above(3 * v + 2)], last);
        Self { rows: [row(0), row(1), row(2)], last }
    }

    /// Along u at row v.
    #[inline(always)]
    fn row(&self, v: f32) -> Parabola {
        let t = 2.0 * v / self.last - 1.0; // −1, 0 and 1 at the three rows
        let [north, middle, south] = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
        let [first, second, third] = &self.rows;
        Parabola {
            a: north * first.a + middle * second.a + south * third.a,
            b: north * first.b + middle * second.b + south * third.b,
            c: north * first.c + middle * second.c + south * third.c,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SiloPose;
    use crate::geometry::evaluator::SurfaceEvaluator;
    use crate::geometry::sensor::NoiseLaw;
    use crate::geometry::surface::SiloSurface;
    use crate::surface_fit::tiles::tile_patches;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nine_values_tell_a_quadratics_mean_slopes_and_bend(
            side in 4usize..=MAX_SIDE, a in -1.0f64..1.0, b in -1.0f64..1.0, c in -1.0f64..1.0,
            across in -1.0f64..1.0, down in -1.0f64..1.0, twist in -1.0f64..1.0,
        ) {
            let value = |t: f64, s: f64| a + b * t + c * s + across * t * t + down * s * s + twist * t * s;
            let nodes = std::array::from_fn(|i| value((i % 3) as f64 - 1.0, (i / 3) as f64 - 1.0));
            let t = |k: usize| 2.0 * k as f64 / (side - 1) as f64 - 1.0;
            let pixels: Vec<[f64; 2]> = (0..side * side).map(|i| [t(i % side), t(i / side)]).collect();
            let mean = |of: &dyn Fn(f64, f64) -> f64| pixels.iter().map(|&[t, s]| of(t, s)).sum::<f64>() / pixels.len() as f64;
            let middle = mean(&value);
            let square = mean(&|t, _| t * t);
            let slopes = [mean(&|t, s| t * value(t, s)) / square, mean(&|t, s| s * value(t, s)) / square];
            let bend = mean(&|t, s| (value(t, s) - middle - slopes[0] * t - slopes[1] * s).powi(2));
            let grid = Grid::of(side as f64);
            prop_assert!((grid.mean(&nodes) - middle).abs() < 1e-12);
            let per_pixel = 2.0 / (side - 1) as f64;
            for (found, slope) in grid.slopes(&nodes).into_iter().zip(slopes) {
                prop_assert!((found - slope * per_pixel).abs() < 1e-12);
            }
            prop_assert!((grid.bend(&nodes) - bend).abs() < 1e-12);
        }
    }

    #[test]
    fn a_tiles_sums_tell_what_its_pixels_tell() {
        let (width, height, focal) = (320, 240, 280.0);
        let pose = SiloPose { r_x: 0.1, r_y: -0.05, t_x: 0.2, t_y: 0.1 };
        let surface = SiloSurface { pose, radius: Some(1.2), cone: None, ovality: [0.0; 2] };
        let placed = SurfaceEvaluator::new(surface);
        let bias = DepthBias { offset: 0.004, scale: -0.018, quadratic: 0.022 };
        let ray = |i: usize| [((i % width) as f64 - 160.0) / focal, ((i / width) as f64 - 120.0) / focal];
        let rays: Vec<[f64; 2]> = (0..width * height).map(ray).collect();
        let noise = |i: usize| 2e-3 * (((i as f64 * 12.9898).sin() * 43_758.545_3).fract().abs() - 0.5);
        let wall: Vec<f64> = rays.iter().map(|&ray| bias.measured(placed.cylinder_depth(ray))).collect();
        let depth: Vec<f32> = wall.iter().enumerate().map(|(i, d)| (d + noise(i)) as f32).collect();
        let image = DepthImage::with_rays(&depth, &rays, width, height).expect("sizes agree");
        let patches = tile_patches(&image, Some(&NoiseLaw::uniform(1e-3)));
        let (mut told, mut excess) = (0, 0.0);
        for (i, patch) in patches.list.iter().enumerate().filter(|(_, patch)| patch.measured < 6.0) {
            let sampling = Sampling { stride: 1, reach: 2.4e-3 };
            let found = tile_residual(&image, &patches, i, &bias, sampling, |_, _| true, |q| placed.cylinder_depth(q));
            let corner = (patch.tile.1 as usize * width + patch.tile.0 as usize) * patches.side;
            let pixels = (0..patches.side.pow(2)).map(|k| corner + k / patches.side * width + k % patches.side);
            let off: Vec<f64> = pixels.map(|i| f64::from(depth[i]) - wall[i]).collect();
            let n = off.len() as f64;
            let mean = off.iter().sum::<f64>() / n;
            let scatter = (off.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            assert_eq!(found.count, n);
            assert!((found.mean - mean).abs() < 4e-6, "{} {mean}", found.mean);
            assert!((found.scatter - scatter).abs() < 0.15 * scatter, "{} {scatter}", found.scatter);
            told += 1;
            excess += found.scatter.powi(2) / scatter.powi(2) - 1.0;
        }
        assert!(told > 500, "{told}");
        // the noise has some of the bend's form in each tile, in all of them none
        assert!((excess / f64::from(told)).abs() < 3e-3, "{excess}");
    }
}
