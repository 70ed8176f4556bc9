//! Straight lines through weighted places.

/// Weighted sums over places (x, y).
#[derive(Debug, Clone, Copy, Default)]
pub struct LineFit {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl LineFit {
    /// The sums over places with their weights.
    pub fn of(places: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        let mut sums = Self::default();
        for (x, y, weight) in places {
            sums.n += weight;
            sums.x += weight * x;
            sums.y += weight * y;
            sums.xx += weight * (x * x);
            sums.xy += weight * (x * y);
        }
        sums
    }

    /// Spread of x times the squared weight; 0 where no line is determined.
    pub fn spread(&self) -> f64 {
        self.n * self.xx - self.x * self.x
    }

    /// Slope of the least-squares line; not finite where none is determined.
    pub fn slope(&self) -> f64 {
        (self.n * self.xy - self.x * self.y) / self.spread()
    }

    /// The x at which the least-squares line is 0.
    pub fn root(&self) -> f64 {
        let slope = self.slope();
        (slope * self.x - self.y) / (self.n * slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_stands_for_as_many_places() {
        let light = LineFit::of([(0.0, 1.0, 1.0), (1.0, 2.0, 2.0), (3.0, 1.0, 1.0)]);
        let each = LineFit::of([(0.0, 1.0), (1.0, 2.0), (1.0, 2.0), (3.0, 1.0)].map(|(x, y)| (x, y, 1.0)));
        assert_eq!(light.slope(), each.slope());
        let line = LineFit::of((0..5).map(|i| (f64::from(i), 3.0 - 0.5 * f64::from(i), f64::from(i + 1))));
        assert!((line.slope() + 0.5).abs() < 1e-14 && (line.root() - 6.0).abs() < 1e-13);
        assert_eq!(LineFit::of([(1.0, 2.0, 1.0)]).spread(), 0.0);
    }
}
