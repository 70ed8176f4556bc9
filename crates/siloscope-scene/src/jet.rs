//! Heights over the perfect wall with their derivatives, and bounds of both.

/// Height over the perfect wall and its derivatives along the arc and z.
pub type Jet = [f64; 3];

/// Bounds of a relief: how far in and out it reaches, its slope, and its second derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Furthest inwards.
    pub inwards: f64,
    /// Furthest outwards.
    pub outwards: f64,
    /// Greatest slope.
    pub slope: f64,
    /// Greatest second derivative in any direction.
    pub bend: f64,
}

impl Limits {
    pub(crate) fn bump(height: f64, radius: f64) -> Self {
        let h = height.abs();
        // (1 - q²)³ has slopes up to 1.7174 and second derivatives up to 6
        Self {
            inwards: height.max(0.0),
            outwards: (-height).max(0.0),
            slope: 1.7174 * h / radius,
            bend: 6.0 * h / (radius * radius),
        }
    }

    pub(crate) fn widest(self, other: Self) -> Self {
        Self {
            inwards: self.inwards.max(other.inwards),
            outwards: self.outwards.max(other.outwards),
            slope: self.slope.max(other.slope),
            bend: self.bend.max(other.bend),
        }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            inwards: self.inwards + other.inwards,
            outwards: self.outwards + other.outwards,
            slope: self.slope + other.slope,
            bend: self.bend + other.bend,
        }
    }
}

pub(crate) fn add(a: Jet, b: Jet) -> Jet {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `-height·(1 - q²)³` for q = |(ds, dz)|/radius < 1: a bump inwards.
pub(crate) fn bump(height: f64, radius: f64, ds: f64, dz: f64) -> Jet {
    let q2 = (ds * ds + dz * dz) / (radius * radius);
    if q2 >= 1.0 {
        return [0.0; 3];
    }
    let rest = 1.0 - q2;
    let pull = 6.0 * height * rest * rest / (radius * radius);
    [-height * rest * rest * rest, pull * ds, pull * dz]
}

/// Signed distance from `x` to the nearest multiple of `pitch`.
pub(crate) fn to_nearest(x: f64, pitch: f64) -> f64 {
    x - pitch * (x / pitch).round()
}

/// The quintic from 0 to 1 with flat ends, and its derivative.
pub(crate) fn smooth(u: f64) -> (f64, f64) {
    (u * u * u * (10.0 + u * (6.0 * u - 15.0)), 30.0 * u * u * (1.0 - u) * (1.0 - u))
}
