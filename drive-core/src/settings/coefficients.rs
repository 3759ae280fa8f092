//! From settings to what the control step works with.

use super::{AngleSource, CurrentPlant, PERIOD_S, Settings, SettingsError, Tracking};
use crate::dead_time::DeadTime;
use crate::demodulator::Demodulator;
use crate::estimator::{ConstantReference, Estimator, Method, PrintedReference};
use crate::indirect::Indirect;
use crate::injection::{CARRIER_SAMPLES, Injection};
use crate::inverter_drop::InverterDrop;
use crate::learning::Learning;
use crate::modulation::Modulator;
use crate::pi::{DqPi, Pi, ReferenceFilter};
use crate::plausibility::{Prediction, RotorFlux};
use crate::position::Position;
use crate::saliency_check::SaliencyCheck;
use crate::schedule::Schedule;
use crate::sensing::Sensing;
use crate::tracker::{Pll, Tracker};
use crate::tuning::{self, CurrentLoopDesign, FirstOrder};

/// Group delay of the band-pass at 600 Hz, samples: by so much the envelope of the carrier current
/// lags.
const BPF_GROUP_DELAY: f32 = 8.83;

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
    pub(crate) estimator: Estimator,
    /// The check of a sensorless start, if it is wanted.
    pub(crate) saliency_check: Option<SaliencyCheck>,
    pub(crate) current_loop: DqPi,
    pub(crate) reference_filter: [ReferenceFilter; 2],
    /// Delay of the measured current beside the filter, samples.
    pub(crate) current_lag: f32,
    /// 1 where the delays of the current are compensated, 0 where not.
    pub(crate) lag_share: f32,
    pub(crate) modulator: Modulator,
    pub(crate) dead_time: DeadTime,
    pub(crate) inverter_drop: InverterDrop,
    pub(crate) learning: Learning,
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
            + self.estimator.lag
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

fn periods(seconds: f32) -> u32 {
    libm::roundf(seconds / PERIOD_S) as u32
}

/// Delay, samples, of the envelope of the carrier current behind that of its voltage: the group delay
/// of the plant k / (z - p) at the carrier, less the half sample by which the voltage is held. The
/// angle of the voltage is that of the middle of its period already. 0.053 for the motor of Table 5:
/// left out, it is 0.9° at 600 rpm.
fn carrier_lag(plant: FirstOrder) -> f32 {
    let turn = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
    let (c, s) = (libm::cos(turn), libm::sin(turn));
    let (re, im) = (c - plant.p, s);
    ((1.0 - plant.p * c) / (re * re + im * im) - 0.5) as f32
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
        let rotor_flux = RotorFlux {
            coupled_inductance: m.l_m / m.l_r() * m.l_m,
            t_sec: m.t_sec(),
            period_s: PERIOD_S,
        };
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
            injection: Injection::new(inj.amplitude_v, motor_plant, current_lag),
            saliency_check: self.saliency_check(),
            estimator: self.estimator(
                lag_share,
                current_lag + carrier_lag(motor_plant),
                turns_per_step(self.limits.speed_rpm),
            ),
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
            inverter_drop: InverterDrop::new(
                self.sequence.magnetise_s,
                m.t_sec(),
                PERIOD_S,
                (self.sequence.i_d, self.limits.current_a),
                m.r_r * (m.l_m / m.l_r()) * (m.l_m / m.l_r()),
                m.r_s,
            ),
            learning: Learning::new(
                m.t_sec(),
                PERIOD_S,
                (self.sequence.i_d, self.limits.current_a),
                (m.l_ls + m.l_m - rotor_flux.coupled_inductance, rotor_flux.coupled_inductance),
            ),
            prediction: Prediction::new(motor_plant, rotor_flux, self.limits.unexplained_v),
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

    /// Only a sensorless start with the synchronous demodulation is checked.
    fn saliency_check(&self) -> Option<SaliencyCheck> {
        let t = &self.injection.synchronous;
        let checked = t.check
            && self.angle_source == AngleSource::Injection
            && self.injection.demodulator == Tracking::Synchronous;
        checked.then(|| SaliencyCheck::new(t.flux_saliency, self.motor.t_sec(), PERIOD_S))
    }

    /// `carrier_lag` is the delay, samples, from the injection axis to the sampled carrier current.
    fn estimator(&self, lag_share: f32, carrier_lag: f32, speed_limit: f32) -> Estimator {
        let limit = 1.5 * speed_limit;
        let (p, t) = (&self.injection.printed, &self.injection.synchronous);
        let printed = |demodulator| Estimator {
            method: Method::Printed {
                demodulator,
                reference: p.learned.map_or(
                    PrintedReference::Constant(ConstantReference {
                        full: p.reference_a,
                        slope: p.reference_a / p.full_reference_iq_a,
                        from: p.full_reference_iq_a,
                    }),
                    PrintedReference::Learned,
                ),
                tracker: Tracker::new(p.k_s, p.z_s, limit),
            },
            lag: lag_share * (BPF_GROUP_DELAY + carrier_lag),
        };
        match self.injection.demodulator {
            Tracking::Literal => printed(Demodulator::Literal),
            Tracking::Rectified => printed(Demodulator::Rectified),
            Tracking::Synchronous => Estimator {
                method: Method::Synchronous {
                    schedule: Schedule::new(
                        &t.reference,
                        t.flux_saliency,
                        t.current_saliency,
                        self.sequence.i_d,
                    ),
                    pll: Pll::new(t.bandwidth_hz, PERIOD_S, limit),
                },
                lag: lag_share * carrier_lag,
            },
        }
    }
}
