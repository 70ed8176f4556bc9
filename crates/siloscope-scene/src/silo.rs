//! The silo: a cylinder on a cone with an outlet, in the silo frame (z down, 0 at the camera's height).

use crate::hit::{Hit, Label};
use crate::limits::bounded;
use siloscope::{Result, Vec3};

/// Cylinder from z = `top` over `cylinder_height`, then a cone whose vertex is `cone_height` further down. Metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Silo {
    /// Radius of the cylinder.
    pub radius: f64,
    /// Height of the cylinder; 0 for a cone alone.
    pub cylinder_height: f64,
    /// Height from the cylinder's bottom to the cone's vertex (which the outlet may have cut away).
    pub cone_height: f64,
    /// z of the cylinder's upper edge; negative where the camera hangs below it.
    pub top: f64,
    /// Whether a flat roof covers the upper edge.
    pub roof: bool,
    /// Radius of the outlet pipe; 0 for a cone that ends in its vertex.
    pub outlet_radius: f64,
    /// How far the outlet pipe reaches below the vertex, to its closed end.
    pub outlet_length: f64,
    /// Offset of the outlet pipe from the axis.
    pub outlet_offset: [f64; 2],
}

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
        bounded("cone_height", self.cone_height, 1e-3, 1e3, "between 0.001 and 1000 m")?;
        bounded("top", self.top, -1e3, 1e3, "between -1000 and 1000 m")?;
        bounded("outlet_radius", self.outlet_radius, 0.0, 0.9 * self.radius, "at most 0.9 of the silo's radius")?;
        bounded("outlet_length", self.outlet_length, 0.0, 1e3, "between 0 and 1000 m")?;
        let reach = self.outlet_offset[0].hypot(self.outlet_offset[1]) + self.outlet_radius;
        bounded("outlet_offset", reach, 0.0, 0.95 * self.radius, "such that the outlet lies within the silo")?;
        bounded("top", self.bottom(), 0.0, 2e3, "such that the camera is not below the cylinder")
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

    /// Volume of cylinder and cone, down to the vertex, without the outlet pipe.
    pub fn capacity(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius * (self.cylinder_height + self.cone_height / 3.0)
    }

    /// Whether a point is in the silo's air, below the top.
    pub fn contains(&self, p: &Vec3) -> bool {
        let widest = self.radius.min(self.slope() * (self.apex() - p.z));
        p.z >= self.top && p.xy().norm() < widest
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
        let t = cone_exit(origin, ray, self.slope(), self.apex())?;
        let p = origin + ray * t;
        Some(Exit::Surface(
            self.outlet_hit(origin, ray, &p).unwrap_or_else(|| hit(t, self.cone_normal(&p), Label::Cone)),
        ))
    }

    /// Where a ray that looks up leaves through the top or meets the roof.
    pub(crate) fn top_exit(&self, origin: &Vec3, ray: &Vec3) -> Option<Exit> {
        if ray.z >= 0.0 {
            return None;
        }
        let t = (self.top - origin.z) / ray.z;
        Some(if self.roof { Exit::Surface(hit(t, Vec3::z(), Label::Other)) } else { Exit::Open(t) })
    }

    /// Unit normal of the cone at a point, towards the air.
    pub fn cone_normal(&self, p: &Vec3) -> Vec3 {
        let out = radial(p);
        -Vec3::new(out.x, out.y, self.slope()).normalize()
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

/// Unit vector from the axis to a point, horizontal.
pub(crate) fn radial(p: &Vec3) -> Vec3 {
    let r = p.xy().norm();
    if r > 0.0 { Vec3::new(p.x / r, p.y / r, 0.0) } else { Vec3::x() }
}

/// Smallest positive root of `a t² + 2 b t + c` for `c <= 0`, free of cancellation.
fn leaving_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 || (b <= 0.0 && a <= 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    Some(if b > 0.0 { -c / (b + root) } else { (root - b) / a })
}

/// Where a ray from inside leaves the infinite cylinder about the z-axis.
pub(crate) fn cylinder_exit(o: &Vec3, d: &Vec3, radius: f64) -> Option<f64> {
    leaving_root(d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y, o.x * o.x + o.y * o.y - radius * radius)
}

/// Where a ray leaves the infinite cylinder about the z-axis, whether it starts inside or not.
fn pipe_exit(o: &Vec3, d: &Vec3, radius: f64) -> Option<f64> {
    let (a, b) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
    let discriminant = b * b - a * (o.x * o.x + o.y * o.y - radius * radius);
    (a > 0.0 && discriminant >= 0.0).then(|| (discriminant.sqrt() - b) / a)
}

/// Where a ray from inside leaves the cone `r = slope·(apex - z)`, the part above the vertex.
pub(crate) fn cone_exit(o: &Vec3, d: &Vec3, slope: f64, apex: f64) -> Option<f64> {
    let (s2, rise) = (slope * slope, apex - o.z);
    let a = d.x * d.x + d.y * d.y - s2 * d.z * d.z;
    let b = o.x * d.x + o.y * d.y + s2 * rise * d.z;
    leaving_root(a, b, o.x * o.x + o.y * o.y - s2 * rise * rise)
}
