//! The one table of keys: name, type, default, allowed values, unit, meaning.
//!
//! The configuration types, their defaults, the checks, the error messages and the output of `keys`
//! all come from it. To add a key, add a line.

use super::value::{Allowed, Field, Value, words};

words! {
    /// Where the drive takes the flux angle from.
    AngleSource {
        /// Encoder and slip, Eq. 2.10.
        Encoder = "encoder",
        /// Injected voltage, section 3.6.
        Injection = "injection",
    }
}

words! {
    /// Demodulation of the carrier current.
    Demodulator {
        /// As printed: the difference of the two channels, filtered.
        Literal = "literal",
        /// The difference of their magnitudes, filtered.
        Rectified = "rectified",
        /// Ha and Sul: carrier along the flux, difference of the impedances from rms values.
        RmsImpedance = "rms-impedance",
        /// Difference of the envelopes of the two channels, averaged over a carrier period.
        Envelope = "envelope",
        /// Mixed with the carrier, averaged and normalised; compared with a learned reference.
        Synchronous = "synchronous",
    }
}

words! {
    /// Load on the shaft.
    LoadMode {
        /// Shaft blocked.
        Locked = "locked",
        /// Turns freely against `load.torque_nm`.
        Free = "free",
        /// A dynamometer holds `load.speed_rpm`.
        Speed = "speed",
    }
}

/// One line of the table.
#[derive(Clone, Copy)]
pub struct Key {
    /// How `--set` and TOML name it.
    pub name: &'static str,
    /// Unit, empty for a pure number.
    pub unit: &'static str,
    /// The values it can have.
    pub allowed: Allowed,
    /// Its meaning.
    pub doc: &'static str,
    /// Reads it.
    pub get: fn(&Config) -> Value,
    /// Writes it; the error is the reason why the value is not allowed.
    pub set: fn(&mut Config, &Value) -> Result<(), &'static str>,
}

macro_rules! allowed {
    ($min:literal .. $max:literal) => {
        Allowed::Range { min: $min as f64, max: $max as f64 }
    };
    (switch) => {
        Allowed::Switch
    };
    ($words:ident) => {
        Allowed::Words($words::WORDS)
    };
}

macro_rules! keys {
    ($(
        #[doc = $group_doc:literal]
        $prefix:literal $group:ident: $type:ident {
            $(
                $(#[doc = $doc:literal])+
                $field:ident: $field_type:ty = $default:expr, [$($allowed:tt)+], $unit:literal;
            )+
        }
    )+) => {
        $(
            #[doc = $group_doc]
            #[derive(Clone, Debug, PartialEq, serde::Serialize)]
            pub struct $type {
                $($(#[doc = $doc])+ pub $field: $field_type,)+
            }

            impl Default for $type {
                fn default() -> Self {
                    Self { $($field: $default,)+ }
                }
            }
        )+

        /// The configuration of an experiment.
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
        pub struct Config {
            $(#[doc = $group_doc] pub $group: $type,)+
        }

        /// All keys, in groups.
        pub const KEYS: &[Key] = &[$($(Key {
            name: concat!($prefix, stringify!($field)),
            unit: $unit,
            allowed: allowed!($($allowed)+),
            doc: concat!($($doc,)+),
            get: |config| config.$group.$field.to_value(),
            set: |config, value| {
                config.$group.$field = Field::from_value(value, &allowed!($($allowed)+))?;
                Ok(())
            },
        },)+)+];
    };
}

keys! {
    /// The motor: T equivalent circuit of Figure 21, values of Table 5.
    "motor." motor: MotorConfig {
        /// Stator resistance.
        rs: f64 = 5.4, [0.01 .. 1000], "ohm";
        /// Rotor resistance, referred to the stator.
        rr: f64 = 1.1, [0.01 .. 1000], "ohm";
        /// Leakage inductance of the stator.
        lls: f64 = 0.0276, [1e-5 .. 10], "H";
        /// Leakage inductance of the rotor, referred to the stator.
        llr: f64 = 0.0276, [1e-5 .. 10], "H";
        /// Magnetising inductance.
        lm: f64 = 0.1771, [1e-4 .. 100], "H";
        /// Pairs of poles.
        pole_pairs: u32 = 2, [1 .. 50], "";
        /// Inertia of rotor and load (assumed; not in the source).
        inertia: f64 = 0.012, [1e-6 .. 1000], "kg m2";
        /// Viscous friction (assumed; not in the source).
        friction: f64 = 0.001, [0 .. 10], "Nm s/rad";
    }
    /// Differences of the motor from the textbook machine; all of them are assumed.
    "saliency." saliency: SaliencyConfig {
        /// Saliency fixed to the rotor flux, at nominal flux.
        a_psi: f64 = -0.035, [-0.25 .. 0.25], "";
        /// Saliency that follows the stator current.
        b1: f64 = 0.036, [-0.1 .. 0.1], "1/A";
        /// Weight of the high-frequency rotor resistance of Eq. 3.8.
        chi: f64 = 0.0, [0 .. 10], "";
    }
    /// The inverter.
    "inverter." inverter: InverterConfig {
        /// Voltage of the dc link.
        vdc: f64 = 311.0, [20 .. 1000], "V";
        /// Time during which neither switch of a leg conducts, at each edge.
        dead_time_us: f64 = 2.2, [0 .. 6], "us";
        /// Time from the command to the first switch (section 3.9).
        propagation_us: f64 = 2.2, [0 .. 10], "us";
        /// Further voltage per phase that goes with the sign of the current and that no compensation
        /// knows of; 40 % of the dead time's (assumed).
        residual_v: f64 = 1.64, [0 .. 20], "V";
        /// Whether the drive compensates the dead time.
        compensate: bool = true, [switch], "";
        /// Whether every switching edge is simulated; otherwise the mean voltage of a period is.
        switched: bool = false, [switch], "";
    }
    /// The current sensors and their converter.
    "measurement." measurement: MeasurementConfig {
        /// Noise of each channel, rms.
        noise_a: f64 = 0.005, [0 .. 1], "A";
        /// Step of the converter; a finer one has more bits over the same range, up to 16.
        lsb_a: f64 = 0.002212, [0.00014 .. 0.05], "A";
        /// Corner of the analog filter of Figure 16, first order; 0 for none.
        filter_hz: f64 = 5305.0, [0 .. 1e6], "Hz";
        /// Relative error of the gain of channel a.
        gain_error_a: f64 = 0.0, [-0.5 .. 0.5], "";
        /// Relative error of the gain of channel b.
        gain_error_b: f64 = 0.0, [-0.5 .. 0.5], "";
        /// Offset of channel a.
        offset_a: f64 = 0.0, [-5 .. 5], "A";
        /// Offset of channel b.
        offset_b: f64 = 0.0, [-5 .. 5], "A";
    }
    /// The injected voltage and the demodulation of the current it causes.
    "injection." injection: InjectionConfig {
        /// Peak of the injected voltage.
        amplitude_v: f64 = 50.0, [0 .. 150], "V";
        /// How the angle error is taken from the carrier current.
        demodulator: Demodulator = Demodulator::Synchronous, [Demodulator], "";
        /// Reference of the current difference of all but synchronous (section 3.3).
        reference_a: f64 = 0.010, [-1 .. 1], "A";
        /// Gain k_s of the PII controller behind all but synchronous (Eq. 3.44).
        k_s: f64 = 0.132546, [0 .. 100], "rad/A";
        /// Zero z_s of that controller.
        z_s: f64 = 0.9, [0 .. 1], "";
        /// Length of the rms filters of rms-impedance, in samples.
        rms_samples: u32 = 20, [2 .. 60], "";
        /// Whether a start with synchronous checks that the motor has a saliency.
        check: bool = true, [switch], "";
        /// Whether the lock is verified at a start and watched, with synchronous.
        monitor: bool = true, [switch], "";
        /// Share of the flux-fixed saliency that may be missing to the lock monitor.
        allowed_loss: f64 = 0.55, [0.3 .. 0.9], "";
        /// Time constant of the mean of that share.
        loss_s: f64 = 0.08, [0.01 .. 1], "s";
        /// Speed of the rotor at which a sensorless drive with synchronous switches off.
        tracked_rpm: f64 = 700.0, [1 .. 20000], "rpm";
        /// Natural frequency of the loop behind synchronous.
        bandwidth_hz: f64 = 3.5, [0.1 .. 30], "Hz";
    }
    /// The flux angle.
    "angle." angle: AngleConfig {
        /// Where the drive takes the flux angle from.
        source: AngleSource = AngleSource::Injection, [AngleSource], "";
        /// Whether the known delays of measurement and demodulation are compensated.
        compensate_delays: bool = true, [switch], "";
    }
    /// The load.
    "load." load: LoadConfig {
        /// Load on the shaft.
        mode: LoadMode = LoadMode::Locked, [LoadMode], "";
        /// Speed that the dynamometer holds, with load.mode = speed.
        speed_rpm: f64 = 0.0, [-6000 .. 6000], "rpm";
        /// Torque of the load, with load.mode = free.
        torque_nm: f64 = 0.0, [-1000 .. 1000], "Nm";
    }
    /// References, for experiments that do not bring their own.
    "reference." reference: ReferenceConfig {
        /// Direct-axis (magnetising) current, peak.
        id_a: f64 = 0.7, [0.01 .. 3.5], "A";
        /// Quadrature-axis (torque) current, peak.
        iq_a: f64 = 1.0, [-20 .. 20], "A";
    }
    /// The speed and the position loop.
    "speed." speed: SpeedConfig {
        /// Largest speed reference; unset: 300, or the experiment's own.
        limit_rpm: Option<f64> = None, [1 .. 2000], "rpm";
        /// Largest acceleration of the speed reference; unset: 300, or the experiment's own.
        ramp_rpm_per_s: Option<f64> = None, [1 .. 100000], "rpm/s";
        /// Phase margin that the speed loop is designed for.
        phase_margin_deg: f64 = 60.0, [45 .. 70], "deg";
    }
    /// The motor parameters that the drive is set to; unset ones follow `motor.*`.
    "drive.motor." drive_motor: BelievedMotorConfig {
        /// Stator resistance; follows motor.rs.
        rs: Option<f64> = None, [0.01 .. 1000], "ohm";
        /// Rotor resistance; follows motor.rr.
        rr: Option<f64> = None, [0.01 .. 1000], "ohm";
        /// Leakage inductance of the stator; follows motor.lls.
        lls: Option<f64> = None, [1e-5 .. 10], "H";
        /// Leakage inductance of the rotor; follows motor.llr.
        llr: Option<f64> = None, [1e-5 .. 10], "H";
        /// Magnetising inductance; follows motor.lm.
        lm: Option<f64> = None, [1e-4 .. 100], "H";
    }
    /// Preparation of the drive before the experiment.
    "drive." drive: DriveConfig {
        /// In steady runs (monte-carlo, speed-torque-sweep): whether the drive learns first, with the
        /// shaft locked, as a user would have it do.
        learn: bool = false, [switch], "";
    }
    /// Errors that monte-carlo draws for every run, beside the operating point.
    "spread." spread: SpreadConfig {
        /// Largest relative error of each parameter that the drive believes of its motor.
        motor: f64 = 0.0, [0 .. 0.5], "";
        /// Largest relative change of the sensors' noise.
        noise: f64 = 0.0, [0 .. 1], "";
        /// Largest relative error of the gain of each current channel.
        gain: f64 = 0.0, [0 .. 0.1], "";
    }
    /// How much is simulated.
    "" extent: ExtentConfig {
        /// Runs of a statistical experiment; unset: the experiment's own number.
        runs: Option<u32> = None, [1 .. 1000000], "";
        /// Simulated time; unset: the experiment's own.
        seconds: Option<f64> = None, [0.001 .. 3600], "s";
    }
}
