//! The last step's residuals: every pixel of the wall's tiles against the exact ray–surface intersection.

use crate::patches::{DepthImage, MAX_SIDE, Patches, TileRays};
use crate::sensor::DepthBias;
use crate::surface::{Part, PlacedSurface};

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

/// Mean residual of tile `i` of the wall's `part` over its pixels.
pub fn tile_residual(
    image: &DepthImage,
    patches: &Patches,
    (i, part): (usize, Part),
    placed: &PlacedSurface,
    bias: &DepthBias,
    sampling: Sampling,
) -> TileResidual {
    let (tile, side) = (patches.list[i].tile, patches.side);
    let corner = tile.1 as usize * side * image.width + tile.0 as usize * side;
    let tile = Tile { image, corner, side, rays: &patches.rays[i], bias, sampling };
    match (part, placed.surface.ovality == [0.0; 2]) {
        (Part::Cylinder, true) => tile.residual(placed, part, |q| placed.cylinder_depth(q)),
        (Part::Cone, true) => tile.residual(placed, part, |q| placed.cone_depth(q)),
        (Part::Cylinder, false) => tile.residual(placed, part, |q| placed.rounded(q, placed.cylinder_depth(q), part)),
        (Part::Cone, false) => tile.residual(placed, part, |q| placed.rounded(q, placed.cone_depth(q), part)),
    }
}

struct Tile<'a> {
    image: &'a DepthImage<'a>,
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

impl Tile<'_> {
    #[inline(always)]
    fn residual(&self, placed: &PlacedSurface, part: Part, depth: impl Fn([f64; 2]) -> f64) -> TileResidual {
        let on_part = |ray: [f64; 2], d: f64| (placed.down(ray) * d < placed.bottom()) == (part == Part::Cylinder);
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
            let seen = |u: usize, v: usize| seen(self.image.rays[self.corner + v * self.image.width + u]);
            let exact = |v: usize| std::array::from_fn(|u| if u < self.side { seen(u, v) } else { f32::NAN });
            return self.mean::<MAX_SIDE>(base, exact);
        }
        if self.side <= MAX_SIDE / 2 {
            self.mean::<{ MAX_SIDE / 2 }>(base, |v| smooth.row(v as f32).values())
        } else {
            self.mean::<MAX_SIDE>(base, |v| smooth.row(v as f32).values())
        }
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
