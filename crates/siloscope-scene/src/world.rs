//! What a ray can hit.

use crate::clutter::Bundle;
use crate::feed::Feed;
use crate::hit::{Hit, Label};
use crate::silo::{Exit, Silo};
use crate::wall::Wall;
use siloscope::{Error, Result, Vec3};

/// A world that rays can be cast into. Coordinates are those of the silo frame.
pub trait World: Sync {
    /// The nearest hit at a positive parameter.
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit>;

    /// Refuses a camera position from which nothing sensible can be seen.
    fn check_camera(&self, origin: &Vec3) -> Result<()>;
}

/// A silo with feed and other things in it.
#[derive(Debug, Clone)]
pub struct SiloWorld {
    /// The perfect silo.
    pub silo: Silo,
    /// Its wall where it is not perfect.
    pub wall: Option<Wall>,
    /// The feed; None where the silo is empty.
    pub feed: Option<Feed>,
    /// Ladder, cables and the like.
    pub clutter: Vec<Bundle>,
}

impl World for SiloWorld {
    fn cast(&self, origin: &Vec3, ray: &Vec3) -> Option<Hit> {
        let entry = self.silo.entry(origin, ray)?;
        let from = origin + ray * entry;
        let (end, surface) = match self.exit(&from, ray) {
            Some(Exit::Surface(hit)) => (hit.t, Some(hit)),
            Some(Exit::Open(t)) => (t, None),
            None => (f64::INFINITY, None),
        };
        let behind = self.cast_feed(&from, ray, end).or(surface);
        let hit = nearest(behind, self.clutter.iter().filter_map(|bundle| bundle.cast(&from, ray)), end)?;
        Some(Hit { t: hit.t + entry, ..hit })
    }

    fn check_camera(&self, origin: &Vec3) -> Result<()> {
        let clear = self.wall.as_ref().map_or(f64::INFINITY, Wall::clear_radius);
        let inside = self.silo.contains(origin) && origin.xy().norm() < clear;
        if origin.z >= self.silo.top && !inside {
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

impl SiloWorld {
    /// Where a ray leaves the silo's air, feed and clutter aside.
    fn exit(&self, from: &Vec3, ray: &Vec3) -> Option<Exit> {
        let Some(wall) = &self.wall else { return self.silo.exit(from, ray) };
        let hit = wall.cast(from, ray);
        match hit {
            Some(hit) if hit.label != Label::Cylinder => {
                let outlet = self.silo.outlet_hit(from, ray, &(from + ray * hit.t));
                Some(Exit::Surface(outlet.unwrap_or(hit)))
            }
            Some(hit) => Some(Exit::Surface(hit)),
            None => self.silo.top_exit(from, ray),
        }
    }

    fn cast_feed(&self, from: &Vec3, ray: &Vec3, end: f64) -> Option<Hit> {
        let feed = self.feed.as_ref()?;
        let bulge = self.wall.as_ref().map_or(0.0, Wall::bulge);
        feed.cast(from, ray, feed.lid(from, ray, bulge), end)
    }
}

/// The nearest of a hit and further ones before `end`.
fn nearest(first: Option<Hit>, others: impl Iterator<Item = Hit>, end: f64) -> Option<Hit> {
    first.into_iter().chain(others.filter(|hit| hit.t < end)).min_by(|a, b| a.t.total_cmp(&b.t))
}
