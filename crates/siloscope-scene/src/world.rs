//! What a ray can hit.

use crate::feed::Feed;
use crate::silo::{Exit, Silo};
use siloscope::{Error, Result, Vec3};

/// What a pixel shows; the numbers are those of the label images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Label {
    /// Nothing.
    None = 0,
    /// The cylinder's wall.
    Cylinder = 1,
    /// The cone.
    Cone = 2,
    /// Feed, also where it sticks to a wall.
    Feed = 3,
    /// Outlet, roof, clutter, flying pixel or dust.
    Other = 4,
}

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

/// A world that rays can be cast into. Coordinates are those of the silo frame.
pub trait World: Sync {
    /// The nearest hit at a positive parameter.
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit>;

    /// Refuses a camera position from which nothing sensible can be seen.
    fn check_camera(&self, origin: &Vec3) -> Result<()>;
}

/// A silo with feed in it.
#[derive(Debug, Clone)]
pub struct SiloWorld {
    /// The walls.
    pub silo: Silo,
    /// The feed; None where the silo is empty.
    pub feed: Option<Feed>,
}

impl World for SiloWorld {
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let entry = self.silo.entry(origin, ray)?;
        let from = origin + ray * entry;
        let exit = self.silo.exit(&from, ray);
        let end = match &exit {
            Some(Exit::Surface(hit)) => hit.t,
            Some(Exit::Open(t)) => *t,
            None => f64::INFINITY,
        };
        let feed = self.feed.as_ref().and_then(|feed| feed.cast(&from, ray, end));
        let hit = feed.or(match exit {
            Some(Exit::Surface(hit)) => Some(hit),
            _ => None,
        })?;
        Some(Hit { t: hit.t + entry, ..hit })
    }

    fn check_camera(&self, origin: &Vec3) -> Result<()> {
        let inside = origin.z < self.silo.top || self.silo.contains(origin);
        if !inside {
            let bounds = "such that the camera is inside the silo (closer to the axis than the wall)";
            return Err(Error::Setting { name: "t_x, t_y", bounds, value: origin.xy().norm() });
        }
        match &self.feed {
            Some(feed) if feed.depth_below(origin) <= 0.0 => {
                let bounds = "low enough not to bury the camera";
                Err(Error::Setting { name: "level", bounds, value: feed.level })
            }
            _ => Ok(()),
        }
    }
}
