//! What the sensor's profile says at every depth, tabulated: looking up is quicker than solving for every pixel.

/// Step of the table, in metres. A quadratic bias of 0.02 per metre is then interpolated to 0.1 µm.
const STEP: f64 = 0.004;

/// True depth and noise as functions of the measured depth.
#[derive(Debug, Clone)]
pub struct DepthTable {
    rows: Vec<[f32; 2]>,
}

impl DepthTable {
    /// Tabulates `true_depth(measured)` and `sigma(true)` up to the measured depth `reach`; deeper ones read as none.
    pub fn new(reach: f64, true_depth: impl Fn(f64) -> f64, sigma: impl Fn(f64) -> f64) -> Self {
        let steps = (reach.clamp(0.0, 1e3) / STEP).ceil() as usize + 2;
        let row = |i: usize| {
            let d = true_depth(i as f64 * STEP);
            [d as f32, sigma(d.max(0.0)) as f32]
        };
        Self { rows: (0..steps).map(row).collect() }
    }

    /// True depth and its standard deviation, or None beyond the table and for what is no measurement.
    #[inline]
    pub fn look_up(&self, measured: f32) -> Option<(f64, f64)> {
        if !(measured > 0.0) {
            return None; // 0, negative and NaN
        }
        let place = measured * (1.0 / STEP) as f32;
        let i = place as usize; // an infinite depth saturates and is beyond the table
        let [[d0, s0], [d1, s1]] = *self.rows.get(i..)?.first_chunk::<2>()?;
        let share = place - i as f32;
        let depth = d0 + share * (d1 - d0);
        (depth > 0.0).then(|| (f64::from(depth), f64::from(s0 + share * (s1 - s0))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves measured = true + s(true) for the Astra S (Eqs. 8 and 10), in metres.
    fn astra_s(measured: f64) -> f64 {
        let (a, b, c) = (2.2093e-2, 1.0 - 0.017878, 3.4397e-3 - measured);
        (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a)
    }

    #[test]
    fn a_quadratic_bias_is_undone() {
        let table = DepthTable::new(8.0, astra_s, |d| 0.002 * d);
        for d in [0.41f64, 1.2345, 3.3333, 6.7891] {
            let measured = d + (2.2093e-2 * d * d - 0.017878 * d + 3.4397e-3);
            let Some((depth, sigma)) = table.look_up(measured as f32) else { panic!("in the table") };
            assert!((depth - d).abs() < 1e-6 && (sigma - 0.002 * d).abs() < 1e-6, "{depth} is not {d}");
        }
    }

    #[test]
    fn what_is_no_measurement_has_no_depth() {
        let table = DepthTable::new(8.0, |m| m, |_| 0.0);
        for measured in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, 8.1] {
            assert!(table.look_up(measured).is_none(), "{measured}");
        }
    }
}
