//! What every step of the joint fit is given of a frame.

use crate::geometry::depth_image::DepthImage;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::model::Inputs;
use crate::surface_fit::joint::readings::Readings;

/// What stays the same during fits of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The tiles.
    pub readings: &'a Readings<'a>,
    /// The pixels.
    pub image: &'a DepthImage<'a>,
    /// The form's terms.
    pub form: &'a Form,
    /// What is known before.
    pub inputs: &'a Inputs,
    /// Whether the vessel is said to end in a coaxial cone.
    pub told_cone: bool,
}
