//! The inside of a silo that holds feed: a cylinder on a cone, perhaps with an outlet pipe below the cone.

use crate::geometry::surface::{Cone, SiloSurface};
use crate::{Error, Result, SiloPose};
use std::f64::consts::PI;

/// A silo's inside in the silo frame (z down, 0 at the camera's height). Metres.
///
/// The floor under a place is the cone, and within the outlet's radius the outlet's closed end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vessel {
    /// Radius of the cylinder.
    pub radius: f64,
    /// z where the cylinder meets the cone.
    pub cylinder_bottom: f64,
    /// z of the cone's vertex; equal to `cylinder_bottom` for a flat floor.
    pub apex: f64,
    /// z up to which the silo can be filled.
    pub top: f64,
    /// Radius of the outlet pipe on the axis; 0 for none.
    pub outlet_radius: f64,
    /// How far the outlet pipe's closed end lies below the cone's vertex.
    pub outlet_length: f64,
    /// Ovality (c, s): the cross-section's radius is larger by the factor 1 + c cos 2φ + s sin 2φ. Lengths are means.
    pub ovality: [f64; 2],
}

/// Derivatives of a volume by the lengths of the geometry, m³/m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shells {
    /// Derivative by the radius.
    pub radius: f64,
    /// Derivative by the cylinder's lower edge.
    pub cylinder_bottom: f64,
    /// Derivative by the vertex.
    pub apex: f64,
}

impl Vessel {
    /// Checks every length by its name.
    pub fn validate(&self) -> Result<()> {
        let check = |name, value: f64, fits: bool, bounds| match value.is_finite() && fits {
            true => Ok(()),
            false => Err(Error::Setting { name, bounds, value }),
        };
        check("radius", self.radius, (1e-3..=1e3).contains(&self.radius), "between 0.001 and 1000 m")?;
        check("cylinder_bottom", self.cylinder_bottom, self.cylinder_bottom.abs() <= 1e3, "between -1000 and 1000 m")?;
        let cone = self.apex - self.cylinder_bottom;
        check("apex", self.apex, (0.0..=1e3).contains(&cone), "at or up to 1000 m below cylinder_bottom")?;
        check("top", self.top, (-1e3..self.apex).contains(&self.top), "above the cone's vertex")?;
        check(
            "outlet_radius",
            self.outlet_radius,
            (0.0..self.radius).contains(&self.outlet_radius),
            "below the radius",
        )?;
        check("outlet_length", self.outlet_length, (0.0..=1e3).contains(&self.outlet_length), "between 0 and 1000 m")?;
        let oval = self.ovality[0].hypot(self.ovality[1]);
        check("ovality", oval, oval <= 0.2, "at most 0.2")
    }

    /// Area of the oval cross-section over that of the circle of the mean radius: the mean of the factor's square.
    pub fn stretch(&self) -> f64 {
        1.0 + 0.5 * (self.ovality[0] * self.ovality[0] + self.ovality[1] * self.ovality[1])
    }

    /// The round wall about a camera; without a cone where the floor is flat.
    pub fn surface(&self, pose: &SiloPose) -> SiloSurface {
        let height = self.cone_height();
        let cone = (height > 1e-9).then(|| Cone { slope: self.radius / height, apex: self.apex });
        SiloSurface { pose: *pose, radius: Some(self.radius), cone, ovality: [0.0; 2] }
    }

    /// Height of the cone.
    pub fn cone_height(&self) -> f64 {
        self.apex - self.cylinder_bottom
    }

    /// z of the floor at a distance from the axis.
    pub fn floor(&self, r: f64) -> f64 {
        if r < self.outlet_radius { self.apex + self.outlet_length } else { self.cone(r) }
    }

    /// z of the cone's wall at a distance from the axis.
    pub fn cone(&self, r: f64) -> f64 {
        self.apex - self.cone_height() * r / self.radius
    }

    /// Derivatives of the cone's z at a distance from the axis by the lengths of the geometry.
    pub fn cone_derivatives(&self, r: f64) -> Shells {
        let share = r / self.radius;
        Shells { radius: self.cone_height() * share / self.radius, cylinder_bottom: share, apex: 1.0 - share }
    }

    /// Volume under the level plane at a height z.
    pub fn volume_below(&self, z: f64) -> f64 {
        let disc = PI * self.radius * self.radius;
        let in_cylinder = disc * (self.cylinder_bottom - z).max(0.0);
        self.stretch() * (in_cylinder + self.cone_below(z)) + self.pipe_below(z)
    }

    /// Volume that the silo holds up to its top.
    pub fn capacity(&self) -> f64 {
        self.volume_below(self.top)
    }

    fn cone_below(&self, z: f64) -> f64 {
        let height = self.cone_height();
        if height <= 0.0 {
            return 0.0;
        }
        let share = ((self.apex - z) / height).clamp(0.0, 1.0);
        PI * self.radius * self.radius * height / 3.0 * share.powi(3)
    }

    /// The outlet pipe: from its closed end up to the cone's wall, as far as that is outside the cone.
    fn pipe_below(&self, z: f64) -> f64 {
        let disc = PI * self.outlet_radius * self.outlet_radius;
        let rim = self.cone(self.outlet_radius);
        let filled = disc * (self.apex + self.outlet_length - z.max(rim)).max(0.0);
        let cone_inside = if z > rim { self.cone_below(z) } else { self.cone_below(rim) };
        filled - cone_inside.min(filled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vessel() -> Vessel {
        Vessel {
            radius: 1.25,
            cylinder_bottom: 4.5,
            apex: 5.5,
            top: 0.0,
            outlet_radius: 0.0,
            outlet_length: 0.0,
            ovality: [0.0; 2],
        }
    }

    /// Volume by thin shells around the axis.
    fn by_shells(v: &Vessel, z: f64) -> f64 {
        let n = 200_000;
        let dr = v.radius / n as f64;
        (0..n).map(|i| (i as f64 + 0.5) * dr).map(|r| 2.0 * PI * r * dr * (v.floor(r) - z).max(0.0)).sum()
    }

    #[test]
    fn level_volumes_have_their_closed_forms() {
        let v = vessel();
        assert!((v.volume_below(4.5) - PI * 1.25 * 1.25 / 3.0).abs() < 1e-12);
        assert!((v.volume_below(5.0) - PI * 0.625 * 0.625 * 0.5 / 3.0).abs() < 1e-12);
        assert!((v.capacity() - PI * 1.25 * 1.25 * (4.5 + 1.0 / 3.0)).abs() < 1e-12);
        assert_eq!(v.volume_below(5.6), 0.0);
    }

    #[test]
    fn an_outlet_pipe_adds_its_own_volume() {
        let v = Vessel { outlet_radius: 0.2, outlet_length: 0.3, ..vessel() };
        for z in [0.0, 4.0, 4.9, 5.38, 5.5, 5.7] {
            assert!((v.volume_below(z) - by_shells(&v, z)).abs() < 1e-5, "z = {z}");
        }
    }

    #[test]
    fn lengths_out_of_bounds_are_refused_by_name() {
        let bad = [
            ("radius", Vessel { radius: 0.0, ..vessel() }),
            ("apex", Vessel { apex: 4.0, ..vessel() }),
            ("top", Vessel { top: 6.0, ..vessel() }),
            ("outlet_radius", Vessel { outlet_radius: 2.0, ..vessel() }),
            ("outlet_length", Vessel { outlet_length: f64::NAN, ..vessel() }),
            ("cylinder_bottom", Vessel { cylinder_bottom: f64::NAN, ..vessel() }),
        ];
        for (field, v) in bad {
            assert!(matches!(v.validate(), Err(Error::Setting { name, .. }) if name == field), "{field}");
        }
    }

    proptest! {
        #[test]
        fn volume_grows_with_the_cube_of_the_size(s in 0.1f64..10.0, z in 0.0f64..5.5) {
            let v = Vessel { outlet_radius: 0.1, outlet_length: 0.2, ..vessel() };
            let big = Vessel {
                radius: s * v.radius, cylinder_bottom: s * v.cylinder_bottom, apex: s * v.apex, top: s * v.top,
                outlet_radius: s * v.outlet_radius, outlet_length: s * v.outlet_length,
                ..v
            };
            let ratio = big.volume_below(s * z) / (s * s * s);
            prop_assert!((ratio - v.volume_below(z)).abs() < 1e-9 * (1.0 + v.volume_below(z)));
        }
    }
}
