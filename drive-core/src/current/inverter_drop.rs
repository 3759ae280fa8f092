//! Inverter voltage error per phase beyond the dead time, measured at every start.
//!
//! Switching delays and forward voltages add to the dead time and have the sign of the phase current.
//! Uncompensated, they act like a saliency if a phase current is near zero: 1.64 V shift the flux angle by
//! up to 8° there. During magnetisation the current lies on the d axis, first at 3/2 of its final value
//! (which builds the flux up faster), then at the final value:
//!
//! ```text
//! v_d - r_r (L_m/L_r)^2 (i_d - i_m) = r_s i_d + g v_drop
//! ```
//!
//! with the magnetising current i_m and the d component g of the signs of the phase currents (4/3 along the axis
//! of a phase). The means at the two levels give r_s and v_drop, independent of the temperature of the stator. If
//! r_r is off by 30 %, v_drop is off by 0.17 V. If v_drop is known, the lower level alone gives r_s.

use crate::{Dq, Motor, periods};

/// Forcing current relative to the final d-axis current.
const FORCING_FACTOR: f32 = 1.5;
/// Minimum relative forcing current for a measurement.
const LEAST_FORCING_FACTOR: f32 = 1.2;
/// Averaging time of the lower level, at the end of the magnetisation, s.
const AVERAGE_S: f32 = 0.1;
/// Accepted range of the measured stator resistance relative to the setting. Outside it the model does not
/// hold and the result is discarded.
const RESISTANCE: (f32, f32) = (0.5, 2.0);
/// Largest accepted voltage error, as a share of the dc link.
const LARGEST: f32 = 0.05;

/// Coefficients of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct InverterDrop {
    /// Relative forcing current; 1 if the current limit or the time does not allow forcing.
    forced: f32,
    /// Duration of the forcing current, control periods.
    until: u32,
    /// First control period in the average of the lower level.
    from: u32,
    /// Duration of the magnetisation, control periods.
    end: u32,
    /// r_r (L_m/L_r)^2, ohm.
    pub(crate) rotor: f32,
    /// Stator resistance of the settings, ohm.
    r_s: f32,
    /// Voltage error, V, if it need not be measured.
    known: Option<f32>,
}

/// Sums over the periods of one current level.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    voltage: f32,
    current: f32,
    signs: f32,
}

/// State of the measurement.
#[derive(Clone, Copy, Debug, Default)]
pub struct InverterDropState {
    levels: [Level; 2],
    /// Measured voltage error per phase, V; 0 before the measurement and if its result is implausible.
    pub volts: f32,
    /// Whether this start has measured. A later magnetisation during the run finds a flux of unknown direction.
    done: bool,
}

/// Input of the measurement, one per control period of the magnetisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DropSample {
    /// Current in the flux frame, A peak.
    pub current: Dq,
    /// Voltage of the current controller in the flux frame, V peak.
    pub voltage: Dq,
    /// Magnetising current i_m, A.
    pub magnetising: f32,
    /// Signs of the phase currents as a vector in the flux frame.
    pub signs: Dq,
    /// Dc-link voltage, V.
    pub dc_link: f32,
}

impl InverterDrop {
    /// Plans the magnetisation of a motor with the d-axis current `i_d`, A, in `magnetise_s`, s, with currents up to
    /// `largest_a`, A peak.
    pub fn new(motor: &Motor, i_d: f32, magnetise_s: f32, largest_a: f32) -> Self {
        let room = if FORCING_FACTOR * i_d < largest_a { FORCING_FACTOR } else { largest_a / i_d };
        // The flux reaches the value of the lower level when 1 - e^(-t/tau_r) = 1/forced.
        let until_s = motor.tau_r() * libm::logf(room / (room - 1.0));
        let fits = room >= LEAST_FORCING_FACTOR && magnetise_s >= 2.0 * (until_s + AVERAGE_S);
        Self {
            forced: if fits { room } else { 1.0 },
            until: if fits { periods(until_s) } else { 0 },
            from: periods(magnetise_s - AVERAGE_S),
            end: periods(magnetise_s),
            rotor: motor.r_r * (motor.l_m / motor.l_r()) * (motor.l_m / motor.l_r()),
            r_s: motor.r_s,
            known: None,
        }
    }

    /// Returns the coefficients with a known voltage error, V, which is not measured.
    pub fn known(self, volts: Option<f32>) -> Self {
        Self { known: volts, ..self }
    }

    /// Returns the d-axis current in period `elapsed` of the magnetisation, relative to its final value.
    pub fn level(&self, elapsed: u32) -> f32 {
        if elapsed < self.until { self.forced } else { 1.0 }
    }

    /// Processes period `elapsed` of the first magnetisation since the start. The last period computes the voltage error, and returns
    /// the stator resistance relative to the settings if it is plausible.
    #[cold]
    pub fn step(
        &self,
        state: &mut InverterDropState,
        elapsed: u32,
        sample: &DropSample,
    ) -> Option<f32> {
        if state.done {
            return None;
        }
        let [high, low] = &mut state.levels;
        // The current settles in the first half.
        let (level, settles) = if elapsed < self.until {
            (high, 2 * elapsed < self.until)
        } else {
            (low, elapsed < self.from)
        };
        if !settles {
            level.voltage +=
                sample.voltage.d - self.rotor * (sample.current.d - sample.magnetising);
            level.current += sample.current.d;
            level.signs += sample.signs.d;
        }
        if elapsed.saturating_add(1) != self.end {
            return None;
        }
        state.done = true;
        let (volts, ratio) = match self.known {
            Some(volts) => (volts, self.resistance(&state.levels, volts)),
            None => self.solve(&state.levels),
        };
        let (least, most) = RESISTANCE;
        // NaN, the result without a measurement, fails the comparisons.
        let believed = volts.abs() <= LARGEST * sample.dc_link && ratio >= least && ratio <= most;
        state.volts = if believed || self.known.is_some() { volts } else { 0.0 };
        believed.then_some(ratio)
    }

    /// Returns the voltage error, V, and r_s relative to the settings, from two equations; not finite without a
    /// measurement of both levels. Sums replace the means, since the count is a common factor of a row.
    fn solve(&self, [high, low]: &[Level; 2]) -> (f32, f32) {
        let per_determinant = 1.0 / (high.current * low.signs - low.current * high.signs);
        let r_s = (high.voltage * low.signs - low.voltage * high.signs) * per_determinant;
        let volts = (high.current * low.voltage - low.current * high.voltage) * per_determinant;
        (volts, r_s / self.r_s)
    }

    /// Returns r_s relative to the settings, if the voltage error is `volts`.
    fn resistance(&self, [_, low]: &[Level; 2], volts: f32) -> f32 {
        (low.voltage - volts * low.signs) / (low.current * self.r_s)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use crate::PERIOD_S;

    /// Returns the coefficients for the motor of Table 5, magnetised with `i_d` A for 0.8 s.
    fn inverter_drop(i_d: f32, largest_a: f32) -> InverterDrop {
        InverterDrop::new(&Motor::default(), i_d, 0.8, largest_a)
    }

    /// Returns the voltage error found on a motor of `r_s` ohm with an error of `volts`.
    fn found(r_s: f32, volts: f32, i_d: f32, largest: f32) -> f32 {
        magnetised(&inverter_drop(i_d, largest), r_s, volts, i_d).0
    }

    /// Returns the voltage error and the relative resistance found on a motor of `r_s` ohm with an error of `volts`.
    fn magnetised(drop: &InverterDrop, r_s: f32, volts: f32, i_d: f32) -> (f32, Option<f32>) {
        let (tau_r, rotor) = (Motor::default().tau_r(), drop.rotor);
        let mut state = InverterDropState::default();
        let mut magnetising = 0.0;
        for k in 0..4800 {
            let i = drop.level(k) * i_d;
            magnetising += PERIOD_S / tau_r * (i - magnetising);
            let v = r_s * i + rotor * (i - magnetising) + 4.0 / 3.0 * volts;
            let sample = DropSample {
                current: Dq::new(i, 0.0),
                voltage: Dq::new(v, 0.0),
                magnetising,
                signs: Dq::new(4.0 / 3.0, 0.0),
                dc_link: 311.0,
            };
            let ratio = drop.step(&mut state, k, &sample);
            if k == 4799 {
                return (state.volts, ratio);
            }
            assert_eq!(ratio, None);
        }
        unreachable!()
    }

    #[test]
    fn finds_the_drop_whatever_the_resistance() {
        for r_s in [4.0, 5.4, 7.0] {
            for volts in [-1.0, 0.0, 1.64, 5.0] {
                let v = found(r_s, volts, 0.7, 3.5);
                // The sums of f32 go over 700 periods.
                assert!((v - volts).abs() < 0.01, "{r_s} ohm, {volts} V: {v}");
            }
        }
    }

    #[test]
    fn finds_the_resistance_with_the_drop_or_beside_a_known_one() {
        for (r_s, believed) in [(4.0, true), (5.4, true), (7.0, true), (2.6, false), (11.0, false)]
        {
            for known in [None, Some(1.64)] {
                let drop = inverter_drop(0.7, 3.5).known(known);
                let (volts, ratio) = magnetised(&drop, r_s, 1.64, 0.7);
                assert_eq!(ratio.is_some(), believed, "{r_s} ohm");
                if let Some(ratio) = ratio {
                    assert!((ratio - r_s / 5.4).abs() < 0.003, "{r_s} ohm: {ratio}");
                }
                assert!(known.is_none() || volts == 1.64);
            }
        }
        // One level does not distinguish a voltage error from a resistance.
        assert_eq!(magnetised(&inverter_drop(0.7, 0.75), 5.4, 1.64, 0.7).1, None);
    }

    #[test]
    fn what_cannot_be_is_not_used() {
        // The results are implausible: a resistance four times that of the settings, a voltage
        // error above 5 % of the dc link, and no current limit left for a second level.
        assert_eq!(found(21.6, 1.64, 0.7, 3.5), 0.0);
        assert_eq!(found(5.4, 16.0, 0.7, 3.5), 0.0);
        assert_eq!(found(5.4, 1.64, 0.7, 0.75), 0.0);
    }

    #[test]
    fn forcing_leaves_the_flux_where_it_belongs() {
        let drop = inverter_drop(0.7, 3.5);
        let (mut flux, mut k) = (0.0, 0);
        while drop.level(k) > 1.0 {
            flux += PERIOD_S / Motor::default().tau_r() * (drop.level(k) * 0.7 - flux);
            k += 1;
        }
        assert!((flux - 0.7_f32).abs() < 0.002, "{flux}");
    }

    #[test]
    fn it_is_believed_up_to_its_bounds() {
        // The limits are half and twice the 5.4 ohm of the settings, and 5 % of 311 V, 15.55 V, in either direction.
        for (r_s, volts, believed) in [
            (2.8, 1.64, true),
            (2.6, 1.64, false),
            (10.6, 1.64, true),
            (11.0, 1.64, false),
            (5.4, 15.4, true),
            (5.4, 15.7, false),
            (5.4, -15.4, true),
            (5.4, -15.7, false),
        ] {
            let expected = if believed { volts } else { 0.0 };
            let v = found(r_s, volts, 0.7, 3.5);
            assert!((v - expected).abs() < 0.02, "{r_s} ohm, {volts} V: {v}");
        }
    }

    #[test]
    fn the_forcing_level_takes_the_room_there_is() {
        let tau_r = Motor::default().tau_r();
        for (largest_a, level) in [(3.5, 1.5), (0.98, 1.4), (0.9, 1.2857), (0.85, 1.0), (0.83, 1.0)]
        {
            let drop = inverter_drop(0.7, largest_a);
            assert!((drop.level(0) - level).abs() < 1e-3, "{largest_a}");
            let forced = (0..4800).filter(|&k| drop.level(k) > 1.0).count() as f32;
            // The current is forced until 1 - e^(-t/tau_r) = 1/level.
            let expected =
                if level > 1.0 { 6000.0 * tau_r * (level / (level - 1.0)).ln() } else { 0.0 };
            assert!((forced - expected).abs() < 12.0, "{largest_a}: {forced} {expected}");
        }
    }
}
