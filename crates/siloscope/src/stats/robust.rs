//! Robust statistics: medians, and Tukey's biweight.

/// Standard deviation of a normal distribution over its median absolute deviation.
pub const MAD_TO_STD: f64 = 1.4826;

/// Median of the chi-square distribution with one degree of freedom.
pub const MEDIAN_OF_CHI_SQUARE: f64 = 0.455;

/// Cutoff of Tukey's biweight in standard deviations: 95 % efficiency on normal residuals.
pub const TUKEY: f64 = 4.685;

/// Median; of an even number of values the mean of the middle two.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    let (half, even) = (values.len() / 2, values.len().is_multiple_of(2));
    if values.is_empty() {
        return None;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(if even { 0.5 * (lower + upper) } else { upper })
}

/// Upper median of a key, which reorders the items; of an even number of items the upper one of the middle two.
pub fn upper_median_by<T>(items: &mut [T], key: impl Fn(&T) -> f64) -> Option<f64> {
    let middle = items.len() / 2;
    (!items.is_empty()).then(|| key(items.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b))).1))
}

/// Upper median; of an even number of values the upper one of the middle two.
pub fn upper_median(values: &mut [f64]) -> Option<f64> {
    upper_median_by(values, |value| *value)
}

/// Weight of Tukey's biweight, 0 to 1, for a squared residual in units of its variance.
#[inline]
pub fn tukey_weight(squared: f64, cutoff: f64) -> f64 {
    let t = 1.0 - squared / (cutoff * cutoff);
    if t <= 0.0 { 0.0 } else { t * t }
}

/// Derivative of residual × weight by the residual, for a squared residual in units of its variance.
#[inline]
pub fn tukey_slope(squared: f64, cutoff: f64) -> f64 {
    let t = squared / (cutoff * cutoff);
    if t >= 1.0 { 0.0 } else { (1.0 - t) * (1.0 - 5.0 * t) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_numbers_of_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(Vec::new()), None);
        assert_eq!(upper_median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(upper_median(&mut []), None);
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_score() {
        let score = |r: f64| r * tukey_weight(r * r, TUKEY);
        for r in [-6.0, -4.0, -1.0, 0.0, 0.5, 2.0, 4.6, 5.0] {
            let numeric = (score(r + 1e-6) - score(r - 1e-6)) / 2e-6;
            assert!((tukey_slope(r * r, TUKEY) - numeric).abs() < 1e-8, "{r}");
        }
    }
}
