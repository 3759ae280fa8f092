//! The back-EMF observer of the fundamental wave, beside the injection.

use core::f32::consts::TAU;

use super::Field;
use super::slow_tasks::StepResults;
use crate::flux::hand_over::{Source, Turning};
use crate::{AlphaBeta, AngleLoop, Coefficients, UnitVector};

impl<L: AngleLoop> Coefficients<L> {
    /// Runs one period of the observer and returns the turn of the flux that it estimates. `current` is the measured current without
    /// the expected injection current, `phi` the axis of the flux at the sample.
    pub(super) fn observe_fundamental(
        &self,
        s: &mut Field<L::State>,
        index: usize,
        current: AlphaBeta,
        phi: UnitVector,
    ) -> Turning {
        const PER_RADIAN: f32 = 1.0 / TAU;
        let Some(observer) = &self.observer else { return Turning::default() };
        let state = &mut s.observer;
        let turned = if s.hand_over.advance_blanking() {
            state.skip(current);
            s.hand_over.mean_turn()
        } else {
            observer.step(state, current, phi.turned_by(s.axes.before), s.hand_over.leads);
            state.turned * PER_RADIAN
        };
        s.hand_over.turning(index, turned, state.slip * PER_RADIAN, observer.age)
    }

    /// Whether the angle filter tracks the angle.
    #[inline(never)] // in the flash; inlined at both calls, 232 bytes more of control code
    fn filter_tracks(&self, s: &Field<L::State>, step: &StepResults) -> bool {
        step.trust.rotates
            && self.injects(s)
            && !s.hand_over.leads
            // A flux that still builds up shows no angle.
            && (step.trust.resistance
                || self.observer.as_ref().is_none_or(|observer| observer.has_flux(&s.observer)))
    }

    /// Weighs the speed of the observer for the angle filter.
    pub(super) fn weigh_speed(&self, s: &mut Field<L::State>, step: &StepResults) {
        let Some(observer) = &self.observer else { return };
        let seen = observer.weights(&s.observer, step.rotor_freq);
        self.estimator.run(&mut s.estimator, |filter, state, _| filter.weigh_speed(state, &seen));
    }

    /// Passes the speed that the observer has estimated in the injection period to the angle filter.
    pub(super) fn see_speed(&self, s: &mut Field<L::State>, step: &StepResults) {
        let Some(observer) = &self.observer else { return };
        // If the resistance does not follow the filter, neither does the speed.
        let shows = step.trust.resistance && step.trust.source == Source::Both;
        if shows && observer.has_flux(&s.observer) {
            let (seen, age) = observer.seen_speed(&s.observer, s.hand_over.mean_turn());
            self.estimator.run(&mut s.estimator, |filter, state, axis| {
                // This is the tracked speed at the time of the observed speed.
                let tracked = axis.rotor_freq - axis.acceleration * age;
                filter.see_speed(state, seen - tracked);
            });
        }
    }

    /// Corrects the tracked angle, speed and resistance by the measurements of injection and observer.
    pub(super) fn correct_angle(&self, s: &mut Field<L::State>, step: &StepResults) {
        let filters = self.filter_tracks(s, step);
        if !filters {
            self.reset_filter(s);
        }
        let known = self.freq_per_speed * s.motion.acceleration;
        let resistance = self.estimator.update_correction(&mut s.estimator, filters, known);
        if self.observer.is_some() && filters && step.trust.resistance {
            s.observer.resistance.correct(resistance);
        }
    }

    /// Resets the angle filter.
    pub(super) fn reset_filter(&self, s: &mut Field<L::State>) {
        let deviation = s.observer.resistance.deviation;
        self.estimator.run(&mut s.estimator, |filter, state, _| filter.start(state, deviation));
    }

    /// Decides which source gives the angle.
    pub(super) fn hand_over(&self, s: &mut Field<L::State>, step: &StepResults) {
        if self.observer.is_some() && step.trust.observes() {
            s.hand_over.update(step.flux_freq, step.trust.source, self.observer_leads);
        }
    }

    /// Runs the slow part of the observer.
    pub(super) fn update_observer(&self, s: &mut Field<L::State>, step: &StepResults) {
        let Some(observer) = &self.observer else { return };
        let leads = s.hand_over.leads;
        observer.update(&mut s.observer, step.rotor_freq);
        if leads && s.hand_over.demodulates() && step.trust.resistance {
            let error = s.estimator.angle_error;
            observer.compare_with_injection(&mut s.observer, error, step.flux_freq);
        }
        s.induced = observer.induced(&s.observer, step.flux_freq);
        // The controllers are corrected by the voltage that the feed-forward takes over or gives up, so that the output does not
        // jump.
        let (induced, share) = (s.induced.at(step.reference), f32::from(u8::from(leads)));
        s.current_loop.back_calculate(induced * (s.induced_share - share));
        s.induced_share = share;
    }
}
