//! Range check of every setting.

use super::{AngleSource, Settings, SettingsError};
use crate::carrier::DemodulatorKind;
use crate::carrier::demodulator::{MAX_RMS_SAMPLES, MIN_RMS_SAMPLES};
use crate::io::PERIOD_S;

/// The first value outside its range.
#[derive(Default)]
struct Ranges(Option<SettingsError>);

impl Ranges {
    fn check(&mut self, name: &'static str, value: f32, min: f32, max: f32) {
        // NaN fails the comparison.
        let inside = value >= min && value <= max;
        if !inside && self.0.is_none() {
            self.0 = Some(SettingsError::Range { name, value, min, max });
        }
    }
}

impl Settings {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`SettingsError::Range`] with the first value outside its range.
    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        let mut ranges = Ranges::default();
        let mut check = |name, value, min, max| ranges.check(name, value, min, max);
        let m = &self.motor;
        check("motor.r_s", m.r_s, 0.001, 1000.0);
        check("motor.r_r", m.r_r, 0.001, 1000.0);
        check("motor.l_ls", m.l_ls, 1e-6, 10.0);
        check("motor.l_lr", m.l_lr, 1e-6, 10.0);
        check("motor.l_m", m.l_m, 1e-5, 100.0);
        check("motor.pole_pairs", f32::from(m.pole_pairs), 1.0, 50.0);
        check("motor.inertia", m.inertia, 1e-7, 1000.0);

        let i = &self.inverter;
        check("inverter.top", f32::from(i.top), 1000.0, 65_534.0);
        check("inverter.dead_time_s", i.dead_time_s, 0.0, 6e-6);
        check("inverter.full_compensation_a", i.full_compensation_a, 1e-4, 10.0);

        let s = &self.scales;
        for (name, line) in [("scales.current_a", s.current_a), ("scales.current_b", s.current_b)] {
            check(name, line.gain, 1e-6, 1.0);
            check(name, line.offset, -1000.0, 1000.0);
        }
        check("scales.dc_link.gain", s.dc_link.gain, 1e-4, 10.0);
        check("scales.dc_link.offset", s.dc_link.offset, -100.0, 100.0);
        check("scales.full_scale", f32::from(s.full_scale), 100.0, 65_535.0);
        check("scales.current_delay_s", s.current_delay_s, 0.0, 5.0 * PERIOD_S);
        check("scales.encoder_counts", s.encoder_counts as f32, 16.0, 1e7);

        let inj = &self.injection;
        // The lock monitor needs a carrier.
        let watched = self.angle_source == AngleSource::Injection
            && inj.demodulator == DemodulatorKind::Synchronous
            && inj.synchronous.monitor;
        let least = if watched { 1.0 } else { 0.0 };
        check("injection.amplitude_v", inj.amplitude_v, least, 150.0);
        let t = &inj.printed;
        check("injection.reference_a", t.reference_a, -1.0, 1.0);
        check("injection.full_reference_iq_a", t.full_reference_iq_a, 0.01, 10.0);
        check("injection.k_s", t.k_s, 0.0, 100.0);
        check("injection.z_s", t.z_s, 0.0, 1.0);
        let (shortest, longest) = (f32::from(MIN_RMS_SAMPLES), f32::from(MAX_RMS_SAMPLES));
        check("injection.rms_samples", f32::from(t.rms_samples), shortest, longest);
        let t = &inj.synchronous;
        check("injection.bandwidth_hz", t.bandwidth_hz, 0.1, 30.0);
        // Near zero the loop would have no gain. With a positive value the current-dependent part would
        // oppose the flux-fixed part.
        check("injection.flux_saliency", t.flux_saliency, -0.3, -0.001);
        check("injection.current_saliency", t.current_saliency, -0.3, 0.3);
        check("injection.allowed_loss", t.allowed_loss, 0.3, 0.9);
        check("injection.loss_s", t.loss_s, 0.01, 1.0);
        check("injection.tracked_rpm", t.tracked_rpm, 1.0, 20_000.0);

        let l = &self.limits;
        // The smaller end of both sensor ranges: a trip level beyond it would never be reached.
        let end = [s.current_a, s.current_b]
            .into_iter()
            .fold(f32::MAX, |end, line| end.min(-line.offset).min(line.at(s.full_scale)));
        check("limits.trip_a", l.trip_a, 0.05, end);
        check("limits.current_a", l.current_a, 0.01, l.trip_a);
        check("limits.dc_over_v", l.dc_over_v, 10.0, 1000.0);
        check("limits.dc_under_v", l.dc_under_v, 5.0, l.dc_over_v);
        check("limits.speed_rpm", l.speed_rpm, 1.0, 20_000.0);
        check("limits.unexplained_v", l.unexplained_v, 0.1, 1000.0);

        let q = &self.sequence;
        check("sequence.calibrate_s", q.calibrate_s, 0.001, 10.0);
        check("sequence.precharge_s", q.precharge_s, 0.0, 10.0);
        // The lock monitor measures its baseline during magnetisation; with the saliency check also while
        // the flux is restored.
        let needs_baseline = watched && !inj.synchronous.check;
        check("sequence.magnetise_s", q.magnetise_s, if needs_baseline { 0.5 } else { 0.0 }, 60.0);
        check("sequence.i_d", q.i_d, 0.01, l.current_a);
        check("sequence.stop_a_per_s", q.stop_a_per_s, 0.1, 1e5);

        let v = &self.speed;
        check("speed.i_q_limit_a", v.i_q_limit_a, 0.01, l.current_a);
        check("speed.limit_rpm", v.limit_rpm, 1.0, l.speed_rpm);
        check("speed.ramp_rpm_per_s", v.ramp_rpm_per_s, 1.0, 1e5);
        // Below 45° the position loop, with some 12° less, rings; the zero allows 76° at most.
        check("speed.phase_margin_deg", v.phase_margin_deg, 45.0, 70.0);
        ranges.0.map_or(Ok(()), Err)
    }
}
