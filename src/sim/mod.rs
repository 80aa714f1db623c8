//! Rigid-body simulator behind the `Robot` trait.

mod dynamics;
mod model;
mod quantities;
mod spatial;
mod state;

pub use model::{GRAVITY, Model};
pub use quantities::{DOF, Energy, FootMotion, Momentum};
pub use state::{Acceleration, State};
