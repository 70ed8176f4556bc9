//! What a pixel shows.

/// What a pixel shows; the numbers are those of the label images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Label {
    /// No measurement.
    None = 0,
    /// The cylinder.
    Cylinder = 1,
    /// The cone.
    Cone = 2,
    /// Feed, and any other surface in front of the wall.
    Feed = 3,
    /// No surface: dust, flying pixels, returns from behind the wall. In the simulator also outlet, roof and clutter.
    Other = 4,
}
