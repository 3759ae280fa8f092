//! The incremental encoder.

use std::f64::consts::TAU;

use crate::error::PlantError;
use crate::settings::settings;

settings! {
    /// Resolution of the encoder.
    EncoderSettings "encoder." {
        /// Lines per turn; the counter makes four counts of each line.
        lines: u32 = 2500, 1.0..=100_000.0, "";
    }
}

/// Fault of the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderFault {
    /// No fault.
    #[default]
    None,
    /// The counter does not move: a disconnected cable, or one dead channel.
    Stuck,
    /// This fraction of the counts is lost, 0 to 1: a slipping coupling, a dirty disc. Below 0, down to -1, further
    /// counts are added: interference on both channels.
    Losing(f64),
}

/// The encoder and its counter, which starts at zero and counts up with positive speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Fault of the encoder.
    pub fault: EncoderFault,
    counts_per_radian: f64,
    position: f64,
    lost: f64,
}

impl Encoder {
    /// Makes the encoder with these settings.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(settings: &EncoderSettings) -> Result<Self, PlantError> {
        settings.check()?;
        let counts_per_radian = 4.0 * f64::from(settings.lines) / TAU;
        Ok(Self { fault: EncoderFault::None, counts_per_radian, position: 0.0, lost: 0.0 })
    }

    /// Follows the rotor to a mechanical angle, rad, not wrapped.
    pub fn follow(&mut self, angle: f64) {
        let position = angle * self.counts_per_radian;
        match self.fault {
            EncoderFault::None => {}
            EncoderFault::Stuck => self.lost += position - self.position,
            EncoderFault::Losing(fraction) => {
                self.lost += fraction.clamp(-1.0, 1.0) * (position - self.position);
            }
        }
        self.position = position;
    }

    /// The counter, which wraps.
    pub fn count(&self) -> u32 {
        let seen = self.position - self.lost;
        let towards_zero = seen as i64;
        // Rounds down without the library call that `floor` needs on older processors.
        let count = towards_zero - i64::from((towards_zero as f64) > seen);
        count as u32
    }
}
