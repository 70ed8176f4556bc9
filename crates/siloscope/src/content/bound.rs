//! The silo's wall as a bound of its content: which returns lie on it, which inside, which beyond.

use super::silo_points::ScanLine;
use crate::geometry::sensor::NoiseLaw;

/// SiloPoints within so many standard deviations of the wall belong to the wall.
const WALL_SIGMAS: f64 = 4.0;

/// The cylinder that bounds the surface, and how well it is known.
#[derive(Debug, Clone)]
pub struct Bound {
    radius: f32,
    top: f32,
    camera: [f32; 2],
    /// For each step of depth d, `2 k σ_d / d` and `2 k R σ_R`.
    margins: Vec<[f32; 2]>,
    /// For each step of depth, the squared radius within which no return up to there can belong to the wall.
    inside: Vec<f32>,
}

/// Step of the margins' table, metres.
pub const STEP: f32 = 0.02;

/// On which side of the wall a return lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Inside the silo, clear of the wall.
    Inside,
    /// On the wall.
    Wall,
    /// Beyond the wall or above the top.
    Outside,
}

impl Bound {
    /// A cylinder whose distance from a point is known to `variance[0] + variance[1] depth²`.
    ///
    /// `reach` is the largest depth of interest; nothing above `top` is looked at; `camera` is where it hangs.
    pub fn new(radius: f64, variance: [f64; 2], noise: &NoiseLaw, reach: f64, top: f64, camera: [f64; 2]) -> Self {
        let steps = (reach.clamp(0.0, 1e3) / f64::from(STEP)) as usize + 2;
        let margin = |i: usize| {
            let d = (i as f64 + 0.5) * f64::from(STEP);
            let lateral = (variance[0] + variance[1] * d * d).sqrt();
            [(2.0 * WALL_SIGMAS * noise.sigma(d) / d) as f32, (2.0 * WALL_SIGMAS * radius * lateral) as f32]
        };
        let margins: Vec<[f32; 2]> = (0..steps).map(margin).collect();
        // at the wall |p · ray| d is at most R (R + |camera|), and at most 2 R d as no ray is flatter than 2 : 1
        let (across, mut widest) = (radius + camera[0].hypot(camera[1]), 0.0f64);
        let inside = margins.iter().enumerate().map(|(i, m)| {
            let along = radius * across.min(2.0 * (i as f64 + 1.0) * f64::from(STEP));
            widest = widest.max(f64::from(m[0]) * along + f64::from(m[1]));
            (radius * radius - widest).max(0.0) as f32
        });
        Self {
            radius: radius as f32,
            top: top as f32,
            camera: camera.map(|c| c as f32),
            inside: inside.collect(),
            margins,
        }
    }

    /// Squared radius within which no return of a line can belong to the wall.
    pub fn inside(&self, line: &ScanLine) -> f32 {
        self.inside.get(self.step(farthest(&line.depth))).copied().unwrap_or(0.0)
    }

    /// Whether a return is so far inside that nothing else needs to be looked at.
    #[inline]
    pub fn surely_inside(&self, inside: f32, square: f32, z: f32) -> bool {
        square < inside && z >= self.top
    }

    /// Tells a return on the wall from one inside; |Δr| ≤ k σ is tested as |r² − R²| ≤ 2 k (|p·ray| σ_d + R σ_R).
    #[inline]
    pub fn side(&self, [x, y, z]: [f32; 3], depth: f32) -> Side {
        let [by_depth, by_radius] = self.margin(depth);
        let along = (x * (x - self.camera[0]) + y * (y - self.camera[1])).abs();
        let margin = by_depth * along + by_radius;
        let excess = x * x + y * y - self.radius * self.radius;
        let beyond = excess > margin || excess.is_nan();
        if z < self.top || beyond {
            Side::Outside
        } else if excess > -margin {
            Side::Wall
        } else {
            Side::Inside
        }
    }

    /// Radius of the cylinder, metres.
    pub fn radius(&self) -> f64 {
        f64::from(self.radius)
    }

    #[inline]
    fn margin(&self, depth: f32) -> [f32; 2] {
        self.margins.get(self.step(depth)).copied().unwrap_or([0.0; 2])
    }

    #[inline]
    fn step(&self, depth: f32) -> usize {
        ((depth * (1.0 / STEP)) as usize).min(self.margins.len().saturating_sub(1))
    }
}

/// Largest depth, four at a time.
fn farthest(depth: &[f32]) -> f32 {
    let (chunks, rest) = depth.as_chunks::<4>();
    let most = |a: f32, b: f32| if b > a { b } else { a };
    let mut four = [0.0; 4];
    for chunk in chunks {
        four.iter_mut().zip(chunk).for_each(|(m, &d)| *m = most(*m, d));
    }
    four.into_iter().chain(rest.iter().copied()).fold(0.0, most)
}
