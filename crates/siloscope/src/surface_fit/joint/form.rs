//! The wall's form: smooth departures from cylinder and cone, with amplitudes that are learned.
//!
//! A form is a sum of Legendre polynomials P_k over the height times cos nφ or sin nφ. Its coefficients have a Gaussian
//! prior whose width is a group's amplitude times a shape over the orders. What a frame shows of a group sets the width
//! of what it can't show.

use crate::geometry::surface::Part;

/// Groups of terms with one amplitude each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Rings: the same all round. Hoops, courses, taper.
    Rings,
    /// Bend of the generatrix: n = 1 from k = 2 on (k = 0 and 1 are the pose).
    Bend,
    /// Ovality, n = 2.
    Oval,
    /// Sheets and seams, n = 3 to 5.
    Sheets,
    /// The cone's own generatrix.
    ConeProfile,
}

/// All groups, in the order of their amplitudes.
pub const GROUPS: [Group; 5] = [Group::Rings, Group::Bend, Group::Oval, Group::Sheets, Group::ConeProfile];

/// One term.
#[derive(Debug, Clone, Copy)]
pub struct Term {
    /// n, waves around.
    pub order: usize,
    /// k, degree over the height.
    pub degree: usize,
    /// Whether it is the sine.
    pub sine: bool,
    /// Its group.
    pub group: Group,
    /// Its width in units of the group's amplitude.
    pub shape: f64,
}

/// Number of terms on the cylinder.
pub const CYLINDER_TERMS: usize = 36;
/// Number of terms on the cone.
pub const CONE_TERMS: usize = 16;

const DEGREES: usize = 9;
const ORDERS: usize = 6;

impl Group {
    /// First amplitude and its cap, metres, for a silo of a size: building tolerances, and what is another shape.
    pub fn bounds(self, size: f64) -> Bounds {
        match self {
            Self::Rings => Bounds { first: 1e-4, cap: 0.03 },
            Self::Bend => Bounds { first: 2e-4, cap: 0.025 },
            Self::Oval => Bounds { first: 0.002 * size, cap: 0.02 * size },
            Self::Sheets => Bounds { first: 1e-4, cap: 0.006 },
            Self::ConeProfile => Bounds { first: 1e-4, cap: 0.03 },
        }
    }
}

/// Where an amplitude starts and what it may not exceed, metres.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Standard deviation before anything is seen.
    pub first: f64,
    /// Largest amplitude that is a wall's form.
    pub cap: f64,
}

/// The terms of a part, in the order of its columns.
pub fn terms(part: Part) -> Vec<Term> {
    let mut list = Vec::new();
    let mut add = |order: usize, degrees: std::ops::Range<usize>, group: Group, shape: &dyn Fn(f64) -> f64| {
        for degree in degrees {
            for sine in [false, true].into_iter().take(if order == 0 { 1 } else { 2 }) {
                list.push(Term { order, degree, sine, group, shape: shape(degree as f64) });
            }
        }
    };
    match part {
        Part::Cylinder => {
            add(0, 1..9, Group::Rings, &|k| 1.0 / k);
            add(1, 2..6, Group::Bend, &|k| (k - 1.0).powf(-1.5));
            add(2, 0..4, Group::Oval, &|k| (1.0 + k).powi(-2));
            for n in 3..6 {
                add(n, 0..2, Group::Sheets, &|k| 3.0 / (n as f64 * (1.0 + k)));
            }
        }
        Part::Cone => {
            add(0, 2..6, Group::ConeProfile, &|k| 1.0 / (k - 1.0));
            add(1, 2..4, Group::ConeProfile, &|k| 1.0 / (k - 1.0));
            add(2, 0..2, Group::Oval, &|k| (1.0 + k).powi(-2));
            for n in 3..5 {
                add(n, 0..1, Group::Sheets, &|_| 3.0 / n as f64);
            }
        }
    }
    list
}

/// The terms of both parts, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct Form {
    /// Terms of the cylinder.
    pub cylinder: Vec<Term>,
    /// Terms of the cone.
    pub cone: Vec<Term>,
}

impl Default for Form {
    fn default() -> Self {
        Self { cylinder: terms(Part::Cylinder), cone: terms(Part::Cone) }
    }
}

impl Form {
    /// Terms of a part.
    pub fn of(&self, part: Part) -> &[Term] {
        match part {
            Part::Cylinder => &self.cylinder,
            Part::Cone => &self.cone,
        }
    }

    /// Values of a part's terms at a height t (−1 to 1 over the part) and an azimuth (cos φ, sin φ).
    #[inline]
    pub fn evaluate(&self, part: Part, t: f64, azimuth: [f64; 2], out: &mut [f64]) {
        let (p, waves) = (legendre(t), waves(azimuth));
        for (term, out) in self.of(part).iter().zip(out) {
            let wave = waves.get(term.order).map_or(0.0, |w| w[usize::from(term.sine)]);
            *out = p.get(term.degree).copied().unwrap_or(0.0) * wave;
        }
    }
}

/// P_0 to P_8.
#[inline]
fn legendre(t: f64) -> [f64; DEGREES] {
    let mut p = [1.0; DEGREES];
    p[1] = t;
    for k in 2..DEGREES {
        let n = k as f64;
        p[k] = ((2.0 * n - 1.0) * t * p[k - 1] - (n - 1.0) * p[k - 2]) / n;
    }
    p
}

/// cos nφ and sin nφ for n = 0 to 5.
#[inline]
fn waves([c, s]: [f64; 2]) -> [[f64; 2]; ORDERS] {
    let mut w = [[1.0, 0.0]; ORDERS];
    for n in 1..ORDERS {
        let [x, y] = w[n - 1];
        w[n] = [x * c - y * s, x * s + y * c];
    }
    w
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_has_its_term() {
        assert_eq!(terms(Part::Cylinder).len(), CYLINDER_TERMS);
        assert_eq!(terms(Part::Cone).len(), CONE_TERMS);
    }

    #[test]
    fn no_term_is_the_pose_or_the_radius() {
        let cylinder = terms(Part::Cylinder);
        assert!(cylinder.iter().all(|t| (t.order, t.degree) != (0, 0)));
        assert!(cylinder.iter().filter(|t| t.order == 1).all(|t| t.degree > 1));
    }

    #[test]
    fn legendre_and_waves_are_those_of_the_textbook() {
        let p = legendre(0.3);
        assert!((p[2] - 0.5 * (3.0 * 0.09 - 1.0)).abs() < 1e-15);
        assert!((p[3] - 0.5 * (5.0 * 0.027 - 0.9)).abs() < 1e-15);
        let (s, c) = 0.7f64.sin_cos();
        let w = waves([c, s]);
        assert!((w[5][0] - 3.5f64.cos()).abs() < 1e-14 && (w[5][1] - 3.5f64.sin()).abs() < 1e-14);
    }
}
