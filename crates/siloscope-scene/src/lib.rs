//! Ray-casts depth frames of silos with exact truth.
//!
//! The synthetic world of section 2.4: a silo with feed in it ([`SiloWorld`]) is seen by a camera ([`render()`]), and a
//! sensor model ([`Sensor`]) spoils the exact depths. Rays hit surfaces to the accuracy of float64; noise is drawn by
//! pixel number, so that it does not depend on the number of threads.

pub mod bottom;
pub mod clutter;
pub mod feed;
pub mod feed_shape;
pub mod form;
pub mod hit;
pub mod jet;
mod lattice;
mod limits;
pub mod measuring;
mod multipath;
mod quadrics;
pub mod random;
pub mod relief;
pub mod render;
pub mod rooms;
pub mod root;
pub mod sensor;
pub mod silo;
mod spline;
pub mod volume;
pub mod wall;
pub mod world;

pub use bottom::Bottom;
pub use clutter::{Bar, Bundle};
pub use feed::Feed;
pub use feed_shape::{Lumps, Rathole};
pub use form::{Bend, Courses};
pub use hit::{Hit, Label};
pub use relief::{Corrugation, Dent, Film, Relief, Seams};
pub use render::{Exact, render};
pub use sensor::Sensor;
pub use silo::Silo;
pub use volume::Content;
pub use wall::Wall;
pub use world::{SiloWorld, World};
