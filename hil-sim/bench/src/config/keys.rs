//! The table of the keys of the bench: motor, inverter, sensors, load, and how much is simulated. The keys of the drive
//! are in [`drive_settings::SETTINGS`].
//!
//! The configuration types, their defaults, the checks, the error messages and the output of `keys` all come from these
//! two tables. To add a key, add a line. After `=>` stands the field of the plant's settings that takes the same value.

use std::collections::BTreeMap;

use drive_settings::Settings;
use drive_settings::entry::{Access, Entry};
use drive_settings::value::Words;

use super::Value;
pub use super::words::*;
use crate::plant::{IronSettings, PlantSettings};

/// Declares a row of the table; see [`drive_settings::entry!`]. Rules of the bench are in [`plant_settings`](super::plant_settings).
macro_rules! key {
    (auto($unit:literal), $name:expr, [$group:ident] $field:ident: $($row:tt)+) => {
        drive_settings::entry!(
            0: auto($unit, |config: &Config| config.$group.$field.unwrap_or(f64::NAN)), $name, [$group] $field: $($row)+
        )
    };
    ($kind:ident($($unit:literal)?), $($row:tt)+) => {
        drive_settings::entry!(0: $kind($($unit)?), $($row)+)
    };
}

macro_rules! keys {
    (|$plant:ident, $iron:ident| $(
        #[doc = $group_doc:literal]
        $prefix:literal $group:ident: $type:ident {
            $(
                $(#[doc = $doc:literal])+
                $field:ident: $field_type:ty = $default:expr, $kind:ident($($unit:literal)?) $(, $min:literal .. $max:literal)? $(=> $place:expr)?;
            )+
        }
    )+) => {
        $(
            #[doc = $group_doc]
            #[derive(Clone, Debug, PartialEq)]
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
        #[derive(Clone, Debug, PartialEq)]
        pub struct Config {
            $(#[doc = $group_doc] pub $group: $type,)+
            /// The drive.
            pub drive: Settings,
            /// Values of plant keys after the saliency self-commissioning, by the name of the key; the others do not change.
            pub after: BTreeMap<&'static str, Value>,
        }

        impl Default for Config {
            fn default() -> Self {
                let mut config = Self { $($group: $type::default(),)+ drive: super::dissertation(), after: BTreeMap::new() };
                // The saliency of the simulated motor is known, and so are its tables at 0.7 A.
                config.drive.injection.synchronous.allow_unlearned = true;
                config.calibrate();
                config
            }
        }

        impl Config {
            /// Copies the values of the keys to the settings of the plant; where a key is unset, the setting stays.
            pub(super) fn copy_to(&self, $plant: &mut PlantSettings, $iron: &mut IronSettings) {
                $($($(
                    // A value that is always set is `Some` of itself.
                    if let Some(value) = Option::from(self.$group.$field) {
                        $place = value;
                    }
                )?)+)+
            }
        }

        /// The keys of the bench, in groups.
        pub static BENCH: &[Entry<Config, f64>] = {
            use Config as Settings;
            &[$($(key!(
                $kind($($unit)?), concat!($prefix, stringify!($field)), [$group] $field: $field_type, concat!($($doc),+)
            )$(.from_to($min as f64, $max as f64))?,)+)+]
        };
    };
}

keys! {
    |plant, iron|
    /// The motor: T equivalent circuit of Figure 21, values of Table 5. The drive is set to the same values.
    "motor." motor: MotorConfig {
        /// Stator resistance.
        r_s: f64 = 5.4, number("ohm"), 0.0001 .. 1000 => plant.machine.rs;
        /// Rotor resistance, referred to the stator.
        r_r: f64 = 1.1, number("ohm"), 0.0001 .. 1000 => plant.machine.rr;
        /// Leakage inductance of the stator.
        l_ls: f64 = 0.0276, number("H"), 1e-7 .. 10 => plant.machine.lls;
        /// Leakage inductance of the rotor, referred to the stator.
        l_lr: f64 = 0.0276, number("H"), 1e-7 .. 10 => plant.machine.llr;
        /// Magnetising inductance.
        l_m: f64 = 0.1771, number("H"), 1e-6 .. 1000 => plant.machine.lm;
        /// Pairs of poles.
        pole_pairs: u32 = 2, whole(), 1 .. 6 => plant.machine.pole_pairs;
        /// Inertia of rotor and load (assumed; not in the source).
        inertia: f64 = 0.012, number("kg m2"), 1e-6 .. 1000 => plant.mechanics.inertia;
        /// Viscous friction (assumed; not in the source).
        friction: f64 = 0.001, number("Nm s/rad"), 0 .. 10 => plant.mechanics.friction;
    }
    /// Differences of the motor from the textbook machine; all of them are assumed.
    "saliency." saliency: SaliencyConfig {
        /// Saliency fixed to the rotor flux, at the flux psi_n.
        a_psi: f64 = -0.035, number(), -0.25 .. 0.25 => plant.saliency.a_psi;
        /// Saliency that follows the stator current; auto: 0.036 1/A with the dissertation's motor, in inverse
        /// proportion to the rated current.
        b1: Option<f64> = None, auto("1/A"), -10 .. 10 => plant.saliency.b1;
        /// Current above which that part no longer grows; auto: 5 A with the dissertation's motor, in proportion to
        /// the rated current.
        hold_a: Option<f64> = None, auto("A"), 0.01 .. 10000 => plant.saliency.hold_a;
        /// Flux at which a_psi holds; auto: the flux of 0.7 A with the dissertation's motor, of a current in
        /// proportion to the rated current with others.
        psi_n: Option<f64> = None, auto("Wb"), 0.0001 .. 100;
        /// Weight of the high-frequency rotor resistance of Eq. 3.8.
        chi: f64 = 0.0, number(), 0 .. 10 => plant.saliency.chi;
        /// Saliency fixed to the stator; positive is low inductance along its axis.
        stator_fixed: f64 = 0.0, number(), -0.1 .. 0.1 => plant.saliency.stator_fixed;
        /// Axis of that saliency, electrical, from phase a.
        stator_fixed_deg: f64 = 0.0, number("deg"), -180 .. 180 => plant.saliency.stator_fixed_deg;
    }
    /// Choice of the machine model.
    "" model: ModelConfig {
        /// Model of the motor: a with the assumed saliency of saliency.*, otherwise a saturation model from which saliency emerges.
        plant: PlantModel = PlantModel::A, word();
        /// Flux at which the numbers of a saturation model hold: low for the flux of 0.7 A with the dissertation's
        /// motor, high for the smaller of the rated flux and the flux of 0.55 times the peak rated current.
        flux_level: FluxLevel = FluxLevel::Low, word();
    }
    /// Magnetic saturation, with plant other than a; auto: as in the model. A positive saliency is low inductance along the axis.
    "iron." iron: IronConfig {
        /// Flux at which saturation and teeth hold; auto: the flux of flux_level.
        psi_n: Option<f64> = None, auto("Wb"), 0.0001 .. 100 => iron.psi_n;
        /// Unsaturated magnetising inductance over the chord inductance at psi_n.
        saturation: Option<f64> = None, auto(""), 1 .. 10 => iron.saturation;
        /// Exponent of the main-flux curve.
        exponent: Option<u32> = None, auto_whole(), 2 .. 12 => iron.exponent;
        /// Whether motor.l_m is the chord inductance at psi_n; otherwise it is the unsaturated inductance.
        chord: bool = true, word() => iron.chord;
        /// Saliency by saturated teeth at psi_n.
        teeth: Option<f64> = None, auto(""), -0.25 .. 0.25 => iron.teeth;
        /// Flux that the teeth follow: 0 rotor flux, 1 air-gap flux, a value in between a mixture of both.
        teeth_gap: Option<f64> = None, auto(""), 0 .. 1 => iron.teeth_gap;
        /// Constant rotation of the axis of the teeth ahead of that flux.
        teeth_turn_deg: f64 = 0.0, number("deg"), -90 .. 90 => iron.teeth_turn_deg;
        /// Rotation of the axis of the teeth by load, per q-axis current behind a lag of 20 Hz.
        teeth_turn_deg_per_a: f64 = 0.0, number("deg/A"), -90 .. 90 => iron.teeth_turn_deg_per_a;
        /// Peak current at which motor.l_ls and motor.l_lr are the leakage inductances; 0: without current.
        nominal_a: Option<f64> = None, auto("A"), 0 .. 10000 => iron.nominal_a;
        /// Relative decrease of the stator leakage inductance with current.
        leakage_saturation: Option<f64> = None, auto("1/A"), 0 .. 50 => iron.leakage_saturation;
        /// Relative decrease of the rotor leakage inductance with current.
        rotor_leakage_saturation: Option<f64> = None, auto("1/A"), 0 .. 50 => iron.rotor_leakage_saturation;
        /// Rotor resistance at high frequency divided by that at slip frequency (deep bars).
        skin_ratio: Option<f64> = None, auto(""), 1 .. 20 => iron.skin_ratio;
        /// Decrease of the rotor leakage inductance at high frequency.
        skin_leakage: Option<f64> = None, auto("H"), 0 .. 10 => iron.skin_leakage;
        /// Saliency that rotates with the bars of the rotor.
        slots: f64 = 0.0, number(), -0.1 .. 0.1 => iron.slots;
        /// Number of rotor bars.
        bars: u32 = 28, whole(), 4 .. 400 => iron.bars;
        /// Saliency fixed to the stator.
        stator_fixed: f64 = 0.0, number(), -0.1 .. 0.1 => iron.stator_fixed;
        /// Axis of that saliency, electrical, from phase a.
        stator_fixed_deg: f64 = 0.0, number("deg"), -180 .. 180 => iron.stator_fixed_deg;
        /// Iron-loss resistance in parallel with the magnetising branch; auto: no iron losses.
        loss: Option<f64> = None, auto("ohm"), 1 .. 1e6 => iron.loss;
    }
    /// Resistances that rise with time, towards their final value.
    "warming." warming: WarmingConfig {
        /// Relative rise of the stator resistance.
        r_s: f64 = 0.0, number(), -0.5 .. 2 => plant.warming.rs;
        /// Relative rise of the rotor resistance.
        r_r: f64 = 0.0, number(), -0.5 .. 2 => plant.warming.rr;
        /// Time constant.
        time_constant_s: f64 = 60.0, number("s"), 0.01 .. 1e5 => plant.warming.time_constant;
    }
    /// The inverter.
    "inverter." inverter: InverterConfig {
        /// Voltage of the dc link. The drive's nominal one is set to the same value.
        dc_link_v: f64 = 311.0, number("V"), 10 .. 1000 => plant.inverter.vdc;
        /// Time during which neither switch of a leg conducts, at each edge. The drive is set to the same value.
        dead_time_s: f64 = 2.2e-6, number("s"), 0 .. 6e-6;
        /// Time from the command to the first switching (section 3.9).
        propagation_us: f64 = 2.2, number("us"), 0 .. 10 => plant.inverter.propagation_us;
        /// Further voltage per phase with the sign of the current, which no compensation knows; auto: 1.64 V at 311 V,
        /// 40 % of the voltage of the dead time (assumed), in proportion to the dc link.
        residual_v: Option<f64> = None, auto("V"), 0 .. 20 => plant.inverter.residual_v;
        /// Further dead time that the drive does not know; not below minus the dead time.
        extra_dead_time_s: f64 = 0.0, number("s"), -6e-6 .. 6e-6;
        /// Capacitance of the output node of each leg; no effect with switched.
        node_capacitance_f: f64 = 0.0, number("F"), 0 .. 1e-6 => plant.inverter.node_capacitance;
        /// Current below which voltages with the sign of a phase current are proportional to that current instead.
        smoothing_a: f64 = 0.02, number("A"), 1e-5 .. 100 => plant.inverter.smoothing_a;
        /// Resistance of a conducting switch.
        on_resistance: f64 = 0.0, number("ohm"), 0 .. 100 => plant.inverter.on_resistance;
        /// Resistance of line and winding of phase b minus that of phase a; no effect with switched.
        more_ohm_b: f64 = 0.0, number("ohm"), -10 .. 10 => plant.inverter.more_ohm[1];
        /// Resistance of line and winding of phase c minus that of phase a; no effect with switched.
        more_ohm_c: f64 = 0.0, number("ohm"), -10 .. 10 => plant.inverter.more_ohm[2];
        /// Dead time of leg b minus that of leg a; no effect with switched.
        more_dead_time_b_us: f64 = 0.0, number("us"), -1 .. 1 => plant.inverter.more_dead_time_us[1];
        /// Dead time of leg c minus that of leg a; no effect with switched.
        more_dead_time_c_us: f64 = 0.0, number("us"), -1 .. 1 => plant.inverter.more_dead_time_us[2];
        /// Phase that is interrupted between inverter and motor.
        open_phase: OpenPhase = OpenPhase::None, word();
        /// Whether every switching edge is simulated; otherwise the mean voltage of a period is used.
        switched: bool = false, word() => plant.inverter.switched;
    }
    /// The dc link, whose nominal voltage is inverter.dc_link_v.
    "dc_link." dc_link: DcLinkConfig {
        /// Relative amplitude of a sine ripple on a stiff link.
        ripple: f64 = 0.0, number(), 0 .. 0.5 => plant.dc_link.ripple;
        /// Frequency of that ripple.
        ripple_hz: f64 = 100.0, number("Hz"), 0.1 .. 3000 => plant.dc_link.ripple_hz;
        /// Capacitor behind a rectifier that cannot feed back into the mains; 0 for a stiff link.
        capacitor_f: f64 = 0.0, number("F"), 0 .. 0.1 => plant.dc_link.capacitor;
        /// Pulses of the rectifier per mains period: 2 or 6; 0 for a supply without ripple.
        pulses: u32 = 6, whole(), 0 .. 6 => plant.dc_link.pulses;
        /// Frequency of the mains.
        mains_hz: f64 = 50.0, number("Hz"), 1 .. 1000 => plant.dc_link.mains_hz;
        /// Resistance of mains and rectifier.
        source: f64 = 1.0, number("ohm"), 0.01 .. 1000 => plant.dc_link.source;
        /// Further resistance while the precharge relay is open; 0 for no relay.
        precharge: f64 = 0.0, number("ohm"), 0 .. 1e5 => plant.dc_link.precharge;
        /// Start of a mains outage.
        outage_at_s: f64 = 0.0, number("s"), 0 .. 1e6 => plant.dc_link.outage_at;
        /// Duration of the outage; 0 for none.
        outage_s: f64 = 0.0, number("s"), 0 .. 1e6 => plant.dc_link.outage;
        /// Start of a sag of the mains.
        sag_at_s: f64 = 0.0, number("s"), 0 .. 1e6 => plant.dc_link.sag_at;
        /// Duration of the sag; 0 for none.
        sag_s: f64 = 0.0, number("s"), 0 .. 1e6 => plant.dc_link.sag;
        /// Peak of the rectified mains during the sag.
        sag_v: f64 = 230.0, number("V"), 0 .. 1000 => plant.dc_link.sag_v;
        /// Time in which the mains voltage falls to the sag, and returns.
        sag_ramp_s: f64 = 0.01, number("s"), 0.0001 .. 1e6 => plant.dc_link.sag_ramp;
        /// Power that other devices take from the link.
        load_w: f64 = 0.0, number("W"), 0 .. 1e6 => plant.dc_link.load;
        /// Voltage at which the brake chopper switches on by itself; auto: the drive commands it.
        chopper_v: Option<f64> = None, auto("V"), 10 .. 1000 => plant.dc_link.chopper_v;
        /// Resistor of the chopper.
        chopper: f64 = 100.0, number("ohm"), 0.1 .. 1e6 => plant.dc_link.chopper;
    }
    /// The sensors and their ADCs. The drive's scales are set to match, without the errors.
    "measurement." measurement: MeasurementConfig {
        /// End of the range of the current sensors.
        range_a: f64 = 4.4727134, number("A"), 0.01 .. 5000 => plant.measurement.range_a;
        /// Noise of each channel, rms; auto: 5 mA with the dissertation's sensors, in proportion to the range.
        noise_a: Option<f64> = None, auto("A"), 0 .. 10 => plant.measurement.noise_a;
        /// Resolution of the ADC, 7 to 16 bits over the range; auto: 12 bits.
        lsb_a: Option<f64> = None, auto("A"), 1e-7 .. 50 => plant.measurement.lsb_a;
        /// Corner of the analog filter of Figure 16, first order; 0 for none.
        filter_hz: f64 = 5305.0, number("Hz"), 0 .. 1e6 => plant.measurement.filter_hz;
        /// Relative error of the gain of channel a.
        gain_error_a: f64 = 0.0, number(), -0.5 .. 0.5 => plant.measurement.gain_error_a;
        /// Relative error of the gain of channel b.
        gain_error_b: f64 = 0.0, number(), -0.5 .. 0.5 => plant.measurement.gain_error_b;
        /// Offset of channel a.
        offset_a: f64 = 0.0, number("A"), -5 .. 5 => plant.measurement.offset_a;
        /// Offset of channel b.
        offset_b: f64 = 0.0, number("A"), -5 .. 5 => plant.measurement.offset_b;
        /// Share of the current of phase b that channel a reads as well.
        cross_talk_a: f64 = 0.0, number(), -0.2 .. 0.2 => plant.measurement.cross_talk_a;
        /// Share of the current of phase a that channel b reads as well.
        cross_talk_b: f64 = 0.0, number(), -0.2 .. 0.2 => plant.measurement.cross_talk_b;
        /// Further lag of channel b, first order.
        lag_b_us: f64 = 0.0, number("us"), 0 .. 1000 => plant.measurement.lag_b_us;
        /// Relative error at the end of the range; it grows with the square of the current.
        cubic_error: f64 = 0.0, number(), -0.3 .. 0.3 => plant.measurement.cubic_error;
        /// Drift of the offset of channel a, from the start.
        drift_a: f64 = 0.0, number("A/s"), -1 .. 1 => plant.measurement.drift_a;
        /// Drift of the offset of channel b, from the start.
        drift_b: f64 = 0.0, number("A/s"), -1 .. 1 => plant.measurement.drift_b;
        /// Whether each sample is the mean of two conversions, one in each zero vector. The drive is set to the age of the mean.
        both_zero_vectors: bool = false, word() => plant.measurement.both_zero_vectors;
        /// Relative error of the gain of the dc-link voltage.
        dc_gain_error: f64 = 0.0, number(), -0.5 .. 0.5 => plant.measurement.dc_gain_error;
        /// Lag of the dc-link voltage, first order.
        dc_lag_us: f64 = 0.0, number("us"), 0 .. 1e5 => plant.measurement.dc_lag_us;
        /// Noise of the dc-link voltage, rms.
        dc_noise_v: f64 = 0.0, number("V"), 0 .. 100 => plant.measurement.dc_noise_v;
        /// End of the range of the dc link; auto: 450 V at 311 V, more in proportion to a higher dc link.
        dc_link_range_v: Option<f64> = None, auto("V"), 10 .. 2000;
        /// Temperature of the heat sink.
        heat_sink_c: f64 = 25.0, number("degC"), -40 .. 150;
    }
    /// The load.
    "load." load: LoadConfig {
        /// Load on the shaft.
        mode: LoadMode = LoadMode::Locked, word();
        /// Speed that the dynamometer holds, with load.mode = speed.
        speed_rpm: f64 = 0.0, number("rpm"), -24000 .. 24000;
        /// Torque of the load, with load.mode = free; auto: none, or the experiment's own.
        torque_nm: Option<f64> = None, auto("Nm"), -10000 .. 10000;
    }
    /// Properties that a shaft may have besides inertia, friction and load.
    "shaft." shaft: ShaftConfig {
        /// Static friction: the breakaway torque, and the same torque against the motion.
        static_nm: f64 = 0.0, number("Nm"), 0 .. 1000 => plant.mechanics.static_torque;
        /// Amplitude of a load torque that varies once per revolution.
        once_nm: f64 = 0.0, number("Nm"), 0 .. 1000 => plant.mechanics.once_torque;
        /// Distance of the stops on both sides from the initial position; 0: no stops.
        stops_turns: f64 = 0.0, number("turns"), 0 .. 1000;
        /// Stiffness of a stop.
        stop_stiffness: f64 = 100.0, number("Nm/rad"), 0 .. 1e9 => plant.mechanics.stop_stiffness;
        /// Inertia behind an elastic coupling, where the load acts; 0 for a rigid shaft. motor.inertia is then the
        /// inertia before the coupling.
        load_inertia: f64 = 0.0, number("kg m2"), 0 .. 1000 => plant.mechanics.load_inertia;
        /// Stiffness of the coupling; its resonance may be 500 Hz at most.
        stiffness: f64 = 100.0, number("Nm/rad"), 0.001 .. 1e9 => plant.mechanics.stiffness;
        /// Damping of the coupling.
        damping: f64 = 0.0, number("Nm s/rad"), 0 .. 1000 => plant.mechanics.damping;
    }
    /// References, for experiments that do not bring their own.
    "reference." reference: ReferenceConfig {
        /// q-axis current, peak; auto: 1 A with the dissertation's motor, in proportion to the rated current.
        iq_a: Option<f64> = None, auto("A"), -1000 .. 1000;
    }
    /// Preparation of the drive before the experiment.
    "prepare." prepare: PrepareConfig {
        /// Whether the drive measures its motor first, as a user would command it: the drive then knows only the
        /// nameplate. Its magnetising current follows the rule.
        commission: bool = false, word();
        /// Whether a sensorless drive first runs the saliency self-commissioning with the shaft locked, as a user would.
        learn: bool = false, word();
    }
    /// The stress test (experiment battery).
    "battery." battery: BatteryConfig {
        /// Kind of runs: kinds for the twelve kinds, load for load steps, hold for torque near the maximum at
        /// standstill, forced for a sudden rotation of the flux, restless for dithered torque, dragged for a shaft that
        /// is driven through zero stator frequency under torque, arising for the same with an asymmetry that arises after the start.
        runs: BatteryRuns = BatteryRuns::Kinds, word();
        /// Load step of battery.runs = load, relative to the torque at the nominal limit of the q-axis current.
        load_share: f64 = 0.4, number(), 0 .. 2;
        /// Whether the drive repeats the saliency self-commissioning for every twelve runs; otherwise once, unless
        /// disturbances are drawn at random.
        relearn: bool = false, word();
    }
    /// The experiment full-range.
    "full_range." full_range: FullRangeConfig {
        /// The kind of runs, or all kinds.
        kind: RangeKind = RangeKind::All, word();
        /// The only run, by its number, with its curves; auto: all runs.
        index: Option<u32> = None, auto_whole(), 0 .. 1e9;
    }
    /// Disturbances of the stress test: all of the page Statistics together, relative to their full sizes.
    "disturbed." disturbed: DisturbedConfig {
        /// Size of each disturbance.
        together: f64 = 0.0, number(), 0 .. 2;
        /// Largest random part that is added to each disturbance, of either sign where it has one.
        drawn: f64 = 0.0, number(), 0 .. 2;
    }
    /// The endurance test (experiment record).
    "record." record: RecordConfig {
        /// Time for which the torque limit is held at zero stator frequency.
        minutes: f64 = 10.0, number("min"), 0.05 .. 1000;
        /// Largest torque relative to the rated torque; if the drive cannot give it, its torque limit is used.
        torque_pct: f64 = 1000.0, number("%"), 1 .. 1000;
        /// Angle of the fixed rotor flux during that time, electrical, from phase a.
        flux_deg: f64 = 0.0, number("deg"), -180 .. 180;
        /// Duration of the speed reversal.
        reversal_s: f64 = 60.0, number("s"), 1 .. 3600;
    }
    /// The experiment commission.
    "commission." commission: CommissionConfig {
        /// Whether phases, legs and sensors of the random machines differ as well: resistances by 2 % and delays by 0.1
        /// us either way, a stator-fixed saliency of 1 % along any axis, and a lag of channel b of 10 us.
        disturbed: bool = false, word();
    }
    /// Errors that monte-carlo draws at random for every run, besides the operating point.
    "spread." spread: SpreadConfig {
        /// Largest relative error of each motor parameter that the drive uses.
        motor: f64 = 0.0, number(), 0 .. 0.5;
        /// In machines: largest factor by which each motor parameter is multiplied or divided; 1 for the motor itself.
        machine: f64 = 1.0, number(), 1 .. 4;
        /// Largest relative change of the sensors' noise.
        noise: f64 = 0.0, number(), 0 .. 1;
        /// Largest relative error of the gain of each current channel.
        gain: f64 = 0.0, number(), 0 .. 0.1;
    }
    /// How much is simulated.
    "" extent: ExtentConfig {
        /// Runs of a statistical experiment; auto: the experiment's own number.
        runs: Option<u32> = None, auto_whole(), 1 .. 1000000;
        /// Simulated time; auto: the experiment's own.
        seconds: Option<f64> = None, auto("s"), 0.001 .. 3600;
    }
}
