//! The demodulations that are compared, and the drives that use them.

use drive_core::Settings;
use drive_core::settings::table::ReferenceTable;

use crate::config::Config;
use crate::error::Error;
use crate::experiments::learning;
use drive_core::carrier::DemodulatorKind;

/// A demodulation.
#[derive(Clone, Copy, Debug)]
pub struct Demodulation {
    /// How the configuration names it.
    pub name: &'static str,
    /// Which.
    pub demodulator: DemodulatorKind,
    /// How much larger its signal is than that of the rectified chain for the same saliency, by the
    /// gains of filters and detectors: the printed gain k_s, divided by it, makes the same loop.
    pub gain: f64,
    /// Constant reference, A: the printed 10 mA, times the gain. Ha and Sul compare with zero.
    pub constant_a: f64,
}

/// Gains at 600 Hz of the band-pass, at dc of the post-processing filter, and of a rectifier.
const BPF: f64 = 0.9452;
const PP: f64 = 0.944_061;
const RECTIFIER: f64 = std::f64::consts::FRAC_2_PI;
/// Gain of the rectified chain.
const RECTIFIED: f64 = BPF * RECTIFIER * PP;
const PRINTED_REFERENCE_A: f64 = 0.010;

/// All of them.
pub const DEMODULATIONS: [Demodulation; 5] = [
    Demodulation {
        name: "literal",
        demodulator: DemodulatorKind::Literal,
        gain: 1.0,
        constant_a: PRINTED_REFERENCE_A,
    },
    Demodulation {
        name: "rectified",
        demodulator: DemodulatorKind::Rectified,
        gain: 1.0,
        constant_a: PRINTED_REFERENCE_A,
    },
    Demodulation {
        name: "rms-impedance",
        demodulator: DemodulatorKind::RmsImpedance,
        gain: PP / BPF / RECTIFIED,
        constant_a: 0.0,
    },
    Demodulation {
        name: "envelope",
        demodulator: DemodulatorKind::Envelope,
        gain: BPF / RECTIFIED,
        constant_a: PRINTED_REFERENCE_A * BPF / RECTIFIED,
    },
    Demodulation {
        name: "synchronous",
        demodulator: DemodulatorKind::Synchronous,
        gain: 1.0,
        constant_a: 0.0,
    },
];

impl Demodulation {
    /// The name in metrics and file names.
    pub fn key(&self) -> String {
        self.name.replace('-', "_")
    }

    /// The configuration with this demodulation.
    pub fn config(&self, config: &Config) -> Config {
        let mut config = config.clone();
        config.drive.injection.demodulator = self.demodulator;
        // A motor without saliency must be measured, not refused.
        config.drive.injection.synchronous.check = false;
        config
    }

    /// Unit of its signal times 1000.
    pub fn unit(&self) -> &'static str {
        if self.demodulator == DemodulatorKind::Synchronous { "10⁻³" } else { "mA" }
    }

    /// The reference that it learns on this motor.
    ///
    /// # Errors
    /// As [`learning::reference_of`].
    pub fn learn(&self, config: &Config, seed: u64) -> Result<ReferenceTable, Error> {
        let config = self.config(config);
        learning::reference_of(self.demodulator, &config, seed)
    }

    /// The drive of this kind, if the demodulation has one.
    pub fn drive(
        &self,
        kind: ReferenceKind,
        config: &Config,
        learned: ReferenceTable,
    ) -> Option<Settings> {
        let mut drive = self.config(config).drive;
        if self.demodulator == DemodulatorKind::Synchronous {
            drive.injection.synchronous.reference = Some(learned);
            return (kind == ReferenceKind::Retuned).then_some(drive);
        }
        let printed = &mut drive.injection.printed;
        if kind == ReferenceKind::Constant {
            printed.reference_a = self.constant_a as f32;
        } else {
            printed.learned = Some(learned);
        }
        if kind == ReferenceKind::Retuned {
            (printed.k_s, printed.z_s) = RETUNED;
        }
        printed.k_s /= self.gain as f32;
        Some(drive)
    }
}

/// Reference of the signal, and the controller behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceKind {
    /// A constant and the gains of the configuration (as printed).
    Constant,
    /// A learned table and the same gains.
    Learned,
    /// A learned table and a controller that leaves more phase; of the synchronous demodulation its
    /// own loop.
    Retuned,
}

/// All kinds with their names in tables and metrics.
pub const KINDS: [(ReferenceKind, &str); 3] = [
    (ReferenceKind::Constant, "constant"),
    (ReferenceKind::Learned, "learned"),
    (ReferenceKind::Retuned, "retuned"),
];

/// k_s in rad/A of the rectified chain's current difference, and z_s: a zero at 5 Hz, below the
/// crossover, where the printed one has none.
const RETUNED: (f32, f32) = (0.1, 0.995);
