//! The demodulations under comparison, and the drives that use them.

use drive_core::table::ReferenceTable;
use drive_settings::words;

use crate::injection_map::PP;
use crate::prelude::*;

/// A demodulation.
#[derive(Clone, Copy, Debug)]
pub struct Demodulation(pub DemodulatorKind);

/// Gain of the band-pass at 600 Hz.
pub const BPF: f64 = 0.9452;
/// Gain of a rectifier.
const RECTIFIER: f64 = std::f64::consts::FRAC_2_PI;
/// Gain of the rectified chain.
const RECTIFIED_GAIN: f64 = BPF * RECTIFIER * PP;
const PRINTED_REFERENCE_A: f64 = 0.010;

/// The chain as printed.
pub const LITERAL: Demodulation = Demodulation(DemodulatorKind::Literal);
/// The printed chain with a rectifier that works.
pub const RECTIFIED: Demodulation = Demodulation(DemodulatorKind::Rectified);
const RMS_IMPEDANCE: Demodulation = Demodulation(DemodulatorKind::RmsImpedance);
const ENVELOPE: Demodulation = Demodulation(DemodulatorKind::Envelope);
/// The drive's own demodulation.
pub const SYNCHRONOUS: Demodulation = Demodulation(DemodulatorKind::Synchronous);

/// All demodulations.
pub const DEMODULATIONS: [Demodulation; 5] =
    [LITERAL, RECTIFIED, RMS_IMPEDANCE, ENVELOPE, SYNCHRONOUS];

impl Demodulation {
    /// Returns the name in the configuration.
    pub fn name(&self) -> &'static str {
        self.0.word()
    }

    /// Returns how much larger its signal is than that of the rectified chain for the same saliency, from the gains of
    /// filters and detectors. The printed gain k_s divided by it makes the same loop.
    fn gain(&self) -> f64 {
        match self.0 {
            DemodulatorKind::RmsImpedance => PP / BPF / RECTIFIED_GAIN,
            DemodulatorKind::Envelope => BPF / RECTIFIED_GAIN,
            _ => 1.0,
        }
    }

    /// Returns the constant reference, A: the printed 10 mA, times the gain. Ha and Sul compare with zero.
    fn constant_a(&self) -> f64 {
        match self.0 {
            DemodulatorKind::RmsImpedance | DemodulatorKind::Synchronous => 0.0,
            DemodulatorKind::Envelope => PRINTED_REFERENCE_A * BPF / RECTIFIED_GAIN,
            _ => PRINTED_REFERENCE_A,
        }
    }

    /// Returns the name in metrics and file names.
    pub fn key(&self) -> String {
        self.name().replace('-', "_")
    }

    /// Returns the configuration with this demodulation.
    pub fn config(&self, config: &Config) -> Config {
        let mut config = config.clone();
        config.drive.injection.demodulator = self.0;
        // A motor without saliency must be measured here, so the drive must not refuse it.
        config.drive.injection.synchronous.check = false;
        config
    }

    /// Returns the unit of its signal times 1000.
    pub fn unit(&self) -> &'static str {
        if self.0 == DemodulatorKind::Synchronous { "10⁻³" } else { "mA" }
    }

    /// Returns the configuration with the drive of this kind, if the demodulation has one.
    pub fn drive(
        &self,
        kind: ReferenceKind,
        config: &Config,
        learned: ReferenceTable,
    ) -> Option<Config> {
        let mut config = self.config(config);
        let drive = &mut config.drive;
        if self.0 == DemodulatorKind::Synchronous {
            drive.injection.synchronous.reference = Some(learned);
            return (kind == ReferenceKind::Retuned).then_some(config);
        }
        let printed = &mut drive.injection.printed;
        if kind == ReferenceKind::Constant {
            printed.reference_a = self.constant_a() as f32;
        } else {
            printed.learned = Some(learned);
        }
        if kind == ReferenceKind::Retuned {
            (printed.k_s, printed.z_s) = RETUNED;
        }
        printed.k_s /= self.gain() as f32;
        Some(config)
    }
}

words! {
    /// Reference of the signal and controller of the loop, with the names in tables and metrics.
    pub enum ReferenceKind {
        /// A constant and the gains of the configuration (as printed).
        Constant = "constant",
        /// A learned table, with the gains of the configuration.
        Learned = "learned",
        /// A learned table and a controller with a larger phase margin; the synchronous demodulation uses its own loop.
        Retuned = "retuned",
    }
}

/// k_s, in rad/A of the rectified chain's current difference, and z_s: a zero at 5 Hz, below the crossover, where the
/// printed controller has none.
const RETUNED: (f32, f32) = (0.1, 0.995);
