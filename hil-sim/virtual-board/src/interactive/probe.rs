//! What the drive on the board believes: what its telemetry is made of, read from the RAM of the core.

use anyhow::{Context, Result};

use drive_core::settings::AngleSource;

use crate::board::Board;
use crate::image::Image;

/// Where that lies.
pub struct Probe {
    phi: u32,
    /// The angle source, and the speed of the rotor with the encoder and with the injection.
    source: u32,
    rotor_freq: [u32; 2],
    reference_q: u32,
    current_q: u32,
    dc_link: u32,
}

/// What the drive makes of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Belief {
    /// Rotor-flux angle, electrical turns.
    pub phi: f64,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: f64,
    /// Filtered reference on the quadrature axis, A.
    pub reference_q: f64,
    /// Current on the quadrature axis, A.
    pub current_q: f64,
    /// Dc-link voltage, V.
    pub dc_link: f64,
}

impl Probe {
    /// Finds it by the image's debug information.
    ///
    /// # Errors
    /// The image has no such thing.
    pub fn new(image: &Image) -> Result<Self> {
        let place =
            |name: &str, member: &str| Ok::<u32, anyhow::Error>(image.member(name, member)?.1);
        let running = image.symbol("control7RUNNING").context("the drive in RAM")?.0;
        let drive = running + place("Running", "control")? + place("Control", "drive")?;
        let control = drive + place("Drive", "control")?;
        let state =
            |member: &str| Ok::<u32, anyhow::Error>(control + place("ControlState", member)?);
        let seen = state("seen")?;
        let at = |member: &str| Ok::<u32, anyhow::Error>(seen + place("Observed", member)?);
        let q = place("Dq", "q")?;
        Ok(Self {
            phi: at("phi")?,
            source: drive + place("Drive", "c")? + place("Coefficients", "source")?,
            rotor_freq: [
                state("indirect")? + place("IndirectState", "rotor_step")?,
                state("estimator")? + place("EstimatorState", "rotor_step")?,
            ],
            reference_q: at("reference")? + q,
            current_q: at("current")? + q,
            dc_link: at("dc_link")?,
        })
    }

    /// Reads it, after a control interrupt.
    pub fn read(&self, board: &Board) -> Belief {
        let word = |address| board.word(address).unwrap_or_default();
        let float = |address| f64::from(f32::from_bits(word(address)));
        let source = (word(self.source & !3) >> (8 * (self.source & 3))) as u8;
        let [encoder, injection] = self.rotor_freq;
        Belief {
            phi: f64::from(word(self.phi)) / 2_f64.powi(32),
            rotor_freq: float(if source == AngleSource::Encoder as u8 {
                encoder
            } else {
                injection
            }),
            reference_q: float(self.reference_q),
            current_q: float(self.current_q),
            dc_link: float(self.dc_link),
        }
    }
}
