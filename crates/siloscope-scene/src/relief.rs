//! What makes a wall uneven: corrugation, seams, bolts, dents, and feed that sticks to it.
//!
//! All heights are measured outwards from the perfect wall, over the arc `s = R·azimuth` and z.

use crate::form::{Bend, Courses};
use crate::jet::{Jet, Limits, add, bump, smooth, to_nearest};
use crate::limits::bounded;
use siloscope::Result;
use std::f64::consts::TAU;

/// A sinusoidal sheet, waves along z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrugation {
    /// Length of a wave.
    pub pitch: f64,
    /// From crest to trough.
    pub depth: f64,
}

/// A round bump: inwards for a positive height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dent {
    /// Azimuth of its middle.
    pub azimuth: f64,
    /// z of its middle.
    pub z: f64,
    /// Radius at which it ends.
    pub radius: f64,
    /// How far its middle stands inwards.
    pub height: f64,
}

/// Overlapping sheets: ridges around the silo and along it, and bolt heads on those around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seams {
    /// Distance between ridges around the silo; 0 for none.
    pub spacing: f64,
    /// Number of ridges along the silo.
    pub uprights: u32,
    /// How far a ridge stands inwards.
    pub height: f64,
    /// Half its width.
    pub half_width: f64,
    /// Number of bolts around the silo; 0 for none.
    pub bolts: u32,
    /// How far a bolt's head stands inwards, beyond the ridge.
    pub bolt_height: f64,
    /// Radius of a bolt's head.
    pub bolt_radius: f64,
}

/// A band of feed that sticks to the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Film {
    /// z of its upper end.
    pub from: f64,
    /// z of its lower end.
    pub to: f64,
    /// Greatest thickness.
    pub thickness: f64,
    /// How many times around the silo it is thick and thin; 0 for even.
    pub lobes: u32,
    /// Azimuth at which it is thickest.
    pub azimuth: f64,
}

/// The length over which a film's ends taper off, as a share of its height.
const TAPER: f64 = 0.25;

/// All unevenness of a silo's wall.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Relief {
    /// Radius of the silo.
    pub radius: f64,
    /// z from which the corrugation's waves are counted, upwards: the cylinder's bottom.
    pub bottom: f64,
    /// z of the upper edge, from which seams are counted.
    pub top: f64,
    /// Corrugated sheet; the cylinder only.
    pub corrugation: Option<Corrugation>,
    /// Seams and bolts; the cylinder only.
    pub seams: Option<Seams>,
    /// Dents and bulges.
    pub dents: Vec<Dent>,
    /// Feed on the wall.
    pub films: Vec<Film>,
    /// Rings of sheet of another radius; the cylinder only.
    pub courses: Courses,
    /// A generatrix that is not straight.
    pub bend: Option<Bend>,
}

impl Corrugation {
    fn jet(&self, up: f64) -> Jet {
        let (k, amplitude) = (TAU / self.pitch, 0.5 * self.depth);
        let (sin, cos) = (k * up).sin_cos();
        [amplitude * sin, 0.0, -amplitude * k * cos]
    }

    fn limits(&self) -> Limits {
        let (k, amplitude) = (TAU / self.pitch, 0.5 * self.depth);
        Limits { inwards: amplitude, outwards: amplitude, slope: amplitude * k, bend: amplitude * k * k }
    }
}

impl Seams {
    fn jet(&self, radius: f64, azimuth: f64, below: f64) -> Jet {
        let around =
            if self.spacing > 0.0 { to_nearest(below - 0.5 * self.spacing, self.spacing) } else { f64::INFINITY };
        let mut sum = [0.0; 3];
        if around.abs() < self.half_width {
            sum = bump(self.height, self.half_width, 0.0, around);
        }
        if self.uprights > 0 {
            let along = radius * to_nearest(azimuth, TAU / f64::from(self.uprights));
            sum = add(sum, bump(self.height, self.half_width, along, 0.0));
        }
        if self.bolts > 0 && around.abs() < self.bolt_radius {
            let along = radius * to_nearest(azimuth, TAU / f64::from(self.bolts));
            sum = add(sum, bump(self.bolt_height, self.bolt_radius, along, around));
        }
        sum
    }

    fn limits(&self) -> Limits {
        let ridge = Limits::bump(self.height, self.half_width);
        let bolt = if self.bolts > 0 { Limits::bump(self.bolt_height, self.bolt_radius) } else { Limits::default() };
        ridge.plus(ridge).plus(bolt)
    }
}

impl Film {
    /// Thickness, inwards, and derivatives of the height outwards.
    fn jet(&self, radius: f64, azimuth: f64, z: f64) -> Jet {
        let taper = TAPER * (self.to - self.from);
        if z <= self.from || z >= self.to {
            return [0.0; 3];
        }
        let (share, slope) = if z - self.from < taper {
            smooth((z - self.from) / taper)
        } else if self.to - z < taper {
            let (share, slope) = smooth((self.to - z) / taper);
            (share, -slope)
        } else {
            (1.0, 0.0)
        };
        let lobes = f64::from(self.lobes);
        let (sin, cos) = (lobes * (azimuth - self.azimuth)).sin_cos();
        let (ring, turn) = (0.5 + 0.5 * cos, -0.5 * lobes * sin / radius);
        [-self.thickness * share * ring, -self.thickness * share * turn, -self.thickness * slope / taper * ring]
    }

    fn limits(&self, radius: f64) -> Limits {
        let (taper, turns) = (TAPER * (self.to - self.from), 0.5 * f64::from(self.lobes) / radius);
        let steep = 1.875 / taper; // the quintic's greatest slope; 5.7736 is its greatest second derivative
        let slope = self.thickness * steep.hypot(turns);
        let bend = self.thickness * (5.7736 / (taper * taper) + steep * turns + 2.0 * turns * turns);
        Limits { inwards: self.thickness, outwards: 0.0, slope, bend }
    }
}

impl Relief {
    /// Checks every length; reliefs deeper than a tenth of the radius are refused.
    pub fn validate(&self) -> Result<()> {
        if let Some(sheet) = &self.corrugation {
            bounded("corrugation_pitch", sheet.pitch, 1e-3, 1e3, "between 0.001 and 1000 m")?;
            bounded("corrugation_depth", sheet.depth, 0.0, 0.1 * self.radius, "at most 0.1 silo radii")?;
        }
        if let Some(seams) = &self.seams {
            seams.validate(self.radius)?;
        }
        for dent in &self.dents {
            bounded("dent_radius", dent.radius, 1e-3, self.radius, "between 0.001 m and the silo's radius")?;
            bounded("dent_depth", dent.height.abs(), 0.0, 0.1 * self.radius, "at most 0.1 silo radii")?;
            bounded("dents", dent.azimuth + dent.z, -1e6, 1e6, "at finite places")?;
        }
        for film in &self.films {
            bounded("film_bands", film.to - film.from, 1e-3, 1e3, "bands of at least 0.001 m height")?;
            bounded("film_bands", film.from, -1e3, 1e3, "at finite places")?;
            bounded("film_bands", film.thickness, 0.0, 0.1 * self.radius, "bands of at most 0.1 silo radii thickness")?;
            bounded("film_lobes", f64::from(film.lobes), 0.0, 64.0, "at most 64")?;
            bounded("film_azimuth", film.azimuth, -1e3, 1e3, "a finite angle")?;
        }
        if let Some(bend) = &self.bend {
            bend.validate(self.radius)?;
        }
        let limits = self.limits(true);
        bounded("defects", limits.inwards.max(limits.outwards), 0.0, 0.2 * self.radius, "within 0.2 radii of the wall")
    }

    /// Whether the wall is even.
    pub fn is_flat(&self) -> bool {
        let even = self.corrugation.is_none() && self.seams.is_none() && self.bend.is_none();
        even && self.dents.is_empty() && self.films.is_empty() && self.courses.0.is_empty()
    }

    /// Height and derivatives at a place of the cylinder, or of the cone.
    pub fn jet(&self, azimuth: f64, z: f64, on_cylinder: bool) -> Jet {
        let mut sum = self.film(azimuth, z);
        for dent in &self.dents {
            let ds = self.radius * to_nearest(azimuth - dent.azimuth, TAU);
            sum = add(sum, bump(dent.height, dent.radius, ds, z - dent.z));
        }
        if on_cylinder {
            let sheet = self.corrugation.map_or([0.0; 3], |sheet| sheet.jet(self.bottom - z));
            let seams = self.seams.map_or([0.0; 3], |seams| seams.jet(self.radius, azimuth, z - self.top));
            sum = add(sum, add(sheet, seams));
            if !self.courses.0.is_empty() {
                sum = add(sum, self.courses.jet(z));
            }
        }
        self.bend.map_or(sum, |bend| add(sum, bend.jet(self.radius, azimuth, z, (self.top, self.bottom))))
    }

    /// Height of the feed on the wall alone (negative: it stands inwards).
    pub fn film(&self, azimuth: f64, z: f64) -> Jet {
        self.films.iter().fold([0.0; 3], |sum, film| add(sum, film.jet(self.radius, azimuth, z)))
    }

    /// Bounds over the cylinder, or over the cone.
    pub fn limits(&self, on_cylinder: bool) -> Limits {
        let mut sum = self.films.iter().fold(Limits::default(), |sum, film| sum.plus(film.limits(self.radius)));
        sum = sum.plus(self.dent_limits());
        if on_cylinder {
            sum = self.corrugation.iter().fold(sum, |sum, sheet| sum.plus(sheet.limits()));
            sum = self.seams.iter().fold(sum, |sum, seams| sum.plus(seams.limits()));
            sum = sum.plus(self.courses.limits());
        }
        let height = self.bottom - self.top;
        self.bend.iter().fold(sum, |sum, bend| sum.plus(bend.limits(self.radius, height)))
    }
}

impl Relief {
    /// Dents that have a place in common all overlap each other, so one dent with all that overlap it is a bound.
    fn dent_limits(&self) -> Limits {
        let overlap = |a: &Dent, b: &Dent| {
            let ds = self.radius * to_nearest(a.azimuth - b.azimuth, TAU);
            ds.hypot(a.z - b.z) < a.radius + b.radius
        };
        let heap = |dent: &Dent| {
            let near = self.dents.iter().filter(|other| overlap(dent, other));
            near.fold(Limits::default(), |sum, dent| sum.plus(Limits::bump(dent.height, dent.radius)))
        };
        self.dents.iter().map(heap).fold(Limits::default(), Limits::widest)
    }
}

impl Seams {
    fn validate(&self, radius: f64) -> Result<()> {
        bounded("seam_height", self.height, 0.0, 0.05 * radius, "at most 0.05 silo radii")?;
        bounded("seam_width", self.half_width, 1e-3, radius, "between 0.002 m and the silo's diameter")?;
        if self.spacing != 0.0 {
            bounded("seam_spacing", self.spacing, 2.0 * self.half_width, 1e3, "0 or more than a seam's width")?;
        }
        let widest = (TAU * radius / (2.0 * self.half_width)).floor();
        bounded("upright_seams", f64::from(self.uprights), 0.0, widest, "few enough not to overlap")?;
        bounded("bolt_height", self.bolt_height, 0.0, 0.05 * radius, "at most 0.05 silo radii")?;
        bounded("bolt_radius", self.bolt_radius, 1e-3, radius, "between 0.001 m and the silo's radius")?;
        let closest = (TAU * radius / (2.0 * self.bolt_radius)).floor();
        bounded("bolts", f64::from(self.bolts), 0.0, closest, "few enough not to overlap")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rough() -> Relief {
        Relief {
            radius: 1.2,
            bottom: 3.0,
            top: 0.0,
            corrugation: Some(Corrugation { pitch: 0.076, depth: 0.013 }),
            seams: Some(Seams {
                spacing: 0.8,
                uprights: 6,
                height: 0.004,
                half_width: 0.03,
                bolts: 40,
                bolt_height: 0.008,
                bolt_radius: 0.012,
            }),
            dents: vec![Dent { azimuth: 3.1, z: 1.3, radius: 0.3, height: 0.03 }],
            films: vec![Film { from: 1.0, to: 1.6, thickness: 0.03, lobes: 2, azimuth: 0.4 }],
            courses: Courses(vec![[0.9, 0.004], [2.1, -0.006]]),
            bend: Some(Bend { depth: 0.008, azimuth: 0.7 }),
        }
    }

    proptest! {
        #[test]
        fn derivatives_and_limits_hold(azimuth in -3.2..3.2f64, z in 0.0..3.0f64) {
            let (relief, h) = (rough(), 1e-6);
            let at = |ds: f64, dz: f64| relief.jet(azimuth + ds / relief.radius, z + dz, true);
            let [height, along, down] = at(0.0, 0.0);
            let limits = relief.limits(true);
            let numeric = [(at(h, 0.0)[0] - at(-h, 0.0)[0]) / (2.0 * h), (at(0.0, h)[0] - at(0.0, -h)[0]) / (2.0 * h)];
            prop_assert!((numeric[0] - along).abs() < 1e-6 && (numeric[1] - down).abs() < 1e-6);
            prop_assert!(height >= -limits.inwards - 1e-12 && height <= limits.outwards + 1e-12);
            prop_assert!(along.hypot(down) <= limits.slope + 1e-9);
            for (ds, dz) in [(h, 0.0), (0.0, h), (0.7 * h, 0.7 * h), (0.7 * h, -0.7 * h)] {
                let (ahead, behind) = (at(ds, dz), at(-ds, -dz));
                let change = ((ahead[1] - behind[1]) * ds + (ahead[2] - behind[2]) * dz) / (2.0 * h * h);
                prop_assert!(change.abs() <= 1.0001 * limits.bend + 1e-6);
            }
        }
    }

    #[test]
    fn the_corrugation_has_the_sheet_s_pitch_and_depth() {
        let relief =
            Relief { seams: None, dents: vec![], films: vec![], courses: Courses::default(), bend: None, ..rough() };
        let heights: Vec<f64> = (0..7600).map(|i| relief.jet(0.3, 1.0 + 1e-5 * f64::from(i), true)[0]).collect();
        let (low, high) = heights.iter().fold((1.0f64, -1.0f64), |(low, high), &h| (low.min(h), high.max(h)));
        assert!((high - low - 0.013).abs() < 1e-8);
        assert!(relief.jet(0.3, 3.0, true)[0].abs() < 1e-15, "no step at the cone");
        assert_eq!(relief.jet(0.3, 3.1, false), [0.0; 3]);
    }
}
