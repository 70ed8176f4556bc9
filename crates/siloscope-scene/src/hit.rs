//! Where a ray ends.

use siloscope::Vec3;
pub use siloscope::geometry::label::Label;

/// Where a ray ends.
#[derive(Debug, Clone)]
pub struct Hit {
    /// Parameter along the ray; the depth for rays `(x, y, 1)` of the camera.
    pub t: f64,
    /// Unit normal towards the air, in the world's frame.
    pub normal: Vec3,
    /// What was hit.
    pub label: Label,
}
