//! The silo: a cylinder on a cone with an outlet, in the silo frame (z down, 0 at the camera's height).

use crate::bottom::{Bottom, Place};
use crate::hit::{Hit, Label};
use crate::limits::bounded;
use crate::quadrics::{cone_exit, cylinder_exit, pipe_exit, radial};
use siloscope::{Result, Vec3};

/// Cylinder from z = `top` over `cylinder_height`, then a cone whose vertex is `cone_height` further down. Metres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Silo {
    /// Radius of the cylinder.
    pub radius: f64,
    /// Height of the cylinder; 0 for a cone alone.
    pub cylinder_height: f64,
    /// Height from the cylinder's bottom to the cone's vertex (which the outlet may have cut away); 0 over a flat floor.
    pub cone_height: f64,
    /// What closes the cylinder below.
    pub floor: Bottom,
    /// Rings of sheet of another radius: (distance of the lower edge from the top edge, radius), from above.
    pub courses: Vec<[f64; 2]>,
    /// z of the cylinder's upper edge; negative where the camera hangs below it.
    pub top: f64,
    /// Whether a roof covers the upper edge.
    pub roof: bool,
    /// Height of the roof's tip over the edge; 0 for a flat one.
    pub roof_height: f64,
    /// Radius of the outlet pipe; 0 for a cone that ends in its vertex.
    pub outlet_radius: f64,
    /// How far the outlet pipe reaches below the vertex, to its closed end.
    pub outlet_length: f64,
    /// Offset of the outlet pipe from the axis, and of an oblique cone's vertex.
    pub outlet_offset: [f64; 2],
}

/// Least height of a course, metres.
const LEAST_COURSE: f64 = 0.05;

/// Where a ray leaves the silo's air: on a surface, or through the open top.
#[derive(Debug, Clone)]
pub enum Exit {
    /// The wall, the cone, the outlet or the roof.
    Surface(Hit),
    /// The open top, at this parameter.
    Open(f64),
}

impl Silo {
    /// Checks every length.
    pub fn validate(&self) -> Result<()> {
        bounded("radius", self.radius, 1e-3, 1e3, "between 0.001 and 1000 m")?;
        bounded("cylinder_height", self.cylinder_height, 0.0, 1e3, "between 0 and 1000 m")?;
        if self.floor != Bottom::Flat {
            bounded("cone_height", self.cone_height, 1e-3, 1e3, "between 0.001 and 1000 m")?;
        }
        self.floor.validate(&self.place())?;
        bounded("top", self.top, -1e3, 1e3, "between -1000 and 1000 m")?;
        bounded("outlet_radius", self.outlet_radius, 0.0, 0.9 * self.radius, "at most 0.9 of the silo's radius")?;
        bounded("outlet_length", self.outlet_length, 0.0, 1e3, "between 0 and 1000 m")?;
        let reach = self.outlet_offset[0].hypot(self.outlet_offset[1]) + self.outlet_radius;
        bounded("outlet_offset", reach, 0.0, 0.95 * self.radius, "such that the outlet lies within the silo")?;
        bounded("roof_height", self.roof_height, 0.0, 1e3, "between 0 and 1000 m")?;
        self.validate_courses()?;
        bounded("top", self.bottom(), 0.0, 2e3, "such that the camera is not below the cylinder")
    }

    fn validate_courses(&self) -> Result<()> {
        let mut edge = 0.0;
        for &[end, radius] in &self.courses {
            bounded(
                "courses",
                end - edge,
                LEAST_COURSE,
                self.cylinder_height,
                "from above, each at least 0.05 m high",
            )?;
            bounded("courses", radius / self.radius, 0.9, 1.1, "within a tenth of the silo's radius")?;
            edge = end;
        }
        bounded("courses", edge, 0.0, (self.cylinder_height - LEAST_COURSE).max(0.0), "above the cylinder's bottom")
    }

    /// z where the cylinder ends and the cone begins.
    pub fn bottom(&self) -> f64 {
        self.top + self.cylinder_height
    }

    /// z of the cone's vertex.
    pub fn apex(&self) -> f64 {
        self.bottom() + self.cone_height
    }

    /// Height of cylinder and cone together.
    pub fn height(&self) -> f64 {
        self.cylinder_height + self.cone_height
    }

    /// Radius lost for each metre down the cone.
    pub fn slope(&self) -> f64 {
        self.radius / self.cone_height
    }

    /// Where the bottom hangs.
    pub(crate) fn place(&self) -> Place {
        Place { radius: self.radius, rim: self.bottom(), height: self.cone_height, vertex: self.outlet_offset }
    }

    /// Height over the bottom's lowest point at distance `r` from the axis in the direction (cos, sin).
    pub fn floor_height(&self, r: f64, direction: (f64, f64)) -> f64 {
        self.floor.height(&self.place(), r, direction)
    }

    /// Volume of cylinder and bottom, down to the vertex, without the outlet pipe.
    pub fn capacity(&self) -> f64 {
        if self.floor == Bottom::Cone && self.courses.is_empty() {
            return std::f64::consts::PI * self.radius * self.radius * (self.cylinder_height + self.cone_height / 3.0);
        }
        let mut from = 0.0;
        let mut volume = self.floor.volume(&self.place());
        for [end, radius] in self.courses.iter().copied().chain([[self.cylinder_height, self.radius]]) {
            volume += std::f64::consts::PI * radius * radius * (end - from);
            from = end;
        }
        volume
    }

    /// Radius of the narrowest course.
    pub fn narrowest(&self) -> f64 {
        self.courses.iter().fold(self.radius, |least, course| least.min(course[1]))
    }

    /// Whether a point is in the silo's air, below the top.
    pub fn contains(&self, p: &Vec3) -> bool {
        let r = p.xy().norm();
        let out = radial(p);
        let floor = || self.apex() - self.floor_height(r, (out.x, out.y));
        p.z >= self.top && r < self.narrowest() && p.z < floor()
    }

    /// Parameter at which a ray is inside: 0 within, the crossing of the open top from above, None for a miss.
    pub fn entry(&self, origin: &Vec3, ray: &Vec3) -> Option<f64> {
        if origin.z >= self.top {
            return self.contains(origin).then_some(0.0);
        }
        let t = (self.top - origin.z) / ray.z;
        let inside = ray.z > 0.0 && !self.roof && (origin + ray * t).xy().norm() < self.radius;
        inside.then_some(t)
    }

    /// First exit of a ray that is inside the silo at its origin.
    pub fn exit(&self, origin: &Vec3, ray: &Vec3) -> Option<Exit> {
        let (top, bottom) = (self.top, self.bottom());
        if let Some(t) = cylinder_exit(origin, ray, self.radius) {
            let z = origin.z + t * ray.z;
            if (top..bottom).contains(&z) {
                return Some(Exit::Surface(hit(t, -radial(&(origin + ray * t)), Label::Cylinder)));
            }
        }
        if ray.z < 0.0 {
            return self.top_exit(origin, ray);
        }
        let hit = self.floor.cast(&self.place(), origin, ray)?;
        Some(Exit::Surface(self.outlet_hit(origin, ray, &(origin + ray * hit.t)).unwrap_or(hit)))
    }

    /// Where a ray that looks up leaves through the top or meets the roof.
    pub(crate) fn top_exit(&self, origin: &Vec3, ray: &Vec3) -> Option<Exit> {
        if ray.z >= 0.0 {
            return None;
        }
        let t = (self.top - origin.z) / ray.z;
        if !self.roof {
            return Some(Exit::Open(t));
        }
        if self.roof_height == 0.0 {
            return Some(Exit::Surface(hit(t, Vec3::z(), Label::Other)));
        }
        // A roof is a cone that stands on its head.
        let (from, along) = (Vec3::new(origin.x, origin.y, -origin.z), Vec3::new(ray.x, ray.y, -ray.z));
        let slope = self.radius / self.roof_height;
        let t = cone_exit(&from, &along, slope, self.roof_height - self.top)?;
        let out = radial(&(origin + ray * t));
        Some(Exit::Surface(hit(t, Vec3::new(-out.x, -out.y, slope).normalize(), Label::Other)))
    }

    /// The pipe's wall or end, where the ray leaves the cone at `p` through the outlet.
    pub(crate) fn outlet_hit(&self, origin: &Vec3, ray: &Vec3, p: &Vec3) -> Option<Hit> {
        let centre = Vec3::new(self.outlet_offset[0], self.outlet_offset[1], 0.0);
        if (p - centre).xy().norm() >= self.outlet_radius {
            return None;
        }
        let from = origin - centre;
        let end = (self.apex() + self.outlet_length - origin.z) / ray.z;
        match pipe_exit(&from, ray, self.outlet_radius) {
            Some(t) if t < end => Some(hit(t, -radial(&(from + ray * t)), Label::Other)),
            _ => Some(hit(end, -Vec3::z(), Label::Other)),
        }
    }
}

fn hit(t: f64, normal: Vec3, label: Label) -> Hit {
    Hit { t, normal, label }
}
