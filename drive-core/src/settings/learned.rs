//! What was learned on a motor, kept beside the settings that it was learned with.

use super::Settings;
use crate::learning::{ASYMMETRY, CURRENT_SALIENCY, Fitted, LARGEST_MISMATCH, Learned};
use crate::schedule::POINTS;

impl Settings {
    /// Whether what was learned with `other` set would be learned with these as well.
    #[inline]
    pub fn learns_as(&self, other: &Self) -> bool {
        self.learning_depends_on() == other.learning_depends_on()
    }

    /// All that the reference, the carrier current and the gains depend on when they are learned, and all
    /// that they take the place of.
    #[inline(never)]
    fn learning_depends_on(&self) -> [f32; 25] {
        let (m, i, s) = (&self.motor, &self.inverter, &self.scales);
        let j = &self.injection;
        [
            m.r_s,
            m.r_r,
            m.l_ls,
            m.l_lr,
            m.l_m,
            f32::from(m.pole_pairs),
            f32::from(i.top),
            i.dead_time_s,
            f32::from(u8::from(i.compensate)),
            i.full_compensation_a,
            s.current_a.gain,
            s.current_a.offset,
            s.current_b.gain,
            s.current_b.offset,
            s.dc_link.gain,
            s.dc_link.offset,
            s.current_delay_s,
            f32::from(u8::from(self.ignore_delays)),
            self.sequence.i_d,
            j.amplitude_v,
            f32::from(j.demodulator as u8),
            f32::from(j.printed.rms_samples),
            j.printed.reference_a,
            j.printed.full_reference_iq_a,
            j.synchronous.current_saliency,
        ]
    }
}

/// Whether something kept is what a learning can have found and accepted; the tables know their own
/// bounds.
#[inline]
pub fn is_believable(learned: &Learned) -> bool {
    let within = |fitted: &Fitted, largest: f32| {
        fitted.misfit.is_finite() && (!fitted.accepted || fitted.value.abs() <= largest)
    };
    learned.accepted
        && learned.asymmetry <= ASYMMETRY
        && (1..POINTS).contains(&learned.points)
        && within(&learned.gain_mismatch, LARGEST_MISMATCH)
        && within(&learned.current_saliency, CURRENT_SALIENCY.0)
        && learned.flux_saliency.is_finite()
}

/// What holds after a learning that was accepted, done on a drive that worked with `before`: what it did
/// not find is as it was, and the gains were compared as they were corrected already.
#[inline]
pub fn together(before: Option<&Learned>, found: &Learned) -> Learned {
    let mut learned = *found;
    if let Some(before) = before {
        let gains = before.gain_mismatch;
        if !found.gain_mismatch.accepted {
            learned.gain_mismatch = gains;
        } else if gains.accepted {
            learned.gain_mismatch.value += gains.value;
        }
        if !found.current_saliency.accepted {
            learned.current_saliency = before.current_saliency;
        }
        learned.carrier = found.carrier.or(before.carrier);
    }
    learned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::ReferenceTable;

    fn found() -> Learned {
        Learned {
            reference: ReferenceTable::default(),
            carrier: None,
            points: 13,
            asymmetry: 0.001,
            gain_mismatch: Fitted { value: 0.01, misfit: 0.0, accepted: true },
            current_saliency: Fitted { value: 0.03, misfit: 0.02, accepted: true },
            flux_saliency: -0.035,
            accepted: true,
        }
    }

    #[test]
    fn what_a_learning_depends_on_is_compared_and_nothing_else() {
        let changed = |change: fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.learns_as(&Settings::default())
        };
        let same: [fn(&mut Settings); 6] = [
            |_| {},
            |s| s.motor.inertia = 1.0,
            |s| s.limits.trip_a = 4.0,
            |s| s.angle_source = crate::settings::AngleSource::Encoder,
            |s| s.injection.synchronous.bandwidth_hz = 2.0,
            |s| s.speed.limit_rpm = 100.0,
        ];
        assert!(same.into_iter().all(changed));
        let other: [fn(&mut Settings); 10] = [
            |s| s.motor.r_r = 1.4,
            |s| s.motor.pole_pairs = 3,
            |s| s.inverter.compensate = false,
            |s| s.scales.current_b.gain *= 1.01,
            |s| s.scales.current_delay_s = 0.0,
            |s| s.ignore_delays = true,
            |s| s.sequence.i_d = 0.6,
            |s| s.injection.amplitude_v = 60.0,
            |s| s.injection.demodulator = crate::settings::Tracking::Envelope,
            |s| s.injection.synchronous.current_saliency = 0.02,
        ];
        assert!(!other.into_iter().any(changed));
        // Not-a-number is never the same.
        assert!(!changed(|s| s.motor.r_s = f32::NAN));
    }

    #[test]
    fn a_second_learning_adds_to_the_gains_and_keeps_what_it_does_not_find() {
        let first = found();
        assert_eq!(together(None, &first), first);
        let mut second = found();
        second.gain_mismatch.value = -0.002;
        second.current_saliency.accepted = false;
        let both = together(Some(&first), &second);
        assert!((both.gain_mismatch.value - 0.008).abs() < 1e-6);
        assert_eq!(both.current_saliency, first.current_saliency);
        second.gain_mismatch.accepted = false;
        assert_eq!(together(Some(&first), &second).gain_mismatch, first.gain_mismatch);
    }

    #[test]
    fn what_no_learning_can_have_found_is_not_believed() {
        assert!(is_believable(&found()));
        let spoilt: [fn(&mut Learned); 7] = [
            |l| l.accepted = false,
            |l| l.asymmetry = f32::NAN,
            |l| l.points = 0,
            |l| l.points = 16,
            |l| l.gain_mismatch.value = 0.2,
            |l| l.gain_mismatch.misfit = f32::INFINITY,
            |l| l.current_saliency.value = -0.4,
        ];
        for spoil in spoilt {
            let mut learned = found();
            spoil(&mut learned);
            assert!(!is_believable(&learned), "{learned:?}");
        }
    }
}
