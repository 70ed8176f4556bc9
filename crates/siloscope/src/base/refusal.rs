//! Why a frame gives no answer: one table of reasons, each with what to try.

/// Why a frame gives no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// Hardly any depth.
    NoDepth,
    /// No cylinder or cone agrees with enough of the frame.
    NoWall,
    /// What looks like wall does not turn about the axis: flat walls, a corner, a shaft.
    Flat,
    /// What looks like wall bends along its generatrix: a sphere, a heap.
    Bent,
    /// Only a cone as flat as feed lies.
    ConeMayBeFeed,
    /// Points lie where the wall would have to be in front of them.
    BehindWall,
    /// Wall, but too little of it to fix the pose.
    PoorlyDetermined,
    /// Wall that fixes the axis' direction, but not where the axis runs.
    PositionUnknown,
    /// Wall that fixes where the axis runs, but not its direction.
    DirectionUnknown,
    /// A cone without cylinder wall: its axis need not be the silo's.
    ConeAlone,
    /// The wall departs from a cylinder by more than a wall's form.
    Deformed,
    /// Vessels that explain the frame alike have different axes.
    AmbiguousVessel,
    /// The axis contradicts the given gravity.
    GravityContradicts,
    /// A bare cylinder, seen from aside: it could as well be upside down.
    EndUnknown,
    /// The vessel's lower end lies behind the camera.
    AboveHorizon,
}

impl Refusal {
    /// Every reason.
    pub const ALL: [Self; 15] = [
        Self::NoDepth,
        Self::NoWall,
        Self::Flat,
        Self::Bent,
        Self::ConeMayBeFeed,
        Self::BehindWall,
        Self::PoorlyDetermined,
        Self::PositionUnknown,
        Self::DirectionUnknown,
        Self::ConeAlone,
        Self::Deformed,
        Self::AmbiguousVessel,
        Self::GravityContradicts,
        Self::EndUnknown,
        Self::AboveHorizon,
    ];

    /// Stable name, what it means, and what to try.
    pub fn row(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::NoDepth => (
                "no-depth",
                "hardly any pixel of the frame has a depth",
                "check the depth unit, the mask, the sensor's range, and its window for dirt",
            ),
            Self::NoWall => (
                "no-wall",
                "no cylinder or cone agrees with enough of the frame",
                "wait until the level has fallen, or turn the camera so that more of the wall is in view",
            ),
            Self::Flat => (
                "flat-wall",
                "what could be wall is flat: its normals do not turn about an axis",
                "check that the camera looks into a round silo, not at a room, a shaft or a plane",
            ),
            Self::Bent => (
                "bent-wall",
                "what could be wall bends along its height as well, as a sphere or a heap does",
                "wait until more of the straight wall is in view, or mask what is not wall",
            ),
            Self::ConeMayBeFeed => (
                "cone-may-be-feed",
                "only a cone as flat as feed lies is in view; it may be the feed's own surface",
                "wait until the level has fallen, or turn the camera so that cylinder wall is in view",
            ),
            Self::BehindWall => (
                "behind-wall",
                "many points lie behind the wall that was found, where nothing can be",
                "mask what is not the silo, or check the camera file",
            ),
            Self::PoorlyDetermined => (
                "poorly-determined",
                "wall is in view, but too little of it to fix the axis",
                "wait until the level has fallen, or turn the camera so that more of the wall is in view",
            ),
            Self::PositionUnknown => (
                "position-unknown",
                "the wall in view tells how the axis is directed, but not where it runs",
                "turn the camera so that more of the circle is in view, or give the sensor's profile or a diameter",
            ),
            Self::DirectionUnknown => (
                "direction-unknown",
                "the wall in view tells where the axis runs, but not how it is directed",
                "turn the camera so that more of the wall's height is in view, or give gravity",
            ),
            Self::ConeAlone => (
                "cone-alone",
                "only a cone is in view; it may be oblique, or feed, and its axis need not be the silo's",
                "turn the camera so that cylinder wall is in view, give gravity, or say that the silo ends in a cone",
            ),
            Self::Deformed => (
                "deformed-wall",
                "what could be wall departs from a cylinder by more than a wall's own form",
                "wait until the wall is clean of feed that sticks to it, or mask what is not wall",
            ),
            Self::AmbiguousVessel => (
                "ambiguous-vessel",
                "vessels of different shapes, with different axes, explain the frame alike",
                "wait until the level has fallen, or turn the camera so that more of the cylinder is in view",
            ),
            Self::GravityContradicts => (
                "gravity-contradicts",
                "the wall's axis contradicts the given gravity by more than five standard deviations",
                "check gravity's signs and the camera's axes, or leave gravity out",
            ),
            Self::EndUnknown => (
                "end-unknown",
                "only the side of a cylinder is in view, from a camera that looks sideways; its lower end can't be told",
                "give gravity, or turn the camera so that floor, hopper or feed is in view",
            ),
            Self::AboveHorizon => (
                "above-horizon",
                "the camera looks above the horizon, where the pose is not defined",
                "turn the camera downwards, or check gravity's signs and the camera's axes",
            ),
        }
    }

    /// Stable name of the reason.
    pub fn slug(self) -> &'static str {
        self.row().0
    }
}
