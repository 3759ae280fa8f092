//! Saliency self-commissioning with the shaft locked, as a state of the drive.

use super::{Common, Drive, End, Field, FluxPhase, Phase};
use crate::identify::learning::{Learned, LearningSample, Start, Verdict};
use crate::math::limited;
use crate::{Angle, AngleLoop, AngleSource, Coefficients, Fault};

impl<L: AngleLoop> Drive<L> {
    /// Returns the result of the last self-commissioning, accepted or not; none before the first has ended.
    pub fn learned(&self) -> Option<&Learned> {
        self.kept.learned.as_ref()
    }

    /// Returns the number of the point that is being measured, from 1, and the number of points; `None` unless the drive learns.
    pub fn learning_progress(&self) -> Option<(usize, usize)> {
        match &self.phase {
            Phase::Field(Field { flux: FluxPhase::Learn(learning), .. }) => {
                Some(self.c.learning.progress(learning))
            }
            _ => None,
        }
    }

    pub(super) fn can_learn(&self) -> bool {
        self.c.inject && self.c.demodulate && self.c.estimator.angle_loop.tracks()
    }

    /// Evaluates a self-commissioning that has measured all points. The outputs are off, and it takes a part of a
    /// period, from the flash. Returns the fault if the result cannot be used.
    #[cold]
    pub(super) fn evaluate_learning(&mut self) -> Option<Fault> {
        let (c, Phase::Field(field)) = (&self.c, &self.phase) else { return None };
        let FluxPhase::Learn(learning) = &field.flux else { return None };
        let check = c.saliency_check;
        let start = Start {
            looked: check.map(|check| check.mean(&field.saliency_check)),
            per_looked: check.map_or(0.0, |check| check.per_mean()),
            baseline: field.lock.baseline,
            at_start: field.at_start,
            axis: c.injection_axis,
        };
        let learned = c.learning.result(learning, &start);
        self.kept.learned = Some(learned);
        match learned.verdict {
            verdict if verdict.is_accepted() => {
                self.c.take(&learned);
                self.changes = self.changes.wrapping_add(1);
                None
            }
            Verdict::SlopeTooSmall | Verdict::LimitTooLow => Some(Fault::SlopeTooSmall),
            _ => Some(Fault::NothingLearned),
        }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Returns the q-axis current to regulate during self-commissioning, A, and turns the frame behind the flux.
    /// At the end an accepted result replaces the settings, and the drive stops.
    #[cold]
    pub(super) fn learn(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<f32, End> {
        let FluxPhase::Learn(learning) = &mut s.flux else { return Ok(0.0) };
        let saliency = *s.estimator.saliency();
        let signal = if self.learning.normalised {
            saliency.q
        } else {
            self.estimator.delta_i(&s.estimator)
        };
        let sample = LearningSample {
            signal,
            carrier_squared: saliency.carrier_squared,
            theta: k.seen.phi + self.injection_turn,
            flux_freq: k.seen.flux_freq,
            voltage: k.seen.voltage,
        };
        let next = self.learning.step(learning, &sample)?.ok_or(End::Measured)?;
        let lead = Angle::from_radians(next.lead);
        if lead != s.lead {
            (s.lead, s.lead_axis) = (lead, lead.unit_vector());
        }
        if core::mem::replace(&mut k.references.current.q, next.i_q) != next.i_q {
            // The voltage that the flux did not explain belongs to the point before.
            s.prediction.forget_mean();
        }
        Ok(next.i_q)
    }

    /// Replaces settings by an accepted result of a self-commissioning.
    #[cold]
    pub fn take(&mut self, learned: &Learned) {
        if !learned.verdict.is_accepted() {
            return;
        }
        self.estimator.angle_loop.take(learned);
        if let Some(observer) = &mut self.observer {
            observer.take(learned);
        }
        if let Some(monitor) = &mut self.lock_monitor
            && let (Some(carrier), Some(slope)) = (&learned.carrier, &learned.slope)
        {
            monitor.take(carrier, slope, self.estimator.sign);
        }
        if let Some(at_start) = &mut self.at_start {
            at_start.learned = learned.at_start;
        }
        if learned.gain_mismatch.accepted {
            self.front_end.correct_mismatch(learned.gain_mismatch.value);
        }
        if learned.slope.is_some() {
            self.saliency_check = self.saliency_check.and_then(|check| check.of_learned(learned));
            self.unlearned = false;
            // With the encoder no saliency sensitivity is needed.
            if self.source == AngleSource::Injection {
                self.protection.i_q = limited(self.protection.i_q, learned.limit_a);
                self.motion.limit_current(learned.limit_a);
            }
        }
    }
}
