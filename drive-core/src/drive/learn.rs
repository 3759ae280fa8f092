//! Learning with the shaft locked, as a state of the drive.

use super::Drive;
use crate::carrier::DemodulatorKind;
use crate::drive::coefficients::Coefficients;
use crate::drive::state::State;
use crate::fault::Fault;
use crate::flux::estimator::AngleLoop;
use crate::identify::learning::{Learned, LearningAction, LearningSample};
use crate::math::angle::Angle;

impl Drive {
    /// Result of the last learning, used or not; none before the first has ended.
    pub fn learned(&self) -> Option<&Learned> {
        self.learned.as_ref()
    }

    /// The point that is being measured, from 1 on, and the number of points; `None` unless the drive learns.
    pub fn learning_progress(&self) -> Option<(usize, usize)> {
        let learns = self.state == State::Learning;
        learns.then(|| self.c.learning.progress(&self.control.learning))
    }

    pub(super) fn can_learn(&self) -> bool {
        let literal = self.c.estimator.demodulator == DemodulatorKind::Literal;
        self.c.inject && self.c.demodulate && !literal
    }

    /// The torque current to regulate while learning, A. At the end an accepted result replaces the
    /// settings, and the drive stops.
    pub(super) fn learn(&mut self) -> Result<f32, Fault> {
        let (c, s) = (&self.c, &mut self.control);
        let t = s.seen;
        let normalised = matches!(c.estimator.angle_loop, AngleLoop::Pll { .. });
        let saliency = *s.estimator.saliency();
        let signal = if normalised { saliency.q } else { s.estimator.delta_i };
        let sample = LearningSample {
            signal,
            carrier_squared: saliency.carrier_squared,
            theta: t.phi + Angle::QUARTER,
            flux_freq: t.flux_freq,
            voltage: t.voltage,
        };
        match c.learning.step(&mut s.learning, &sample) {
            LearningAction::Current(i_q) => self.control.references.current.q = i_q,
            LearningAction::Moved | LearningAction::Stuck => return Err(Fault::ShaftNotLocked),
            LearningAction::Done => {
                let flux = c.saliency_check.map_or(0.0, |check| check.seen(&s.saliency_check));
                let learned = c.learning.result(&s.learning, normalised, flux, s.lock.baseline);
                self.learned = Some(learned);
                if !learned.accepted {
                    return Err(Fault::NothingLearned);
                }
                self.c.take(&learned);
                self.changes = self.changes.wrapping_add(1);
                self.enter(State::Stopping);
            }
        }
        Ok(self.control.references.current.q)
    }
}

impl Coefficients {
    /// Replaces settings by an accepted result of a learning.
    pub fn take(&mut self, learned: &Learned) {
        if !learned.accepted {
            return;
        }
        let b = learned.current_saliency;
        self.estimator.set_reference(&learned.reference, b.accepted.then_some(b.value));
        if let (Some(monitor), Some(carrier)) = (&mut self.lock_monitor, &learned.carrier) {
            monitor.set_carrier_table(carrier);
        }
        if learned.gain_mismatch.accepted {
            self.sensing.correct_mismatch(learned.gain_mismatch.value);
        }
    }
}
