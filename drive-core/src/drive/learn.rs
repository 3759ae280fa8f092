//! Learning with the shaft locked, as a state of the drive.

use super::Drive;
use crate::carrier::DemodulatorKind;
use crate::drive::coefficients::Coefficients;
use crate::drive::state::State;
use crate::fault::Fault;
use crate::identify::learning::{Learned, LearningAction, LearningSample, Operate, Start, Verdict};
use crate::learned::{Tracked, TrackedLimit};
use crate::math::angle::Angle;
use crate::math::limited;
use crate::settings::{AngleSource, Settings};

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

    /// The torque current to regulate while learning, A; turns the frame behind the flux. At the end an accepted
    /// result replaces the settings, and the drive stops.
    #[cold]
    pub(super) fn learn(&mut self) -> Result<f32, State> {
        let (c, s) = (&self.c, &mut self.control);
        let t = s.seen;
        let saliency = *s.estimator.saliency();
        let signal = if c.learning.normalised { saliency.q } else { s.estimator.delta_i };
        let sample = LearningSample {
            signal,
            carrier_squared: saliency.carrier_squared,
            theta: t.phi + Angle::QUARTER,
            flux_freq: t.flux_freq,
            voltage: t.voltage,
        };
        match c.learning.step(&mut s.learning, &sample) {
            LearningAction::Operate(Operate { i_q, lead }) => {
                let (r, lead) = (&mut self.control.references, Angle::from_radians(lead));
                r.current.q = i_q;
                if lead != r.lead {
                    (r.lead, r.lead_axis) = (lead, lead.unit_vector());
                }
            }
            LearningAction::Moved | LearningAction::Stuck => {
                return Err(Fault::ShaftNotLocked.into());
            }
            LearningAction::Done => {
                self.control.all_measured = true;
                return Err(State::Off);
            }
        }
        Ok(self.control.references.current.q)
    }

    /// Evaluates a learning that has measured all points, with the outputs off: it takes a part of a period, from the
    /// flash. Returns the state to be in.
    #[cold]
    pub(super) fn evaluate_learning(&mut self) -> State {
        let (c, s) = (&self.c, &mut self.control);
        s.all_measured = false;
        let check = c.saliency_check;
        let start = Start {
            looked: check.map(|check| check.mean(&s.saliency_check)),
            per_looked: check.map_or(0.0, |check| check.per_mean()),
            baseline: s.lock.baseline,
        };
        let learned = c.learning.result(&s.learning, &start);
        self.learned = Some(learned);
        match learned.verdict {
            verdict if verdict.is_accepted() => {
                self.c.take(&learned);
                self.changes = self.changes.wrapping_add(1);
                State::Off
            }
            Verdict::SlopeTooSmall | Verdict::LimitTooLow => Fault::SlopeTooSmall.into(),
            _ => Fault::NothingLearned.into(),
        }
    }
}

impl Learned {
    /// Range of torque that a drive with these settings tracks with this result; `None` if it is not accepted, or has no slope.
    pub fn tracked(&self, settings: &Settings) -> Option<Tracked> {
        self.slope.filter(|_| self.verdict.is_accepted())?;
        let (i_d, motor) = (settings.i_d(), &settings.motor);
        let last = self.reference.grid().current(self.points);
        let lost = self.limit_a < last;
        let i_q = self.limit_a.min(settings.i_q_limit_a());
        Some(Tracked {
            i_q,
            torque: i_q * motor.torque_per_ampere(i_d),
            i_d,
            flux: i_d * motor.l_m,
            limit: if lost { TrackedLimit::Slope } else { TrackedLimit::Current },
        })
    }
}

impl Coefficients {
    /// Replaces settings by an accepted result of a learning.
    pub fn take(&mut self, learned: &Learned) {
        if !learned.verdict.is_accepted() {
            return;
        }
        self.estimator.take(learned);
        if let Some(observer) = &mut self.observer {
            observer.take(learned);
        }
        if let Some(monitor) = &mut self.lock_monitor {
            monitor.take(learned);
        }
        if learned.gain_mismatch.accepted {
            self.sensing.correct_mismatch(learned.gain_mismatch.value);
        }
        if learned.slope.is_some() {
            self.saliency_check = self.saliency_check.and_then(|check| check.of_learned(learned));
            self.unlearned = false;
            // With the encoder no slope is needed.
            if self.source == AngleSource::Injection {
                self.protection.i_q = limited(self.protection.i_q, learned.limit_a);
                self.motion.limit_current(learned.limit_a);
            }
        }
    }
}
