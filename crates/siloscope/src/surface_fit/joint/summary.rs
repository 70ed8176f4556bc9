//! What the joint fit says beside the wall.

use crate::surface_fit::joint::answer::JointAnswer;

/// What the joint fit says beside the wall.
#[derive(Debug, Clone)]
pub struct JointSummary {
    /// The answer with its models.
    pub answer: JointAnswer,
    /// Model error of cylinder and cone, metres across the wall.
    pub tau: [f64; 2],
    /// Correlation factors of cylinder and cone.
    pub correlation: [f64; 2],
    /// Learned amplitudes of the form, metres.
    pub amplitudes: [f64; 5],
    /// Factor by which the intrinsics are off more than stated.
    pub camera_factor: f64,
}
