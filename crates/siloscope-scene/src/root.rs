//! The first crossing of a surface along a ray, found surely.

/// Steps after which the search stands still on a surface it only touches.
const MAX_STEPS: usize = 2000;

/// What is known of a function at one place.
#[derive(Debug, Clone, Copy)]
pub struct Probe {
    /// Its value.
    pub value: f64,
    /// Its first derivative.
    pub slope: f64,
    /// An upper bound of its second derivative from here to `reach` further on.
    pub bend: f64,
    /// How far on the bound holds.
    pub reach: f64,
}

/// First `t` in `[start, end)` where `f` reaches 0 from below, or None.
///
/// From the bound follows `f(t + h) <= value + slope·h + bend·h²/2`, so the step to the root of that parabola can't jump
/// over a crossing; near a crossing it is Newton's step and converges quadratically.
pub fn first_crossing(f: impl Fn(f64) -> Probe, start: f64, end: f64) -> Option<f64> {
    let mut t = start;
    for _ in 0..MAX_STEPS {
        if t >= end {
            return None;
        }
        let probe = f(t);
        if probe.value >= 0.0 {
            return Some(t);
        }
        let step = safe_step(&probe).min(probe.reach);
        t += step;
        if step <= 1e-15 * t.abs() {
            break;
        }
    }
    (t < end).then_some(t)
}

/// The positive root of the parabola for a negative value; infinite where there is none.
fn safe_step(&Probe { value, slope, bend, .. }: &Probe) -> f64 {
    let width = (slope * slope - 2.0 * bend * value).sqrt();
    if slope > 0.0 {
        -2.0 * value / (slope + width)
    } else if bend > 0.0 {
        (width - slope) / bend
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn probe(value: f64, slope: f64, bend: f64) -> Probe {
        Probe { value, slope, bend, reach: f64::INFINITY }
    }

    #[test]
    fn finds_the_first_of_many_crossings() {
        let f = |t: f64| probe((3.0 * t).sin() - 0.5, 3.0 * (3.0 * t).cos(), 9.0);
        assert_eq!(first_crossing(f, 0.3, 10.0), Some(0.3), "above 0 from the start");
        let t = first_crossing(f, 1.0, 10.0).unwrap_or(f64::NAN);
        let expected = (2.0 * std::f64::consts::PI + std::f64::consts::FRAC_PI_6) / 3.0;
        assert!((t - expected).abs() < 1e-14);
    }

    #[test]
    fn passes_a_near_miss_and_finds_none() {
        let f = |t: f64| probe(-(t - 1.0) * (t - 1.0) - 1e-9, -2.0 * (t - 1.0), 40.0);
        assert_eq!(first_crossing(f, 0.0, 3.0), None);
        assert_eq!(first_crossing(|t| probe(-1.0 - t, -1.0, 0.0), 0.0, 1e9), None);
    }

    #[test]
    fn a_bound_that_holds_only_nearby_is_not_used_beyond() {
        let kink = |t: f64| if t < 1.0 { 0.0 } else { 100.0 * (t - 1.0) };
        let f =
            |t: f64| Probe { value: kink(t) - 1.0, slope: if t < 1.0 { 0.0 } else { 100.0 }, bend: 0.0, reach: 0.25 };
        let t = first_crossing(f, 0.0, 3.0).unwrap_or(f64::NAN);
        assert!((t - 1.01).abs() < 1e-14);
    }
}
