//! Field-oriented control of a three-phase induction motor without a position sensor.
//!
//! One data path: converter codes become a [`Sample`], [`Drive::step`] turns it into a [`Compare`],
//! the timer takes that over one period later.
#![cfg_attr(not(test), no_std)]

pub mod angle;
pub mod fault;
pub mod frames;
pub mod io;
pub mod settings;
pub mod state;

pub use angle::{Angle, UnitVector};
pub use fault::Fault;
pub use frames::{Abc, AlphaBeta, DmQm, Dq};
pub use io::{Command, Compare, Hardware, Mode, Refused, Sample, Taken};
pub use state::State;

/// Placeholder while the blocks are written.
pub struct Drive;
impl Drive {
    /// One period.
    pub fn step(&mut self, _sample: &Sample) -> Compare {
        Compare::OFF
    }
}
