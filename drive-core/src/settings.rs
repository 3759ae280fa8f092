//! Settings in SI units, and the [`Coefficients`] the control step works with.
//!
//! [`Settings::build`] turns one into the other, outside the interrupt: it checks every value
//! against its range and runs the design rules. [`Settings::default`] is the drive of the
//! dissertation.

use core::f32::consts::TAU;
use core::fmt;

use crate::dead_time::DeadTime;
use crate::demodulator::Demodulator;
use crate::indirect::Indirect;
use crate::injection::Injection;
use crate::modulation::Modulator;
use crate::pi::{DqPi, Pi, ReferenceFilter};
use crate::plausibility::Prediction;
use crate::position::Position;
use crate::sensing::{Line, Sensing};
use crate::tracker::Tracker;
use crate::tuning::{self, CurrentLoopDesign, FirstOrder, TuningError};

/// Period of the control, s: 6 kHz. Filters and carrier are made for this rate alone.
pub const PERIOD_S: f32 = 1.0 / 6000.0;

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
    /// Inertia of rotor and load, kg m^2: the position loop is designed for it.
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

    /// Rotor time constant L_r / r_r, s.
    pub fn t_sec(&self) -> f32 {
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
    /// Section 3.9; full compensation from 50 mA on: about the spread of noise and prediction.
    fn default() -> Self {
        Self { top: 14_167, dead_time_s: 2.2e-6, compensate: true, full_compensation_a: 0.05 }
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

/// The injection and what tracks the angle with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectionSettings {
    /// Amplitude of the injected voltage, V peak; 0 for none.
    pub amplitude_v: f32,
    /// How the current is demodulated.
    pub demodulator: Demodulator,
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
    /// Inject and demodulate also while the angle comes from the encoder.
    pub beside_encoder: bool,
}

impl Default for InjectionSettings {
    /// Sections 3.3 and 3.11; 50 V (28 % of what the dc link gives) is assumed, the dissertation
    /// does not say.
    fn default() -> Self {
        Self {
            amplitude_v: 50.0,
            demodulator: Demodulator::Rectified,
            reference_a: 0.010,
            full_reference_iq_a: 1.0,
            k_s: 0.132_546,
            z_s: 0.90,
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
    /// of it. 20 V unexplained is ten times the residual of the dead time.
    fn default() -> Self {
        Self {
            current_a: 3.5,
            trip_a: 4.3,
            dc_over_v: 400.0,
            dc_under_v: 200.0,
            speed_rpm: 2000.0,
            unexplained_v: 20.0,
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

/// The position loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionSettings {
    /// Largest current on the quadrature axis, A.
    pub i_q_limit_a: f32,
    /// Speed of the guard, rpm.
    pub guard_rpm: f32,
}

impl Default for PositionSettings {
    /// Section 4.1.
    fn default() -> Self {
        Self { i_q_limit_a: 3.0, guard_rpm: 1440.0 }
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
    /// The injection.
    pub injection: InjectionSettings,
    /// Limits and protections.
    pub limits: Limits,
    /// Start and stop.
    pub sequence: Sequence,
    /// The position loop.
    pub position: PositionSettings,
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
    /// The design of the current controllers failed.
    Tuning(TuningError),
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { name, value, min, max } => {
                write!(f, "{name} = {value}: allowed is {min} to {max}")
            }
            Self::Tuning(error) => write!(f, "current controllers: {error}"),
        }
    }
}

impl core::error::Error for SettingsError {}

impl From<TuningError> for SettingsError {
    fn from(error: TuningError) -> Self {
        Self::Tuning(error)
    }
}

/// Everything the control step needs, made from [`Settings`] outside the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    pub(crate) sensing: Sensing,
    pub(crate) source: AngleSource,
    pub(crate) indirect: Indirect,
    /// Inject a carrier at all.
    pub(crate) inject: bool,
    /// Demodulate and, with the injection as source, track.
    pub(crate) demodulate: bool,
    pub(crate) injection: Injection,
    pub(crate) demodulator: Demodulator,
    /// Samples by which the demodulated current lags the injection axis.
    pub(crate) demodulation_lag: f32,
    pub(crate) tracker: Tracker,
    pub(crate) injection_reference: InjectionReference,
    pub(crate) current_loop: DqPi,
    pub(crate) reference_filter: [ReferenceFilter; 2],
    /// Delay of the measured current beside the filter, samples.
    pub(crate) current_lag: f32,
    /// 1 where the delays of the current are compensated, 0 where not.
    pub(crate) lag_share: f32,
    pub(crate) modulator: Modulator,
    pub(crate) dead_time: DeadTime,
    pub(crate) prediction: Prediction,
    pub(crate) position: Position,
    pub(crate) protection: Protection,
    pub(crate) sequence: SequenceSteps,
    /// What the design of the current controllers came to, d and q.
    pub designs: [CurrentLoopDesign; 2],
}

impl Coefficients {
    /// Whether what was set is still finite numbers: a flipped bit may have changed that.
    pub(crate) fn is_finite(&self) -> bool {
        let (s, l) = (&self.sensing, &self.current_loop);
        let sum = s.current_a.gain
            + s.current_a.offset
            + s.current_b.gain
            + s.current_b.offset
            + s.dc_link.gain
            + s.dc_link.offset
            + l.d.k_c
            + l.d.z_c
            + l.q.k_c
            + l.q.z_c
            + self.injection.current_amplitude
            + self.injection_reference.full
            + self.injection_reference.slope
            + self.demodulation_lag
            + self.current_lag
            + self.reference_filter[0].one_minus_p
            + self.reference_filter[1].one_minus_p
            + self.position.pi.k_c
            + self.position.damping
            + self.sequence.i_d
            + self.sequence.stop_ramp;
        sum.is_finite()
    }
}

/// `ref_delta_i` over i_q: odd, constant from a certain current on, linear below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InjectionReference {
    full: f32,
    slope: f32,
    from: f32,
}

impl InjectionReference {
    /// Reference of the current difference, A.
    pub(crate) fn at(&self, i_q: f32) -> f32 {
        if i_q > self.from {
            self.full
        } else if i_q < -self.from {
            -self.full
        } else {
            self.slope * i_q
        }
    }
}

/// Limits in the units of the control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Protection {
    pub trip_a: f32,
    pub dc_over: f32,
    pub dc_under: f32,
    /// Electrical turns per period.
    pub rotor_step: f32,
    /// Square of the largest regulated current, A^2.
    pub current_squared: f32,
}

/// The sequence in control periods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SequenceSteps {
    pub precharge: u32,
    pub magnetise: u32,
    pub i_d: f32,
    /// A per period.
    pub stop_ramp: f32,
}

/// Largest position reference, turns: an f32 still resolves 0.02° there.
pub const LARGEST_POSITION: f32 = 1000.0;

fn check(name: &'static str, value: f32, min: f32, max: f32) -> Result<f32, SettingsError> {
    // Not-a-number fails the test.
    if value >= min && value <= max {
        Ok(value)
    } else {
        Err(SettingsError::Range { name, value, min, max })
    }
}

fn periods(seconds: f32) -> u32 {
    libm::roundf(seconds / PERIOD_S) as u32
}

impl Settings {
    /// Checks every value and runs the design rules.
    ///
    /// # Errors
    /// The first value outside its range, by name, with the range; or why a design rule cannot be
    /// met.
    pub fn build(&self) -> Result<Coefficients, SettingsError> {
        self.check()?;
        let m = &self.motor;
        let motor_plant = tuning::motor_plant(
            &tuning::Motor {
                r_s: f64::from(m.r_s),
                r_r: f64::from(m.r_r),
                l_m: f64::from(m.l_m),
                l_ls: f64::from(m.l_ls),
                l_lr: f64::from(m.l_lr),
            },
            f64::from(PERIOD_S),
        )?;
        let (d, q) = match self.current_plant {
            CurrentPlant::Identified { d, q } => (d, q),
            CurrentPlant::Motor => (motor_plant, motor_plant),
        };
        let design = |plant| tuning::design_current_loop(plant, motor_plant, f64::from(PERIOD_S));
        let designs = [design(d)?, design(q)?];
        let pi = |d: &CurrentLoopDesign| Pi { k_c: d.k_c as f32, z_c: d.z_c as f32 };

        let injecting =
            self.angle_source == AngleSource::Injection || self.injection.beside_encoder;
        let turns_per_step = |rpm: f32| rpm / 60.0 * f32::from(m.pole_pairs) * PERIOD_S;
        // Back-emf, V per electrical turn per period, at the largest flux the limits allow.
        let flux = m.l_m * self.sequence.i_d;
        let emf_per_step = m.l_m / m.l_r() * flux * TAU / PERIOD_S;
        let current_lag = self.scales.current_delay_s / PERIOD_S;
        let inj = &self.injection;
        let lag_share = if self.ignore_delays { 0.0 } else { 1.0 };

        Ok(Coefficients {
            sensing: Sensing {
                current_a: self.scales.current_a,
                current_b: self.scales.current_b,
                dc_link: self.scales.dc_link,
                full_scale: self.scales.full_scale,
                heat_sink_trip: self.scales.heat_sink_trip,
                calibration_samples: periods(self.sequence.calibrate_s) as u16,
                largest_offset: 0.2,
            },
            source: self.angle_source,
            indirect: Indirect::new(
                self.scales.encoder_counts,
                m.pole_pairs,
                m.t_sec(),
                PERIOD_S,
                self.sequence.i_d,
                2.0 * self.limits.speed_rpm / 60.0,
            ),
            inject: injecting && inj.amplitude_v > 0.0,
            demodulate: injecting,
            injection: Injection::new(inj.amplitude_v, motor_plant),
            demodulator: inj.demodulator,
            demodulation_lag: lag_share * (BPF_GROUP_DELAY + current_lag),
            tracker: Tracker::new(inj.k_s, inj.z_s, 1.5 * turns_per_step(self.limits.speed_rpm)),
            injection_reference: InjectionReference {
                full: inj.reference_a,
                slope: inj.reference_a / inj.full_reference_iq_a,
                from: inj.full_reference_iq_a,
            },
            current_loop: DqPi { d: pi(&designs[0]), q: pi(&designs[1]) },
            reference_filter: [
                ReferenceFilter::new(designs[0].p_f),
                ReferenceFilter::new(designs[1].p_f),
            ],
            current_lag,
            lag_share,
            modulator: Modulator::new(
                self.inverter.top,
                PERIOD_S,
                self.inverter.dead_time_s,
                self.inverter.compensate,
            ),
            dead_time: if self.inverter.compensate {
                DeadTime::new(
                    self.inverter.dead_time_s,
                    PERIOD_S,
                    self.inverter.full_compensation_a,
                )
            } else {
                DeadTime::NONE
            },
            prediction: Prediction::new(motor_plant, self.limits.unexplained_v, emf_per_step),
            position: Position::new(
                m.torque_per_ampere(self.sequence.i_d) / m.inertia,
                self.scales.encoder_counts,
                self.position.guard_rpm / 60.0,
                self.position.i_q_limit_a,
                PERIOD_S,
            ),
            protection: Protection {
                trip_a: self.limits.trip_a,
                dc_over: self.limits.dc_over_v,
                dc_under: self.limits.dc_under_v,
                rotor_step: turns_per_step(self.limits.speed_rpm),
                current_squared: self.limits.current_a * self.limits.current_a,
            },
            sequence: SequenceSteps {
                precharge: periods(self.sequence.precharge_s),
                magnetise: periods(self.sequence.magnetise_s),
                i_d: self.sequence.i_d,
                stop_ramp: self.sequence.stop_a_per_s * PERIOD_S,
            },
            designs,
        })
    }

    fn check(&self) -> Result<(), SettingsError> {
        let m = &self.motor;
        check("motor.r_s", m.r_s, 0.001, 1000.0)?;
        check("motor.r_r", m.r_r, 0.001, 1000.0)?;
        check("motor.l_ls", m.l_ls, 1e-6, 10.0)?;
        check("motor.l_lr", m.l_lr, 1e-6, 10.0)?;
        check("motor.l_m", m.l_m, 1e-5, 100.0)?;
        check("motor.pole_pairs", f32::from(m.pole_pairs), 1.0, 50.0)?;
        check("motor.inertia", m.inertia, 1e-7, 1000.0)?;

        let i = &self.inverter;
        check("inverter.top", f32::from(i.top), 1000.0, 65_534.0)?;
        check("inverter.dead_time_s", i.dead_time_s, 0.0, 6e-6)?;
        check("inverter.full_compensation_a", i.full_compensation_a, 1e-4, 10.0)?;

        let s = &self.scales;
        for (name, line) in [("scales.current_a", s.current_a), ("scales.current_b", s.current_b)] {
            check(name, line.gain, 1e-6, 1.0)?;
            check(name, line.offset, -1000.0, 1000.0)?;
        }
        check("scales.dc_link.gain", s.dc_link.gain, 1e-4, 10.0)?;
        check("scales.dc_link.offset", s.dc_link.offset, -100.0, 100.0)?;
        check("scales.full_scale", f32::from(s.full_scale), 100.0, 65_535.0)?;
        check("scales.current_delay_s", s.current_delay_s, 0.0, 5.0 * PERIOD_S)?;
        check("scales.encoder_counts", s.encoder_counts as f32, 16.0, 1e7)?;

        let inj = &self.injection;
        check("injection.amplitude_v", inj.amplitude_v, 0.0, 150.0)?;
        check("injection.reference_a", inj.reference_a, -1.0, 1.0)?;
        check("injection.full_reference_iq_a", inj.full_reference_iq_a, 0.01, 10.0)?;
        check("injection.k_s", inj.k_s, 0.0, 100.0)?;
        check("injection.z_s", inj.z_s, 0.0, 1.0)?;

        let l = &self.limits;
        let end = 0.5 * f32::from(s.full_scale) * s.current_a.gain;
        check("limits.trip_a", l.trip_a, 0.05, end)?;
        check("limits.current_a", l.current_a, 0.01, l.trip_a)?;
        check("limits.dc_over_v", l.dc_over_v, 10.0, 1000.0)?;
        check("limits.dc_under_v", l.dc_under_v, 5.0, l.dc_over_v)?;
        check("limits.speed_rpm", l.speed_rpm, 1.0, 20_000.0)?;
        check("limits.unexplained_v", l.unexplained_v, 0.1, 1000.0)?;

        let q = &self.sequence;
        check("sequence.calibrate_s", q.calibrate_s, 0.001, 10.0)?;
        check("sequence.precharge_s", q.precharge_s, 0.0, 10.0)?;
        check("sequence.magnetise_s", q.magnetise_s, 0.0, 60.0)?;
        check("sequence.i_d", q.i_d, 0.01, l.current_a)?;
        check("sequence.stop_a_per_s", q.stop_a_per_s, 0.1, 1e5)?;
        check("position.i_q_limit_a", self.position.i_q_limit_a, 0.01, l.current_a)?;
        check("position.guard_rpm", self.position.guard_rpm, 1.0, l.speed_rpm)?;
        Ok(())
    }
}

/// Group delay of the band-pass at 600 Hz, samples: by so much the envelope of the carrier current
/// lags.
const BPF_GROUP_DELAY: f32 = 8.83;
