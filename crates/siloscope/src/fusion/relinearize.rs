//! What a frame says about walls further off than its equations reach.
//!
//! With the depth bias unknown, a frame hardly tells bias from size and place: its likelihood is a long valley, and the
//! valley is bent. In the depths that the walls predict on the frame's rays the likelihood is quadratic everywhere, so
//! there the valley is straight. A few of the rays are enough to tell which step from the base of the equations predicts
//! the depths of another wall: u(θ) = δ + (JᵀWJ + Π)⁻¹ JᵀW (φ(θ) − φ(base) − Jδ) with δ = θ − base, φ the predicted
//! readings, J their derivatives at the base, W the rays' information and Π what holds directions that no ray tells.
//! Near the base u(θ) = δ. The camera is part of θ: a turn and a principal point that look alike do so at every place.

use crate::Vec3;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::PARAMETERS;
use crate::geometry::sensor::DepthBias;
use crate::geometry::surface::{Part, SiloSurface};
use crate::surface_fit::frame_factor::Ray;
use crate::surface_fit::joint::parameters::corrected;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Parameters of a wall, a depth bias and a camera: the twelve, then the errors of the intrinsics.
pub const PLACED: usize = PARAMETERS + INTRINSICS;
/// Errors of the intrinsics: focal lengths (relative), principal point (rays), k1.
const INTRINSICS: usize = 5;

/// Values of these parameters.
pub type Values = SVector<f64, PLACED>;
/// A map between them.
pub type Map = SMatrix<f64, PLACED, PLACED>;

/// A wall, a depth bias and a camera, ready to predict readings.
struct Place {
    wall: SurfaceEvaluator,
    bias: DepthBias,
    camera: [f64; INTRINSICS],
}

impl Place {
    fn new(values: &Values) -> Self {
        let p = &values.fixed_rows::<PARAMETERS>(0).into_owned();
        Self {
            wall: SurfaceEvaluator::new(SiloSurface::of_parameters(p)),
            bias: DepthBias::of_parameters(p),
            camera: std::array::from_fn(|k| values[PARAMETERS + k]),
        }
    }

    /// Direction of a told ray.
    fn direction(&self, ray: &Ray) -> Vec3 {
        let [x, y] = corrected([ray[0], ray[1]], &self.camera);
        Vec3::new(x, y, 1.0)
    }

    /// The part that a ray meets.
    fn part(&self, ray: &Ray) -> Part {
        self.wall.depth(&self.direction(ray)).1
    }

    /// The predicted reading on a ray that meets a part, with its derivative; `None` where it misses or grazes it.
    fn reading(&self, ray: &Ray, part: Part) -> Option<(f64, Values)> {
        let q = self.direction(ray);
        let across = [q.x, q.y];
        let round = match part {
            Part::Cylinder => self.wall.cylinder_depth(across),
            Part::Cone => self.wall.cone_depth(across),
        };
        let d = self.wall.rounded(across, round, part);
        let p = q * d;
        let at = self.wall.local_of(self.wall.to_silo(&p), part);
        let along = at.gradient.dot(&self.wall.turn(&q));
        if !(d > 0.0 && along.abs() > GRAZING * at.gradient.norm() * q.norm()) {
            return None;
        }
        let per_gap = -self.bias.slope(d) / along;
        let mut row = Values::zeros();
        row.fixed_rows_mut::<PARAMETERS>(0).copy_from(&(self.wall.derivative(&p, &at) * per_gap));
        (row[7], row[8], row[9]) = (1.0, d, d * d);
        let by = |axis: Vec3| per_gap * d * at.gradient.dot(&self.wall.turn(&axis));
        let ([x, y, _], [by_x, by_y]) = (*ray, [by(Vec3::x()), by(Vec3::y())]);
        let radial = by_x * x + by_y * y;
        let camera = [by_x * x, by_y * y, by_x, by_y, (x * x + y * y) * radial];
        camera.into_iter().enumerate().for_each(|(k, slope)| row[PARAMETERS + k] = -slope);
        Some((self.bias.measured(d), row))
    }
}

/// Cosine of the incidence below which a ray tells nothing.
const GRAZING: f64 = 0.02;

/// A frame's rays at the base of its equations.
#[derive(Debug)]
pub struct Straight {
    base: Values,
    /// Ray, part, reading and its derivative.
    rays: Vec<(Ray, Part, f64, Values)>,
    scale: Values,
    free: [bool; PLACED],
    normal: Cholesky<f64, Const<PLACED>>,
}

/// Of the normal equations' unit diagonal: keeps directions that no ray tells (the depth scale) from being divided by 0.
const RIDGE: f64 = 1e-13;

impl Straight {
    /// `free` are the parameters that the frame estimates and `held` the information with which each of them stays where
    /// it is, `only` the part whose rays count; `None` where they tell nothing.
    pub fn new(
        base: &Values,
        rays: &[Ray],
        (free, held): ([bool; PLACED], &Values),
        only: Option<Part>,
    ) -> Option<Self> {
        let place = Place::new(base);
        let told = rays.iter().filter(|ray| ray[2] > 0.0).filter_map(|ray| {
            let part = place.part(ray);
            only.is_none_or(|only| only == part).then_some(())?;
            let among = |row: Values| row.map_with_location(|k, _, v| if free[k] { v } else { 0.0 });
            place.reading(ray, part).map(|(reading, row)| (*ray, part, reading, among(row)))
        });
        let rays: Vec<_> = told.collect();
        let mut normal = Map::from_diagonal(&held.map_with_location(|k, _, v| if free[k] { v } else { 0.0 }));
        if rays.is_empty() {
            return None;
        }
        rays.iter().for_each(|(ray, _, _, row)| normal.ger(ray[2], row, row, 1.0));
        let scale = Values::from_fn(|k, _| if normal[(k, k)] > 0.0 { normal[(k, k)].powf(-0.5) } else { 0.0 });
        let unit = |r: usize, c: usize, v: f64| {
            let ridge = if scale[r] > 0.0 { RIDGE } else { 1.0 };
            v * scale[r] * scale[c] + if r == c { ridge } else { 0.0 }
        };
        let normal = Cholesky::new(normal.map_with_location(unit))?;
        Some(Self { base: *base, rays, scale, free, normal })
    }

    /// The step u(θ) from the base that predicts what the wall and bias at θ do, and its derivative there.
    ///
    /// The step is one of the free parameters alone: where another one differs, they make up for it. What is free and
    /// told by no ray is as far from the base as it is, and so is what a ray tells that misses the wall at θ.
    pub fn seen_from(&self, place: &Values) -> (Values, Map) {
        let there = Place::new(place);
        let gap = finite(place - self.base);
        let own = gap.map_with_location(|k, _, v| if self.free[k] { v } else { 0.0 });
        let (mut step, mut turn) = (Values::zeros(), Map::zeros());
        for (ray, part, reading, row) in &self.rays {
            let (change, slope) = match there.reading(ray, *part) {
                Some((predicted, slope)) => (predicted - reading, slope),
                None => (row.dot(&gap), *row),
            };
            step.axpy(ray[2] * (change - row.dot(&own)), row, 1.0);
            turn.ger(ray[2], row, &(slope - row), 1.0);
        }
        step = self.solved(step.component_mul(&self.scale)).component_mul(&self.scale) + own;
        for mut column in turn.column_iter_mut() {
            let solved = self.solved(column.component_mul(&self.scale)).component_mul(&self.scale);
            column.copy_from(&solved);
        }
        (0..PLACED).filter(|&k| self.free[k]).for_each(|k| turn[(k, k)] += 1.0);
        (step, turn)
    }

    fn solved(&self, right: Values) -> Values {
        self.normal.solve(&right)
    }
}

fn finite(values: Values) -> Values {
    values.map(|v| if v.is_finite() { v } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: [bool; PLACED] = [true; PLACED];
    const NONE: Values = Values::from_array_storage(nalgebra::ArrayStorage([[0.0; PLACED]]));

    fn base() -> Values {
        let wall = [0.2, -0.24, 0.6, 0.5, 1.5, 0.577, 2.6, 0.003, -0.01, 0.02, 0.002, -0.001];
        let camera = [0.002, -0.001, 0.001, 0.002, 0.01];
        Values::from_iterator(wall.into_iter().chain(camera))
    }

    /// Rays over the image of a camera that sees cylinder and cone.
    fn rays() -> Vec<Ray> {
        let ray = |k: usize| [0.56 * ((k as f64 * 0.618).fract() - 0.5), 0.42 * (k as f64 / 31.0 - 0.5), 1e4];
        (0..32).map(ray).map(|[x, y, w]| [2.0 * x, 2.0 * y, w]).collect()
    }

    fn frame(free: [bool; PLACED]) -> Straight {
        Straight::new(&base(), &rays(), (free, &NONE), None).expect("the rays meet the wall")
    }

    #[test]
    fn both_parts_are_seen() {
        let parts: Vec<Part> = frame(FREE).rays.iter().map(|r| r.1).collect();
        assert!(parts.contains(&Part::Cylinder) && parts.contains(&Part::Cone));
    }

    /// Readings that steps predict to first order from the base.
    fn linear(frame: &Straight, step: &Values) -> Vec<f64> {
        frame.rays.iter().map(|(_, _, _, row)| row.dot(step)).collect()
    }

    fn predicted(frame: &Straight, place: &Values) -> Vec<f64> {
        let there = Place::new(place);
        let change = |(ray, part, reading, _): &(Ray, Part, f64, Values)| {
            there.reading(ray, *part).map_or(f64::NAN, |(predicted, _)| predicted - reading)
        };
        frame.rays.iter().map(change).collect()
    }

    fn furthest(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn the_derivatives_are_those_of_the_readings() {
        let frame = frame(FREE);
        for k in 0..PLACED {
            let mut step = Values::zeros();
            step[k] = 1e-6;
            let numeric: Vec<f64> = predicted(&frame, &(base() + step)).iter().map(|v| v / 1e-6).collect();
            assert!(furthest(&numeric, &linear(&frame, &(step / 1e-6))) < 1e-3, "{k}");
        }
    }

    /// Along a bent valley: the radius 2 % too large, and the bias that makes up for most of it.
    #[test]
    fn the_step_predicts_what_a_far_place_does() {
        let mut free = FREE;
        free[8] = false;
        let frame = frame(free);
        for scale in [0.25, 1.0] {
            let mut place = base();
            (place[4], place[6], place[9]) = (1.5 + 0.03 * scale, 2.6 + 0.03 * scale, 0.02 + 0.01 * scale);
            let (step, _) = frame.seen_from(&place);
            let (wanted, near) = (predicted(&frame, &place), linear(&frame, &(place - base())));
            let (bent, off) = (furthest(&near, &wanted), furthest(&linear(&frame, &step), &wanted));
            assert!(off < 0.2 * bent, "{off} of {bent}");
        }
    }

    #[test]
    fn the_turn_is_the_steps_derivative() {
        let mut free = FREE;
        free[8] = false;
        let frame = frame(free);
        let mut place = base();
        (place[0], place[4], place[9]) = (0.205, 1.53, 0.025);
        let (_, turn) = frame.seen_from(&place);
        for k in (0..PLACED).filter(|&k| free[k]) {
            let mut h = Values::zeros();
            h[k] = 1e-5;
            let numeric = (frame.seen_from(&(place + h)).0 - frame.seen_from(&(place - h)).0) / 2e-5;
            let (column, readings) = (turn.column(k), linear(&frame, &numeric));
            assert!(furthest(&readings, &linear(&frame, &column.into_owned())) < 1e-4, "{k}");
        }
    }

    /// A larger silo read with a smaller scale gives the same readings; the frame says the same of it.
    #[test]
    fn a_silo_and_a_scale_that_read_alike_are_the_same_place() {
        let (mut place, factor) = (base(), 1.02);
        [2, 3, 4, 6].into_iter().for_each(|k| place[k] *= factor);
        place[8] = (1.0 + place[8]) / factor - 1.0;
        place[9] /= factor * factor;
        let mut free = FREE;
        free[PARAMETERS..].fill(false);
        let frame = frame(free);
        let (step, _) = frame.seen_from(&place);
        assert!(furthest(&linear(&frame, &step), &[0.0; 32]) < 1e-12);
    }

    /// Directions in which turn, shift and camera make up for each other are as open at a far place as they are there.
    #[test]
    fn what_a_far_place_leaves_open_stays_open() {
        let frame = frame(FREE);
        let mut place = base();
        (place[0], place[4], place[6], place[9]) = (0.21, 1.53, 2.63, 0.03);
        let (there, (_, turn)) = (Place::new(&place), frame.seen_from(&place));
        let mut rows = Vec::new();
        for (ray, part, _, _) in &frame.rays {
            rows.extend(there.reading(ray, *part).map(|(_, row)| row));
        }
        let normal = rows.iter().fold(Map::zeros(), |sum, row| sum + row * row.transpose());
        let modes = nalgebra::SymmetricEigen::new(normal);
        let least = modes.eigenvalues.imin();
        let open = modes.eigenvectors.column(least).into_owned();
        let seen = furthest(&linear(&frame, &(turn * open)), &[0.0; 32]);
        let straight = furthest(&linear(&frame, &open), &[0.0; 32]);
        assert!(seen < 0.1 * straight && straight > 0.0, "{seen} of {straight}");
    }

    #[test]
    fn rays_that_tell_nothing_make_no_view() {
        assert!(Straight::new(&base(), &[], (FREE, &NONE), None).is_none());
        assert!(Straight::new(&base(), &[[0.1, 0.1, 0.0]], (FREE, &NONE), None).is_none());
        assert!(Straight::new(&base(), &[[f64::NAN, 0.1, 1.0]], (FREE, &NONE), None).is_none());
        assert!(Straight::new(&Values::repeat(f64::NAN), &rays(), (FREE, &NONE), None).is_none());
    }

    #[test]
    fn a_place_that_can_not_be_is_as_far_as_it_is() {
        let frame = frame(FREE);
        let mut place = base();
        place[4] = -3.0;
        let (step, turn) = frame.seen_from(&place);
        assert!(step.iter().chain(turn.iter()).all(|v| v.is_finite()));
    }
}
