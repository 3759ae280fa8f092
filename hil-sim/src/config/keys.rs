//! The table of the keys of the bench: motor, inverter, sensors, load, and how much is simulated. The keys of the drive
//! are those of [`drive_core::settings::SETTINGS`].
//!
//! The configuration types, their defaults, the checks, the error messages and the output of `keys` all come from
//! these two tables. To add a key, add a line.

use drive_core::Settings;

use super::value::{Allowed, Field, Value, words};

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

/// A row of the table.
pub struct BenchKey {
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
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        pub struct Config {
            $(#[doc = $group_doc] pub $group: $type,)+
            /// The drive.
            #[serde(skip)]
            pub drive: Settings,
        }

        impl Default for Config {
            fn default() -> Self {
                let mut config = Self { $($group: $type::default(),)+ drive: Settings::default() };
                config.calibrate();
                config
            }
        }

        /// The keys of the bench, in groups.
        pub static BENCH: &[BenchKey] = &[$($(BenchKey {
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
    /// The motor: T equivalent circuit of Figure 21, values of Table 5. The drive is set to the same values.
    "motor." motor: MotorConfig {
        /// Stator resistance.
        r_s: f64 = 5.4, [0.001 .. 1000], "ohm";
        /// Rotor resistance, referred to the stator.
        r_r: f64 = 1.1, [0.001 .. 1000], "ohm";
        /// Leakage inductance of the stator.
        l_ls: f64 = 0.0276, [1e-6 .. 10], "H";
        /// Leakage inductance of the rotor, referred to the stator.
        l_lr: f64 = 0.0276, [1e-6 .. 10], "H";
        /// Magnetising inductance.
        l_m: f64 = 0.1771, [1e-5 .. 100], "H";
        /// Pairs of poles.
        pole_pairs: u32 = 2, [1 .. 50], "";
        /// Inertia of rotor and load (assumed; not in the source).
        inertia: f64 = 0.012, [1e-6 .. 1000], "kg m2";
        /// Viscous friction (assumed; not in the source).
        friction: f64 = 0.001, [0 .. 10], "Nm s/rad";
    }
    /// Differences of the motor from the textbook machine; all of them are assumed.
    "saliency." saliency: SaliencyConfig {
        /// Saliency fixed to the rotor flux, at the flux psi_n.
        a_psi: f64 = -0.035, [-0.25 .. 0.25], "";
        /// Saliency that follows the stator current; unset: 0.036 1/A with the dissertation's motor, in inverse proportion
        /// to the rated current.
        b1: Option<f64> = None, [-10 .. 10], "1/A";
        /// Current beyond which that part does not grow; unset: 5 A with the dissertation's motor, in proportion to the
        /// rated current.
        hold_a: Option<f64> = None, [0.01 .. 10000], "A";
        /// Flux at which a_psi holds; unset: that of 0.7 A with the dissertation's motor, of a current in proportion to
        /// the rated one.
        psi_n: Option<f64> = None, [0.0001 .. 100], "Wb";
        /// Weight of the high-frequency rotor resistance of Eq. 3.8.
        chi: f64 = 0.0, [0 .. 10], "";
    }
    /// The inverter.
    "inverter." inverter: InverterConfig {
        /// Voltage of the dc link. The drive's nominal one is set to the same value.
        dc_link_v: f64 = 311.0, [10 .. 1000], "V";
        /// Time during which neither switch of a leg conducts, at each edge. The drive is set to the same value.
        dead_time_s: f64 = 2.2e-6, [0 .. 6e-6], "s";
        /// Time from the command to the first switch (section 3.9).
        propagation_us: f64 = 2.2, [0 .. 10], "us";
        /// Further voltage per phase that goes with the sign of the current and that no compensation
        /// knows of; unset: 1.64 V at 311 V, 40 % of the dead time's (assumed), in proportion to the dc link.
        residual_v: Option<f64> = None, [0 .. 20], "V";
        /// Whether every switching edge is simulated; otherwise the mean voltage of a period is.
        switched: bool = false, [switch], "";
    }
    /// The sensors and their converters. The drive's scales are set to match, without the errors.
    "measurement." measurement: MeasurementConfig {
        /// End of the range of the current sensors.
        range_a: f64 = 4.4727134, [0.01 .. 5000], "A";
        /// Noise of each channel, rms; unset: 5 mA with the dissertation's sensors, in proportion to the range.
        noise_a: Option<f64> = None, [0 .. 10], "A";
        /// Step of the converter, 7 to 16 bits over the range; unset: 12 bits.
        lsb_a: Option<f64> = None, [1e-7 .. 50], "A";
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
        /// End of the range of the dc link; unset: 450 V at 311 V, more in proportion to a higher dc link.
        dc_link_range_v: Option<f64> = None, [10 .. 2000], "V";
        /// Temperature of the heat sink.
        heat_sink_c: f64 = 25.0, [-40 .. 150], "degC";
    }
    /// The load.
    "load." load: LoadConfig {
        /// Load on the shaft.
        mode: LoadMode = LoadMode::Locked, [LoadMode], "";
        /// Speed that the dynamometer holds, with load.mode = speed.
        speed_rpm: f64 = 0.0, [-24000 .. 24000], "rpm";
        /// Torque of the load, with load.mode = free; unset: none, or the experiment's own.
        torque_nm: Option<f64> = None, [-10000 .. 10000], "Nm";
    }
    /// References, for experiments that do not bring their own.
    "reference." reference: ReferenceConfig {
        /// Quadrature-axis (torque) current, peak; unset: 1 A with the dissertation's motor, in proportion to the rated
        /// current.
        iq_a: Option<f64> = None, [-1000 .. 1000], "A";
    }
    /// Preparation of the drive before the experiment.
    "prepare." prepare: PrepareConfig {
        /// Whether a sensorless drive learns first, with the shaft locked, as a user would have it do.
        learn: bool = false, [switch], "";
    }
    /// Errors that monte-carlo draws for every run, beside the operating point.
    "spread." spread: SpreadConfig {
        /// Largest relative error of each parameter that the drive believes of its motor.
        motor: f64 = 0.0, [0 .. 0.5], "";
        /// In machines: factor by which each parameter of the motor is larger or smaller at most; 1 for the motor itself.
        machine: f64 = 1.0, [1 .. 4], "";
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
