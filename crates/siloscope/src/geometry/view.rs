//! From which side a wall is seen.

/// The side decides the sign of the wall's curvature, as normals point to the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum View {
    /// From inside: walls bend towards the camera, k1 = 1/R (Property 5).
    #[default]
    Inside,
    /// From outside: walls bend away from it, and it is the other principal curvature that is not 0 but -1/R.
    Outside,
    /// Unknown, or from several places at once: the points' origin need not be a camera.
    Either,
}

impl View {
    /// Whether a wall seen from this side may have a curvature of this sign.
    pub fn allows(self, curvature: f64) -> bool {
        match self {
            Self::Inside => curvature > 0.0,
            Self::Outside => curvature < 0.0,
            Self::Either => true,
        }
    }
}
