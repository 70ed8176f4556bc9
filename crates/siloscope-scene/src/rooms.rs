//! Worlds that are no silo, to see whether they are taken for one.

use crate::hit::{Hit, Label};
use crate::random::Stream;
use crate::world::World;
use siloscope::{Error, Result, Vec3};

/// A convex room bounded by planes `normal · p = offset`, seen from inside. Without planes there is nothing to see.
#[derive(Debug, Clone, Default)]
pub struct Room {
    /// Outward normals and offsets.
    pub planes: Vec<(Vec3, f64)>,
}

impl Room {
    /// One wall across the view, `distance` away.
    pub fn wall(distance: f64) -> Self {
        Self { planes: vec![(Vec3::z(), distance)] }
    }

    /// A floor and two walls that meet in a corner.
    pub fn corner(half_width: f64, distance: f64) -> Self {
        Self { planes: vec![(Vec3::z(), distance), (Vec3::x(), half_width), (Vec3::y(), half_width)] }
    }

    /// A square shaft on a pyramid.
    pub fn shaft(half_width: f64, bottom: f64, apex: f64) -> Self {
        let sides = [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y()];
        let slope = half_width / (apex - bottom);
        let hopper = |side: Vec3| ((side + Vec3::z() * slope).normalize(), slope * apex / slope.hypot(1.0));
        Self { planes: sides.into_iter().flat_map(|side| [(side, half_width), hopper(side)]).collect() }
    }
}

impl World for Room {
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let leaving = self.planes.iter().filter(|(normal, _)| normal.dot(ray) > 0.0);
        let exits = leaving.map(|(normal, offset)| ((offset - normal.dot(origin)) / normal.dot(ray), normal));
        let (t, normal) = exits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Hit { t, normal: -normal, label: Label::Other })
    }

    fn check_camera(&self, origin: &Vec3) -> Result<()> {
        inside(self.planes.iter().all(|(normal, offset)| normal.dot(origin) < *offset), origin)
    }
}

/// The inside of a sphere.
#[derive(Debug, Clone)]
pub struct Sphere {
    /// Its centre.
    pub centre: Vec3,
    /// Its radius.
    pub radius: f64,
}

impl World for Sphere {
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let from = origin - self.centre;
        let (a, b, c) = (ray.norm_squared(), ray.dot(&from), from.norm_squared() - self.radius * self.radius);
        let root = (b * b - a * c).sqrt();
        let t = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
        Some(Hit { t, normal: -(from + ray * t) / self.radius, label: Label::Other })
    }

    fn check_camera(&self, origin: &Vec3) -> Result<()> {
        inside((origin - self.centre).norm() < self.radius, origin)
    }
}

/// Depths without any surface: each ray ends anywhere between `near` and `far`.
#[derive(Debug, Clone)]
pub struct Noise {
    /// Least depth.
    pub near: f64,
    /// Greatest depth.
    pub far: f64,
    /// Draws the depths.
    pub seed: u64,
}

impl World for Noise {
    fn cast(&self, _origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let stream = Stream::new(self.seed, 2);
        let address = ray.iter().fold(0, |address, x| stream.bits(address ^ x.to_bits()));
        let t = self.near + (self.far - self.near) * stream.uniform(address);
        Some(Hit { t, normal: -ray.normalize(), label: Label::Other })
    }

    fn check_camera(&self, _origin: &Vec3) -> Result<()> {
        Ok(())
    }
}

fn inside(is_inside: bool, origin: &Vec3) -> Result<()> {
    if is_inside {
        return Ok(());
    }
    Err(Error::Setting {
        name: "t_x, t_y",
        bounds: "such that the camera is inside the room",
        value: origin.xy().norm(),
    })
}
