//! The tasks that are due once an injection period. Each of its ten samples does a different task, so that
//! no step takes much longer than another.
//!
//! | sample | task | needs before it |
//! |---|---|---|
//! | 0 | saliency from the averages; magnetising current; count of the rotor by the flux; telemetry; covariance of the filter after the speed; voltage left for the injection; turn of the current for the travel watch | averages, speed (9) |
//! | 1 | torque limit by the dc link; loss minimisation; voltages for the prediction at 3; lock monitor | saliency (0) |
//! | 2 | rotor voltage for the prediction at 3; every sixth time the thermal loads | magnetising current (0) |
//! | 3 | current limits by the voltage; judgement of the prediction | voltages (1), rotor voltage (2) |
//! | 4 | injection signal for the filter, corrections of the tracked angle | saliency (0), speed (9) |
//! | 5 | reference current of the saliency; covariance of the filter after the angles, or its prediction (first part); slow axes | angle (4) |
//! | 6 | gains of the observer; prediction of the filter (second part), or asymmetry; voltages for the prediction at 8 | sums (9) |
//! | 7 | weights of the speed for the filter; rotor voltage for the prediction at 8 | magnetising current (0), gains (6) |
//! | 8 | over-speed; judgement of the prediction | voltages (6), rotor voltage (7) |
//! | 9 | averages of the demodulation; restart of the sums; speed for the filter; injection current in both channels | ten samples mixed, ten turns summed, weights (7) |
//!
//! The travel watch takes a reading in each sample, and the noise watch six: in samples 0 to 2 (channel a) and 7 to 9 (channel b),
//! three consecutive samples each. The reference current is taken in sample 5 ([`REFERENCE_AT`]), so that it is as old as the
//! averages of sample 9.

use super::trust::{Check, Lock, Trust};
use super::{Common, Field, FluxPhase};
use crate::carrier::CARRIER_SAMPLES;
use crate::carrier::synchronous::{AVERAGES_LAG, REFERENCE_AT};
use crate::current::voltage_limit::{OperatingPoint, VoltageLimitState};
use crate::protect::Thermal;
use crate::protect::plausibility::{RotorFlux, Uncertainty};
use crate::{
    AlphaBeta, AngleLoop, AngleSource, Coefficients, Dq, Fault, Limiting, Measured, UnitVector,
};

/// Sample after which a command is executed. Its tasks and the command together take less time than the longest sample.
pub(super) const COMMANDS_BEHIND: usize = 8;

/// Results of the step that the tasks use in addition to the state. Frequencies are in electrical turns per period.
pub(super) struct StepResults<'a> {
    pub measured: &'a Measured,
    /// The measured current in the stator frame, A.
    pub current: AlphaBeta,
    /// Current that determines flux and slip, A.
    pub flux_current: Dq,
    /// Filtered current reference, A.
    pub reference: Dq,
    /// Voltage without the injection, V.
    pub voltage: Dq,
    /// Injection axis at the time when the injection current flowed that is sampled now.
    pub carrier_axis: UnitVector,
    /// Flux axis at the time when the filtered current flowed.
    pub flux_axis: UnitVector,
    /// Frequency of the flux.
    pub flux_freq: f32,
    /// Electrical speed of the rotor.
    pub rotor_freq: f32,
    pub trust: Trust,
}

impl<L: AngleLoop> Coefficients<L> {
    /// Runs the task of sample `index` of the injection period, which is counted with or without injection.
    ///
    /// # Errors
    /// The fault that a check finds.
    pub(super) fn run_slot(
        &self,
        s: &mut Field<L::State>,
        k: &mut Common,
        index: usize,
        step: &StepResults,
    ) -> Result<(), Fault> {
        if let FluxPhase::Ready(travel) = &mut s.flux {
            self.travel_watch.step(travel, index, &step.measured.phases)?;
        }
        match index {
            0 => {
                self.estimator.update_saliency(&mut s.estimator, step.carrier_axis, step.flux_freq);
                self.indirect.magnetise(&mut s.indirect, step.flux_current.d);
                if self.source == AngleSource::Injection {
                    k.rotor_count = s.count_by_flux();
                }
                self.show(s, k);
                s.estimator.filter.reduce();
                if let FluxPhase::Ready(travel) = &mut s.flux {
                    let change = (step.reference.d, s.estimator.filter.moved);
                    self.travel_watch.see_turn(travel, step.current, step.flux_freq, change);
                }
                self.check_headroom(s, step)?;
                self.watch_noise(s, 0, step.measured)
            }
            1 => {
                self.limit_torque(s, k, step);
                if self.voltage_limit.minimises_loss() {
                    self.minimise_loss(s, k, step);
                }
                s.prediction.latch_voltage();
                self.check_lock(s, step)?;
                self.watch_noise(s, 1, step.measured)
            }
            2 => {
                if k.elapsed % Thermal::EVERY >= Thermal::EVERY - CARRIER_SAMPLES as u32 {
                    self.load(k, step.measured, true)?;
                }
                self.predict(s, step);
                self.watch_noise(s, 2, step.measured)
            }
            3 => {
                self.limit_voltage(s, k, step);
                self.judge(s, step)
            }
            4 => {
                self.correct_angle(s, step);
                Ok(())
            }
            REFERENCE_AT => {
                // The rotor is also counted here. Two counts are less than half a turn apart up to 600 Hz, so the direction is
                // unambiguous.
                s.count_by_flux();
                s.estimator.synchronous.average_reference(step.reference.q);
                self.estimator.run(&mut s.estimator, |filter, state, _| filter.turn(state));
                self.hand_over(s, step);
                let silent = s.hand_over.is_carrier_off();
                self.turn(&mut s.axes, step.flux_freq, k.references.injection_axis, silent);
                Ok(())
            }
            6 => {
                self.update_observer(s, step);
                let decay = s.observer.resistance.decay;
                self.estimator
                    .run(&mut s.estimator, |filter, state, _| filter.predict(state, decay));
                if !s.estimator.filter.predicts {
                    self.follow_asymmetry(s, step.carrier_axis, step.flux_freq);
                }
                s.prediction.latch_voltage();
                Ok(())
            }
            7 => {
                s.estimator.filter.follow(step.reference.q, s.indirect.slip_freq);
                self.weigh_speed(s, step);
                self.predict(s, step);
                self.watch_noise(s, 3, step.measured)
            }
            8 => {
                if step.rotor_freq.abs() > self.protection.rotor_freq {
                    return Err(Fault::OverSpeed);
                }
                self.judge(s, step)?;
                self.watch_noise(s, 4, step.measured)
            }
            _ => {
                s.estimator.synchronous.average();
                self.see_speed(s, step);
                self.check_channels(s, step)?;
                self.watch_noise(s, 5, step.measured)
            }
        }
    }

    /// Takes one of the six readings of the noise of the current sensors.
    fn watch_noise(
        &self,
        s: &mut Field<L::State>,
        look: usize,
        measured: &Measured,
    ) -> Result<(), Fault> {
        match &self.noise_watch {
            Some(watch) => watch.step(&mut s.noise, look, measured, s.hand_over.judges_noise()),
            None => Ok(()),
        }
    }

    /// Computes the rotor voltage for the next check of the current against the voltage.
    fn predict(&self, s: &mut Field<L::State>, step: &StepResults) {
        // If the motor saturates, a weakened flux is larger than the current model says, and the observer measures it.
        let magnetising = match &self.observer {
            Some(observer) if step.trust.observes() => observer.magnetising(&s.observer),
            _ => s.indirect.magnetising,
        };
        let flux = RotorFlux {
            magnetising,
            rotor_freq: step.rotor_freq,
            // During self-commissioning the flux leads the frame.
            axis: step.flux_axis.turned_by(s.lead_axis),
            flux_freq: step.flux_freq,
        };
        self.prediction.predict(&mut s.prediction, &flux);
    }

    /// Limits the currents by the voltage of the dc link.
    fn limit_voltage(&self, s: &Field<L::State>, k: &mut Common, step: &StepResults) {
        let carrier = self.inject && !s.hand_over.is_carrier_off();
        let taken = if carrier { s.carrier.share * self.injection.amplitude } else { 0.0 };
        let largest = self.modulator.circle(step.measured.dc_link) - taken;
        let now = OperatingPoint {
            current: step.reference,
            voltage: step.voltage,
            largest,
            flux_freq: step.flux_freq,
            kept: carrier,
            added: k.limits.now.flux_a,
        };
        self.voltage_limit.step(&mut k.limits.voltage, &now);
    }

    /// Sets the d-axis current of the least loss.
    #[cold] // in the flash
    fn minimise_loss(&self, s: &Field<L::State>, k: &mut Common, step: &StepResults) {
        let carrier = self.inject && !s.hand_over.is_carrier_off();
        let i_d = &mut k.references.current.d;
        *i_d = self.voltage_limit.least_loss(*i_d, step.reference.q, carrier);
    }

    /// Limits the q-axis current by dc link, heat sink, motor and inverter.
    fn limit_torque(&self, s: &Field<L::State>, k: &mut Common, step: &StepResults) {
        let VoltageLimitState { most, by_voltage, .. } = k.limits.voltage;
        let why = if by_voltage { Limiting::Voltage } else { Limiting::None };
        self.limit_by_dc_link(&mut k.limits, step.measured.dc_link, step.rotor_freq, (most.q, why));
        self.limit_power(k, s.indirect.magnetising, s.inverter_drop.volts);
    }

    /// Whether there is an injection to be demodulated.
    pub(super) fn injects(&self, s: &Field<L::State>) -> bool {
        self.inject && s.hand_over.demodulates()
    }

    /// Checks the current against the voltage.
    fn judge(&self, s: &mut Field<L::State>, step: &StepResults) -> Result<(), Fault> {
        let trust = &step.trust;
        if !trust.mean_voltage {
            // The inverter voltage error may also be unknown.
            s.prediction.forget_mean();
        }
        let tracked = self.observer.is_some() && trust.observes();
        let building = trust.current != Check::Narrow;
        let known = Uncertainty { deviation: s.observer.resistance.now, tracked, building };
        let judged = self.prediction.judge(&mut s.prediction, step.current, known);
        if trust.current == Check::Off {
            s.prediction.forget();
            return Ok(());
        }
        judged
    }

    /// Checks that the tracked angle is the angle of the flux.
    #[inline(never)] // inlined, 56 bytes more of control code
    fn check_lock(&self, s: &mut Field<L::State>, step: &StepResults) -> Result<(), Fault> {
        let Some(monitor) = &self.lock_monitor else { return Ok(()) };
        let lock = step.trust.lock;
        if lock == Lock::Off || !(self.injects(s) && s.carrier.is_settled()) {
            return Ok(());
        }
        let baseline = lock == Lock::Baseline || !s.lock.is_measured();
        let seen = s.estimator.synchronous.saliency;
        monitor.step(&mut s.lock, &seen, s.carrier.per_share_squared, baseline)
    }

    /// Follows a change of the asymmetry, with the injection axis and the frequency of the flux in this sample.
    #[inline(never)] // in the flash: in the control memory it takes 376 bytes
    fn follow_asymmetry(&self, s: &mut Field<L::State>, axis: UnitVector, freq: f32) {
        let Some(monitor) = &self.lock_monitor else { return };
        // The averages are six samples older than in sample 0.
        let axis = axis.turned_slightly(-freq * (AVERAGES_LAG + 6.0));
        s.estimator.changed.follow(monitor.beyond(&mut s.lock), axis, freq);
    }

    /// Checks that both current sensors see the injection current.
    fn check_channels(&self, s: &mut Field<L::State>, step: &StepResults) -> Result<(), Fault> {
        if !self.injects(s) {
            return Ok(());
        }
        let amplitude = s.carrier.share * self.injection.current_amplitude;
        let current = s.estimator.synchronous.carrier_current();
        s.carrier_watch.step(current, step.carrier_axis, amplitude)
    }

    /// Reduces the injection to the voltage that the fundamental leaves.
    fn check_headroom(&self, s: &mut Field<L::State>, step: &StepResults) -> Result<(), Fault> {
        if !self.inject || s.hand_over.is_carrier_off() {
            return Ok(());
        }
        let largest = self.modulator.circle(step.measured.dc_link);
        s.carrier.fit(&self.injection, step.voltage, largest)
    }
}
