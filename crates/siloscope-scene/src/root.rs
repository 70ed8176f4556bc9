//! The first crossing of a surface along a ray, found surely.

/// Steps after which the search stands still on a surface it only touches.
const MAX_STEPS: usize = 2000;

/// First `t` in `[start, end)` where `f` reaches 0 from below, or None.
///
/// `f` returns the value and the slope; `bend` is an upper bound of its second derivative. Then
/// `f(t + h) <= f + slope·h + bend·h²/2`, so the step to the root of that parabola can't jump over a crossing; near a
/// crossing it is Newton's step and converges quadratically.
pub fn first_crossing(f: impl Fn(f64) -> (f64, f64), bend: f64, start: f64, end: f64) -> Option<f64> {
    let mut t = start;
    for _ in 0..MAX_STEPS {
        if t >= end {
            return None;
        }
        let (value, slope) = f(t);
        if value >= 0.0 {
            return Some(t);
        }
        let step = safe_step(value, slope, bend)?;
        t += step;
        if step <= 1e-15 * t.abs() {
            return Some(t);
        }
    }
    (t < end).then_some(t)
}

/// The positive root of `value + slope·h + bend·h²/2` for a negative value; None where there is none.
fn safe_step(value: f64, slope: f64, bend: f64) -> Option<f64> {
    let width = (slope * slope - 2.0 * bend * value).sqrt();
    let step = if slope > 0.0 { -2.0 * value / (slope + width) } else { (width - slope) / bend };
    step.is_finite().then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_first_of_many_crossings() {
        let f = |t: f64| ((3.0 * t).sin() - 0.5, 3.0 * (3.0 * t).cos());
        let t = first_crossing(f, 9.0, 0.3, 10.0); // f(0.3) > 0 already
        assert_eq!(t, Some(0.3));
        let t = first_crossing(f, 9.0, 1.0, 10.0).unwrap_or(f64::NAN);
        let expected = (2.0 * std::f64::consts::PI + std::f64::consts::FRAC_PI_6) / 3.0;
        assert!((t - expected).abs() < 1e-14);
    }

    #[test]
    fn passes_a_near_miss_and_finds_none() {
        let f = |t: f64| (-(t - 1.0) * (t - 1.0) - 1e-9, -2.0 * (t - 1.0));
        assert_eq!(first_crossing(f, 40.0, 0.0, 3.0), None);
        assert_eq!(first_crossing(|t| (-1.0 - t, -1.0), 0.0, 0.0, 1e9), None);
    }
}
