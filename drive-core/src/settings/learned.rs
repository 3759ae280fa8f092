//! The settings on which the results of a learning depend.

use super::Settings;

impl Settings {
    /// Whether results learned with the settings `other` are valid for these settings, too.
    pub fn shares_learning_with(&self, other: &Self) -> bool {
        self.learning_depends_on() == other.learning_depends_on()
    }

    /// The settings that the learned reference, carrier current and gains depend on, and those that they
    /// replace.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::DemodulatorKind;
    use crate::settings::AngleSource;

    #[test]
    fn what_a_learning_depends_on_is_compared_and_nothing_else() {
        let changed = |change: fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.shares_learning_with(&Settings::default())
        };
        let same: [fn(&mut Settings); 6] = [
            |_| {},
            |s| s.motor.inertia = 1.0,
            |s| s.limits.trip_a = 4.0,
            |s| s.angle_source = AngleSource::Encoder,
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
            |s| s.injection.demodulator = DemodulatorKind::Envelope,
            |s| s.injection.synchronous.current_saliency = 0.02,
        ];
        assert!(!other.into_iter().any(changed));
        // Not-a-number is never the same.
        assert!(!changed(|s| s.motor.r_s = f32::NAN));
    }
}
