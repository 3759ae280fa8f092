//! The incremental encoder.

use std::f64::consts::TAU;

use crate::error::PlantError;
use crate::settings::settings;

settings! {
    /// Resolution of the encoder.
    EncoderSettings "encoder." {
        /// Lines per turn; the counter makes four counts of each.
        lines: u32 = 2500, 1.0..=100_000.0, "";
    }
}

/// Fault of the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderFault {
    /// No fault.
    #[default]
    None,
    /// The counter stands still: cable off, or one channel dead.
    Stuck,
    /// This fraction of the counts is lost, 0 to 1: slipping coupling, dirty disc.
    Losing(f64),
}

/// The encoder and its counter: starts at zero, counts upwards with positive speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Its fault.
    pub fault: EncoderFault,
    counts_per_radian: f64,
    position: f64,
    lost: f64,
}

impl Encoder {
    /// The encoder with these settings.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`].
    pub fn new(settings: &EncoderSettings) -> Result<Self, PlantError> {
        settings.check()?;
        let counts_per_radian = 4.0 * f64::from(settings.lines) / TAU;
        Ok(Self { fault: EncoderFault::None, counts_per_radian, position: 0.0, lost: 0.0 })
    }

    /// Follows the rotor to this mechanical angle, rad, not wrapped.
    pub fn follow(&mut self, angle: f64) {
        let position = angle * self.counts_per_radian;
        match self.fault {
            EncoderFault::None => {}
            EncoderFault::Stuck => self.lost += position - self.position,
            EncoderFault::Losing(fraction) => {
                self.lost += fraction.clamp(0.0, 1.0) * (position - self.position);
            }
        }
        self.position = position;
    }

    /// The counter, wrapping.
    pub fn count(&self) -> u32 {
        let seen = self.position - self.lost;
        let towards_zero = seen as i64;
        // Round down without the call that `floor` is on older processors.
        let count = towards_zero - i64::from((towards_zero as f64) > seen);
        count as u32
    }
}
