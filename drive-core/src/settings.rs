//! Settings in SI units, and the [`Coefficients`] the control step works with.
//!
//! [`Settings::build`] turns one into the other, outside the interrupt: it checks every value
//! against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.

mod check;
mod learned;
pub mod table;

use core::fmt;

use crate::carrier::DemodulatorKind;
use crate::math::decimal::Shortest;
use crate::tuning::{FirstOrder, TuningError};

use table::{CarrierTable, ReferenceTable};

/// The motor: T-equivalent circuit per phase (Figure 21), star, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Stator resistance, ohm.
    pub r_s: f32,
    /// Rotor resistance, ohm.
    pub r_r: f32,
    /// Stator leakage inductance, H.
    pub l_ls: f32,
    /// Rotor leakage inductance, H.
    pub l_lr: f32,
    /// Magnetising inductance, H.
    pub l_m: f32,
    /// Pole pairs.
    pub pole_pairs: u8,
    /// Inertia of rotor and load, kg m^2: the speed loop is designed for it.
    pub inertia: f32,
}

impl Default for Motor {
    /// Table 5; the inertia is assumed.
    fn default() -> Self {
        Self {
            r_s: 5.4,
            r_r: 1.1,
            l_ls: 0.0276,
            l_lr: 0.0276,
            l_m: 0.1771,
            pole_pairs: 2,
            inertia: 0.012,
        }
    }
}

impl Motor {
    /// Rotor inductance, H.
    pub fn l_r(&self) -> f32 {
        self.l_m + self.l_lr
    }

    /// Transient inductance sigma L_s, H.
    pub fn sigma_l_s(&self) -> f32 {
        self.l_ls + self.l_m * (self.l_lr / self.l_r())
    }

    /// (L_m / L_r) L_m, H: what couples the rotor flux to the stator.
    pub fn coupled_inductance(&self) -> f32 {
        self.l_m / self.l_r() * self.l_m
    }

    /// Rotor time constant L_r / r_r, s.
    pub fn tau_r(&self) -> f32 {
        self.l_r() / self.r_r
    }

    /// Torque per ampere on the quadrature axis with `i_d` A standing on the direct axis, Nm/A:
    /// 3/2 P L_m^2 / L_r i_d (Eq. 2.7 prints L_m for L_m^2 / L_r).
    pub fn torque_per_ampere(&self, i_d: f32) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.l_m * self.l_m / self.l_r() * i_d
    }
}

/// The timer and the power stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverter {
    /// Value at which the counter turns round: 14167 at 170 MHz and 6 kHz.
    pub top: u16,
    /// Dead time, s.
    pub dead_time_s: f32,
    /// Whether the dead time is compensated.
    pub compensate: bool,
    /// Current from which on the compensation is full, A.
    pub full_compensation_a: f32,
}

impl Default for Inverter {
    /// Section 3.9; full compensation from 30 mA on: three times the spread of noise and prediction.
    fn default() -> Self {
        Self { top: 14_167, dead_time_s: 2.2e-6, compensate: true, full_compensation_a: 0.03 }
    }
}

/// Calibration line of one channel: `value = gain * code + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Units per code.
    pub gain: f32,
    /// Value at code 0.
    pub offset: f32,
}

impl Line {
    /// Channel A of the dissertation's board, Eq. 3.5.
    pub const CHANNEL_A: Self = Self { gain: 0.002_212_0, offset: -4.472_713_4 };
    /// Channel B, Eq. 3.5, with all printed digits.
    #[allow(clippy::excessive_precision)]
    pub const CHANNEL_B: Self = Self { gain: 0.002_231_4, offset: -4.496_623_8 };

    /// The line times a factor.
    pub fn scaled(self, factor: f32) -> Self {
        Self { gain: factor * self.gain, offset: factor * self.offset }
    }

    /// Value at a code.
    pub fn at(self, code: u16) -> f32 {
        self.gain * f32::from(code) + self.offset
    }
}

/// Scales of the converters and of the encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Current a, A.
    pub current_a: Line,
    /// Current b, A.
    pub current_b: Line,
    /// Dc-link voltage, V.
    pub dc_link: Line,
    /// Largest code of the current channels.
    pub full_scale: u16,
    /// Heat-sink codes above this are too hot.
    pub heat_sink_trip: u16,
    /// Delay of the analog filters of the currents, s.
    pub current_delay_s: f32,
    /// Encoder counts per mechanical turn, four a line.
    pub encoder_counts: u32,
}

impl Default for Scales {
    /// Eq. 3.5; 0.11 V per code (451 V at full scale); the 5305 Hz filter of Figure 16; 2500 lines.
    fn default() -> Self {
        Self {
            current_a: Line::CHANNEL_A,
            current_b: Line::CHANNEL_B,
            dc_link: Line { gain: 0.11, offset: 0.0 },
            full_scale: 4095,
            heat_sink_trip: 4000,
            current_delay_s: 30e-6,
            encoder_counts: 10_000,
        }
    }
}

/// Where the flux angle comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AngleSource {
    /// Encoder and slip, Eq. 2.10.
    Encoder,
    /// The injected carrier: no sensor on the shaft.
    #[default]
    Injection,
}

/// What the current controllers are designed for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CurrentPlant {
    /// First-order plants k / (z - p) identified on the motor with the filters in place
    /// (Eq. 3.41 and 3.42).
    Identified {
        /// Direct axis.
        d: FirstOrder,
        /// Quadrature axis.
        q: FirstOrder,
    },
    /// The plant computed from the parameters of the motor.
    Motor,
}

impl Default for CurrentPlant {
    fn default() -> Self {
        Self::Identified {
            d: FirstOrder { k: 0.002_837, p: 0.9511 },
            q: FirstOrder { k: 0.003_721, p: 0.9503 },
        }
    }
}

/// The loop of sections 3.4 and 3.11: behind all demodulations but the synchronous one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedChain {
    /// `ref_delta_i`, A (section 3.3): reference of the current difference from
    /// [`full_reference_iq_a`](Self::full_reference_iq_a) on. It must be odd in i_q, so it follows
    /// the sign of i_q, and goes through zero linearly.
    pub reference_a: f32,
    /// Current on the quadrature axis from which on the reference is full, A.
    pub full_reference_iq_a: f32,
    /// Gain k_s of the tracker, rad/A (Eq. 3.44).
    pub k_s: f32,
    /// Zero z_s of the tracker (Eq. 3.44).
    pub z_s: f32,
    /// Reference of the current difference over the torque current, A, learned with the shaft locked;
    /// takes the place of the constant one.
    pub learned: Option<ReferenceTable>,
    /// Length of the rms filters of [`DemodulatorKind::RmsImpedance`], samples.
    pub rms_samples: u8,
}

impl Default for PrintedChain {
    /// Sections 3.3 and 3.11; two carrier periods.
    fn default() -> Self {
        Self {
            reference_a: 0.010,
            full_reference_iq_a: 1.0,
            k_s: 0.132_546,
            z_s: 0.90,
            learned: None,
            rms_samples: 20,
        }
    }
}

/// Synchronous demodulation and its loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynchronousTracking {
    /// Natural frequency of the tracking loop, Hz.
    pub bandwidth_hz: f32,
    /// Saliency fixed to the flux at the nominal magnetising current. Negative: the inductance along
    /// the flux is the larger one.
    pub flux_saliency: f32,
    /// Saliency by the stator current, 1/A; for the gain schedule.
    pub current_saliency: f32,
    /// Reference of the saliency over the torque current, learned with the shaft locked.
    pub reference: ReferenceTable,
    /// Whether a start checks that the motor has the saliency (see [`crate::protect::saliency_check`]). Without
    /// it a start trusts that it has, and that the shaft stands still.
    pub check: bool,
    /// Whether the lock is verified at a start and watched (see [`crate::protect::lock_monitor`]).
    pub monitor: bool,
    /// Carrier current over the torque current, learned with the shaft locked; for the monitor.
    pub carrier: CarrierTable,
    /// Share of the flux-fixed saliency that may be missing; 1 is a flux that is gone.
    pub allowed_loss: f32,
    /// Time constant of the mean of that share, s.
    pub loss_s: f32,
    /// Speed of the rotor that trips, rpm: as far as the angle is tracked.
    pub tracked_rpm: f32,
}

impl Default for SynchronousTracking {
    /// For the simulated motor; see [`ReferenceTable::default`].
    fn default() -> Self {
        Self {
            bandwidth_hz: 3.5,
            flux_saliency: -0.035,
            current_saliency: 0.0338,
            reference: ReferenceTable::default(),
            check: true,
            monitor: true,
            carrier: CarrierTable::default(),
            allowed_loss: 0.55,
            loss_s: 0.08,
            tracked_rpm: 700.0,
        }
    }
}

/// The injection and what tracks the angle with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectionSettings {
    /// Amplitude of the injected voltage, V peak; 0 for none.
    pub amplitude_v: f32,
    /// What is made of the carrier current.
    pub demodulator: DemodulatorKind,
    /// Settings of the chain of the dissertation.
    pub printed: PrintedChain,
    /// Settings of the synchronous demodulation.
    pub synchronous: SynchronousTracking,
    /// Inject and demodulate also while the angle comes from the encoder.
    pub beside_encoder: bool,
}

impl Default for InjectionSettings {
    /// 50 V (28 % of what the dc link gives) is assumed, the dissertation does not say.
    fn default() -> Self {
        Self {
            amplitude_v: 50.0,
            demodulator: DemodulatorKind::default(),
            printed: PrintedChain::default(),
            synchronous: SynchronousTracking::default(),
            beside_encoder: false,
        }
    }
}

/// Limits and protections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest current vector that is regulated, A peak.
    pub current_a: f32,
    /// Phase current that trips, A.
    pub trip_a: f32,
    /// Dc link above which the drive trips, V.
    pub dc_over_v: f32,
    /// Dc link below which it trips while the outputs are on, V.
    pub dc_under_v: f32,
    /// Speed of the rotor that trips, rpm.
    pub speed_rpm: f32,
    /// Voltage that the model of the motor may fail to explain at standstill, V.
    pub unexplained_v: f32,
}

impl Default for Limits {
    /// Trip below the end of the sensors' range (4.47 A); 3.5 A plus the carrier's 0.26 A stay clear
    /// of it. 12 V unexplained is what 3 A on 30 %
    /// of resistance and an inductance 15 % off at a full step come to.
    fn default() -> Self {
        Self {
            current_a: 3.5,
            trip_a: 4.3,
            dc_over_v: 400.0,
            dc_under_v: 200.0,
            speed_rpm: 2000.0,
            unexplained_v: 12.0,
        }
    }
}

/// What happens between `start` and regulation, and at `stop`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// Time for the offset calibration, s.
    pub calibrate_s: f32,
    /// Time with the low sides on, s.
    pub precharge_s: f32,
    /// Time with current on the direct axis alone, s.
    pub magnetise_s: f32,
    /// Current on the direct axis, A peak.
    pub i_d: f32,
    /// How fast the torque current goes to zero at a stop, A/s.
    pub stop_a_per_s: f32,
}

impl Default for Sequence {
    /// 0.7 A is the magnetising current of section 3.10; 0.8 s are four rotor time constants.
    fn default() -> Self {
        Self {
            calibrate_s: 0.1,
            precharge_s: 0.010,
            magnetise_s: 0.8,
            i_d: 0.7,
            stop_a_per_s: 30.0,
        }
    }
}

/// The speed loop, and the position loop around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedSettings {
    /// Largest current on the quadrature axis, A.
    pub i_q_limit_a: f32,
    /// Largest speed that is asked for, in either mode, rpm.
    pub limit_rpm: f32,
    /// Largest acceleration that is asked for, rpm/s.
    pub ramp_rpm_per_s: f32,
    /// Phase margin that the speed loop is designed for, degrees: more is calmer and slower.
    pub phase_margin_deg: f32,
}

impl Default for SpeedSettings {
    /// 3 A of section 4.1. Without a sensor the angle is good to 300 rpm, and lags by 5.7° while the
    /// speed changes by 300 rpm/s (four poles, 4 Hz): with an encoder both may be larger.
    fn default() -> Self {
        Self { i_q_limit_a: 3.0, limit_rpm: 300.0, ramp_rpm_per_s: 300.0, phase_margin_deg: 60.0 }
    }
}

/// Everything that can be set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The motor.
    pub motor: Motor,
    /// The timer and the power stage.
    pub inverter: Inverter,
    /// Scales of converters and encoder.
    pub scales: Scales,
    /// Where the flux angle comes from.
    pub angle_source: AngleSource,
    /// What the current controllers are designed for.
    pub current_plant: CurrentPlant,
    /// Leave the delays of the current measurement and of the demodulation uncompensated, as the
    /// dissertation does, to show what they cost: with the encoder 4.7° at 1440 rpm, with the
    /// injection some 9° at standstill already (the flux slips) and 35° at 150 rpm.
    pub ignore_delays: bool,
    /// Whether the drive takes the rotor time constant that [`online`](crate::identify::online) finds.
    pub track_rotor: bool,
    /// The injection.
    pub injection: InjectionSettings,
    /// Limits and protections.
    pub limits: Limits,
    /// Start and stop.
    pub sequence: Sequence,
    /// The speed and the position loop.
    pub speed: SpeedSettings,
}

/// Why settings were refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingsError {
    /// A value outside its range.
    Range {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f32,
        /// Smallest allowed.
        min: f32,
        /// Largest allowed.
        max: f32,
    },
    /// The design of the controllers failed.
    Tuning(TuningError),
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { name, value, min, max } => {
                let [value, min, max] = [value, min, max].map(|x| Shortest(*x));
                write!(f, "{name} = {value}: allowed is {min} to {max}")
            }
            Self::Tuning(error) => write!(f, "controllers: {error}"),
        }
    }
}

impl core::error::Error for SettingsError {}

impl From<TuningError> for SettingsError {
    fn from(error: TuningError) -> Self {
        Self::Tuning(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f32, expected: f32) {
        assert!((value / expected - 1.0).abs() < 1e-5, "{value}, not {expected}");
    }

    /// Table 5, worked out by hand.
    #[test]
    fn derived_parameters_of_the_motor() {
        let motor = Motor::default();
        near(motor.l_r(), 0.2047);
        near(motor.sigma_l_s(), 0.051_478_7);
        near(motor.coupled_inductance(), 0.153_221_3);
        near(motor.l_m + motor.l_ls, motor.sigma_l_s() + motor.coupled_inductance());
        near(motor.tau_r(), 0.186_090_9);
        near(motor.torque_per_ampere(0.7), 0.321_764_7);
        near(motor.torque_per_ampere(1.4), 0.643_529_4);
    }

    #[test]
    fn a_line_gives_the_value_of_a_code() {
        let line = Line { gain: 0.002, offset: -4.0 };
        near(line.at(3000), 2.0);
        near(line.at(0), -4.0);
        near(line.scaled(1.5).at(3000), 3.0);
        near(line.scaled(1.5).at(0), -6.0);
    }
}
