//! Where rays meet cylinders and cones about the z-axis.

use siloscope::Vec3;

/// Unit vector from the axis to a point, horizontal.
pub(crate) fn radial(p: &Vec3) -> Vec3 {
    let r = p.xy().norm();
    if r > 0.0 { Vec3::new(p.x / r, p.y / r, 0.0) } else { Vec3::x() }
}

/// Smallest positive root of `a t² + 2 b t + c` for `c <= 0`, free of cancellation.
fn leaving_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 || (b <= 0.0 && a <= 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    Some(if b > 0.0 { -c / (b + root) } else { (root - b) / a })
}

/// Where a ray from inside leaves the infinite cylinder about the z-axis.
pub(crate) fn cylinder_exit(o: &Vec3, d: &Vec3, radius: f64) -> Option<f64> {
    leaving_root(d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y, o.x * o.x + o.y * o.y - radius * radius)
}

/// Where a ray leaves the infinite cylinder about the z-axis, whether it starts inside or not.
pub(crate) fn pipe_exit(o: &Vec3, d: &Vec3, radius: f64) -> Option<f64> {
    let (a, b) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
    let discriminant = b * b - a * (o.x * o.x + o.y * o.y - radius * radius);
    (a > 0.0 && discriminant >= 0.0).then(|| (discriminant.sqrt() - b) / a)
}

/// Where a ray from inside leaves the cone `r = slope·(apex - z)`, the part above the vertex.
pub(crate) fn cone_exit(o: &Vec3, d: &Vec3, slope: f64, apex: f64) -> Option<f64> {
    let (s2, rise) = (slope * slope, apex - o.z);
    let a = d.x * d.x + d.y * d.y - s2 * d.z * d.z;
    let b = o.x * d.x + o.y * d.y + s2 * rise * d.z;
    leaving_root(a, b, o.x * o.x + o.y * o.y - s2 * rise * rise)
}
