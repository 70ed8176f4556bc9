//! The last step's residuals: every pixel of the wall's tiles against the exact ray–surface intersection.

use crate::patches::{DepthImage, MAX_SIDE, Patches};
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
    let tile = Tile { image, corner, side, bias, sampling };
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
        let Some(nodes) = self.nodes(placed, part, &depth) else { return TileResidual::default() };
        let seen = |u: usize, v: usize| self.bias.measured(depth(self.ray(u, v)));
        let smooth = Quadratic::through(&nodes.map(|row| row.map(|d| self.bias.measured(d))), self.side);
        let rest = |at: usize| (smooth.row(at).value(at as f64) - seen(at, at)).abs();
        if rest(self.side / 4) > QUADRATIC_REST || rest(self.side - 1 - self.side / 4) > QUADRATIC_REST {
            let exact = |v: usize| std::array::from_fn(|u| if u < self.side { seen(u, v) } else { f64::NAN });
            return self.mean::<MAX_SIDE>(exact);
        }
        if self.side <= MAX_SIDE / 2 {
            self.mean::<{ MAX_SIDE / 2 }>(|v| smooth.row(v).values())
        } else {
            self.mean::<MAX_SIDE>(|v| smooth.row(v).values())
        }
    }

    /// True depths of the wall at the tile's corners, middles of its sides, and centre; `None` where not all are `part`.
    #[inline(always)]
    fn nodes(&self, placed: &PlacedSurface, part: Part, depth: &impl Fn([f64; 2]) -> f64) -> Option<[[f64; 3]; 3]> {
        let last = self.side - 1;
        let places = [(0, 0), (last / 2, last.div_ceil(2)), (last, last)];
        let ray = |(u0, u1), (v0, v1)| {
            let (p, q) = (self.ray(u0, v0), self.ray(u1, v1));
            [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]
        };
        let on_part = |ray: [f64; 2], d: f64| (placed.down(ray) * d < placed.bottom()) == (part == Part::Cylinder);
        let mut nodes = [[0.0; 3]; 3];
        for (row, v) in nodes.iter_mut().zip(places) {
            for (node, u) in row.iter_mut().zip(places) {
                let ray = ray(u, v);
                *node = depth(ray);
                if !(*node > 0.0 && on_part(ray, *node)) {
                    return None;
                }
            }
        }
        Some(nodes)
    }

    #[inline(always)]
    fn ray(&self, u: usize, v: usize) -> [f64; 2] {
        self.image.rays[self.corner + v * self.image.width + u]
    }

    /// Mean of the residuals that agree with what the wall measures in each row.
    #[inline(always)]
    fn mean<const N: usize>(&self, wall: impl Fn(usize) -> [f64; N]) -> TileResidual {
        let (mut count, mut sum, mut squares) = ([0.0; N], [0.0; N], [0.0; N]);
        for v in (0..self.side).step_by(self.sampling.stride) {
            let depths = self.image.row::<N>(self.corner + v * self.image.width, self.side);
            let wall = wall(v);
            for u in 0..N {
                let residual = depths[u] - wall[u];
                let counts = (depths[u] > 0.0) & (residual.abs() < self.sampling.reach);
                let kept = if counts { residual } else { 0.0 };
                count[u] += if counts { 1.0 } else { 0.0 };
                sum[u] += kept;
                squares[u] += kept * kept;
            }
        }
        let [n, sum, squares] = [count, sum, squares].map(|lanes| lanes.iter().sum::<f64>());
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
    last: f64,
}

/// a + b·u + c·u².
#[derive(Clone, Copy)]
struct Parabola {
    a: f64,
    b: f64,
    c: f64,
}

impl Parabola {
    /// Through the values at 0, `last`/2 and `last`.
    #[inline(always)]
    fn through([start, middle, end]: [f64; 3], last: f64) -> Self {
        let c = 2.0 * (start - 2.0 * middle + end) / (last * last);
        Self { a: start, b: (end - start) / last - c * last, c }
    }

    #[inline(always)]
    fn value(&self, u: f64) -> f64 {
        self.a + u * (self.b + u * self.c)
    }

    #[inline(always)]
    fn values<const N: usize>(&self) -> [f64; N] {
        std::array::from_fn(|u| self.value(u as f64))
    }
}

impl Quadratic {
    #[inline(always)]
    fn through(nodes: &[[f64; 3]; 3], side: usize) -> Self {
        let last = (side - 1) as f64;
        Self { rows: nodes.map(|row| Parabola::through(row, last)), last }
    }

    /// Along u at row v.
    #[inline(always)]
    fn row(&self, v: usize) -> Parabola {
        let t = 2.0 * v as f64 / self.last - 1.0; // −1, 0 and 1 at the three rows
        let [north, middle, south] = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
        let of = |part: fn(&Parabola) -> f64| {
            north * part(&self.rows[0]) + middle * part(&self.rows[1]) + south * part(&self.rows[2])
        };
        Parabola { a: of(|p| p.a), b: of(|p| p.b), c: of(|p| p.c) }
    }
}
