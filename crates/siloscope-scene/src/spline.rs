//! The uniform cubic B-spline.

/// Weights of the uniform cubic B-spline.
pub fn spline(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    [
        v * v * v / 6.0,
        (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
        (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
        u * u * u / 6.0,
    ]
}

/// Their derivatives.
pub fn spline_slope(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    [-v * v / 2.0, (3.0 * u - 4.0) * u / 2.0, (4.0 - 3.0 * v) * v / 2.0, u * u / 2.0]
}
