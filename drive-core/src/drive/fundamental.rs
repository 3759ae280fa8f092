//! The observer of the fundamental wave, beside the injection.

use core::f32::consts::TAU;

use super::Field;
use super::in_turn::StepResults;
use super::trust::Trust;
use crate::flux::hand_over::Turning;
use crate::{AlphaBeta, Coefficients, UnitVector};

/// Weight of the observer from which on the injection, less sensitive there, shows the stator resistance.
const COMPARED_FROM: f32 = 0.3;
/// Frequency of the stator up to which the flux shows the stator resistance, turns per period.
const RESISTANCE_UP_TO: f32 = 6.0 * crate::io::PERIOD_S;

impl Coefficients {
    /// One period of the observer; the turn of the flux that it sees. `current` is the measured one without the expected carrier, `phi`
    /// the axis of the flux at the sample.
    pub(super) fn observe_fundamental(
        &self,
        s: &mut Field,
        index: usize,
        trust: &Trust,
        flux_freq: f32,
        current: AlphaBeta,
        phi: UnitVector,
    ) -> Turning {
        const PER_RADIAN: f32 = 1.0 / TAU;
        let Some(observer) = &self.observer else { return Turning::default() };
        let (state, weight) = (&mut s.observer, s.hand_over.weight);
        let turned = if s.hand_over.advance_blanking() {
            state.skip(current);
            s.hand_over.mean_turn()
        } else {
            observer.step(state, current, phi.turned_by(s.axes.before), weight);
            state.turned * PER_RADIAN
        };
        let up_to = if weight == 0.0 { RESISTANCE_UP_TO } else { 0.0 };
        if trust.resistance && flux_freq.abs() < up_to {
            observer.track_resistance(state);
        }
        s.hand_over.turning(index, turned, state.slip * PER_RADIAN, observer.age)
    }

    /// The slow part of the observer.
    pub(super) fn update_observer(&self, s: &mut Field, step: &StepResults) {
        let Some(observer) = &self.observer else { return };
        let weight = s.hand_over.weight;
        observer.update(&mut s.observer, step.rotor_freq);
        if weight > COMPARED_FROM && s.hand_over.demodulates() && step.trust.resistance {
            let error = s.estimator.angle_error;
            observer.compare_with_injection(&mut s.observer, error, weight, step.flux_freq);
        }
        s.induced = observer.induced(&s.observer, step.flux_freq);
        // What another share changes, the controllers have been putting out.
        let induced = s.induced.at(step.reference);
        s.current_loop.back_calculate(induced * (s.induced_share - weight));
        s.induced_share = weight;
    }
}
