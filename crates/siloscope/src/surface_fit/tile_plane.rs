//! Planes through the pixels of a tile, by sums along the image's rows, and robustly where pixels disagree.

use crate::geometry::depth_image::DepthImage;
use crate::stats::robust::{MAD_TO_STD, upper_median};

/// Largest side of a tile, pixels.
pub const MAX_SIDE: usize = 32;

/// Sums of a plane fit z = a + b·u + c·v over pixels, u and v relative to the tile's centre.
#[derive(Debug, Clone, Copy, Default)]
pub struct PlaneSums {
    pub(super) n: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) uu: f64,
    pub(super) uv: f64,
    pub(super) vv: f64,
    pub(super) z: f64,
    pub(super) uz: f64,
    pub(super) vz: f64,
    pub(super) zz: f64,
}

/// Pixels of a row that are added together.
const LANES: usize = 4;

/// A plane z = a + b·u + c·v, z in metres, u and v in pixels from the tile's centre.
#[derive(Debug, Clone, Copy, Default)]
pub struct Plane {
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
}

impl PlaneSums {
    /// Adds a pixel.
    #[inline]
    pub fn add(&mut self, u: f64, v: f64, z: f64) {
        self.n += 1.0;
        self.u += u;
        self.v += v;
        self.uu += u * u;
        self.uv += u * v;
        self.vv += v * v;
        self.z += z;
        self.uz += u * z;
        self.vz += v * z;
        self.zz += z * z;
    }

    /// Adds a row of pixels at v, whose u are counted from `centre`.
    #[inline]
    pub fn add_row(&mut self, v: f64, centre: f64, depths: &[f32]) {
        let is_there = |z: f32| (z > 0.0) & (z < f32::INFINITY);
        if !depths.iter().fold(true, |all, &z| all & is_there(z)) {
            for (u, &z) in depths.iter().enumerate().filter(|(_, z)| is_there(**z)) {
                self.add(u as f64 - centre, v, f64::from(z));
            }
            return;
        }
        let (mut z, mut uz, mut zz) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (whole, rest) = depths.as_chunks::<LANES>();
        for (four, depths) in whole.iter().enumerate() {
            for lane in 0..LANES {
                let depth = f64::from(depths[lane]);
                z[lane] += depth;
                uz[lane] += ((four * LANES + lane) as f64 - centre) * depth;
                zz[lane] += depth * depth;
            }
        }
        for (lane, &depth) in rest.iter().enumerate() {
            let depth = f64::from(depth);
            z[lane] += depth;
            uz[lane] += ((whole.len() * LANES + lane) as f64 - centre) * depth;
            zz[lane] += depth * depth;
        }
        let n = depths.len() as f64;
        let of_row: f64 = z.iter().sum();
        self.n += n;
        self.uu += n * (n * n - 1.0) / 12.0;
        self.v += n * v;
        self.vv += n * v * v;
        self.z += of_row;
        self.uz += uz.iter().sum::<f64>();
        self.vz += v * of_row;
        self.zz += zz.iter().sum::<f64>();
    }

    /// Adds a neighbour's sums, whose centre lies at (du, dv) from ours.
    pub fn add_shifted(&mut self, o: &PlaneSums, du: f64, dv: f64) {
        self.n += o.n;
        self.u += o.u + du * o.n;
        self.v += o.v + dv * o.n;
        self.uu += o.uu + 2.0 * du * o.u + du * du * o.n;
        self.uv += o.uv + du * o.v + dv * o.u + du * dv * o.n;
        self.vv += o.vv + 2.0 * dv * o.v + dv * dv * o.n;
        self.z += o.z;
        self.uz += o.uz + du * o.z;
        self.vz += o.vz + dv * o.z;
        self.zz += o.zz;
    }

    /// Least-squares plane; `None` for pixels on a line or a point.
    pub fn plane(&self) -> Option<Plane> {
        let (mu, mv, mz) = (self.u / self.n, self.v / self.n, self.z / self.n);
        let (uu, uv, vv) = (self.uu - mu * self.u, self.uv - mu * self.v, self.vv - mv * self.v);
        let (uz, vz) = (self.uz - mu * self.z, self.vz - mv * self.z);
        let det = uu * vv - uv * uv;
        if !(det > 0.05 * uu * vv && det > 1e-9) {
            return None;
        }
        let (b, c) = ((uz * vv - vz * uv) / det, (vz * uu - uz * uv) / det);
        Some(Plane { a: mz - b * mu - c * mv, b, c })
    }

    /// Root-mean-square distance of the pixels from a plane that was fitted to them.
    pub fn scatter(&self, p: &Plane) -> f64 {
        let residual = self.zz - p.a * self.z - p.b * self.uz - p.c * self.vz;
        (residual.max(0.0) / (self.n - 3.0).max(1.0)).sqrt()
    }
}

/// A tile's sums, its plane, and the pixels' scatter about it.
#[derive(Debug, Clone, Copy)]
pub struct Tile {
    /// Sums over its pixels.
    pub sums: PlaneSums,
    /// Its plane.
    pub plane: Plane,
    /// Root-mean-square distance of the pixels from it, metres.
    pub scatter: f64,
}

impl Tile {
    /// The tile of sums; `None` for pixels on a line or a point.
    pub fn of(sums: PlaneSums) -> Option<Self> {
        let plane = sums.plane()?;
        Some(Self { sums, plane, scatter: sums.scatter(&plane) })
    }

    /// Mean depth, metres.
    pub fn depth(&self) -> f64 {
        self.sums.z / self.sums.n
    }
}

/// The tiles of the image, row by row; `None` where fewer than `enough` pixels were measured.
pub fn tiles(image: &DepthImage, side: usize, (columns, rows): (usize, usize), enough: f64) -> Vec<Option<Tile>> {
    let centre = (side as f64 - 1.0) / 2.0;
    let mut tiles = Vec::with_capacity(columns * rows);
    let mut band = vec![PlaneSums::default(); columns];
    for row in 0..rows {
        band.fill(PlaneSums::default());
        for v in 0..side {
            // along the image's rows, as they lie in memory
            let depths = &image.depth[(row * side + v) * image.width..][..columns * side];
            for (sums, depths) in band.iter_mut().zip(depths.chunks_exact(side)) {
                sums.add_row(v as f64 - centre, centre, depths);
            }
        }
        tiles.extend(band.iter().map(|sums| if sums.n < enough { None } else { Tile::of(*sums) }));
    }
    tiles
}

/// Plane through the tile's majority: a start from the medians of its quadrants, then inliers only.
pub fn robust_tile(image: &DepthImage, (u0, v0): (usize, usize), side: usize) -> Option<Tile> {
    let centre = (side as f64 - 1.0) / 2.0;
    let mut pixels = [(0.0f64, 0.0f64, 0.0f64); MAX_SIDE * MAX_SIDE];
    let mut n = 0;
    for v in 0..side {
        for u in 0..side {
            let z = image.depth[(v0 + v) * image.width + u0 + u];
            if z > 0.0 && z < f32::INFINITY {
                pixels[n] = (u as f64 - centre, v as f64 - centre, f64::from(z));
                n += 1;
            }
        }
    }
    let pixels = &pixels[..n];
    let mut plane = quadrant_plane(pixels)?;
    let mut kept = None;
    for _ in 0..3 {
        let mut residuals: Vec<f64> =
            pixels.iter().map(|p| (p.2 - plane.a - plane.b * p.0 - plane.c * p.1).abs()).collect();
        let limit = (3.0 * MAD_TO_STD * upper_median(&mut residuals)?).max(1e-4);
        let mut sums = PlaneSums::default();
        for p in pixels {
            if (p.2 - plane.a - plane.b * p.0 - plane.c * p.1).abs() <= limit {
                sums.add(p.0, p.1, p.2);
            }
        }
        if sums.n < 0.55 * n as f64 {
            return None;
        }
        let tile = Tile::of(sums)?;
        plane = tile.plane;
        kept = Some(tile);
    }
    kept
}

fn quadrant_plane(pixels: &[(f64, f64, f64)]) -> Option<Plane> {
    let mut sums = PlaneSums::default();
    for quadrant in 0..4 {
        let inside = |p: &&(f64, f64, f64)| usize::from(p.0 > 0.0) + 2 * usize::from(p.1 > 0.0) == quadrant;
        let mut z: Vec<f64> = pixels.iter().filter(inside).map(|p| p.2).collect();
        let Some(median) = upper_median(&mut z) else { continue };
        let n = z.len() as f64;
        let u = pixels.iter().filter(inside).map(|p| p.0).sum::<f64>() / n;
        let v = pixels.iter().filter(inside).map(|p| p.1).sum::<f64>() / n;
        sums.add(u, v, median);
    }
    if sums.n < 3.0 { None } else { sums.plane() }
}
