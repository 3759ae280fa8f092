//! Indirect rotor-flux angle from the encoder, Eq. 2.10:
//! `phi = theta_r + (1 / tau_r) ∫ i_q / i_d dt`.
//!
//! Here `i_d` is the magnetising current, which follows the d-axis current with the rotor time constant
//! `tau_r = L_r / r_r`. Both are equal at constant flux, for which the printed form is valid.

use core::f32::consts::TAU;

use crate::carrier::CARRIER_SAMPLES;
use crate::math::limited;
use crate::{Angle, Motor, PERIOD_S};

/// Coefficients of the encoder and the slip.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Indirect {
    /// Electrical angle of one count in units of 2^-32 turn. Its rounding is a relative speed error below
    /// 1e-6 (10 000 counts), equivalent to that much slip.
    bits_per_count: u32,
    /// T / tau_r.
    rate: f32,
    /// T / tau_r of the settings, for [`Self::track_tau_r`].
    nominal_rate: f32,
    /// Lower bound of the magnetising current in the slip, A.
    least: f32,
    /// Share of the newest value in the mean speed.
    smoothing: f32,
    /// Largest plausible movement per period, counts.
    most_counts: i32,
    /// Largest plausible distance the rotor can have moved while the counter stood still, electrical turns.
    missed: f32,
    /// Speed above which a counter that stands still is judged, electrical turns per period.
    judged_from: f32,
}

/// State of the indirect angle.
#[derive(Clone, Copy, Debug, Default)]
pub struct IndirectState {
    last_count: Option<u32>,
    /// Integral of the slip: angle of the flux ahead of the rotor, electrical.
    pub slip: Angle,
    /// Slip frequency, electrical turns per period.
    pub slip_freq: f32,
    /// Magnetising current, A: rotor flux / L_m.
    pub magnetising: f32,
    /// Slip per q-axis current at the present flux, electrical turns per period and A.
    slip_per_ampere: f32,
    /// Mean electrical speed of the rotor, turns per period.
    pub rotor_freq: f32,
    /// `rotor_freq` when the counter last moved.
    moving_freq: f32,
    /// Movement at that speed since then, electrical turns.
    missed: f32,
}

/// Rotor-flux angle and frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FluxAngle {
    /// Electrical angle from phase a at the present sample.
    pub phi: Angle,
    /// Frequency of the flux, electrical turns per period.
    pub freq: f32,
}

impl FluxAngle {
    /// Returns the angle less `lead`, which is the angle of a frame that the flux leads.
    pub fn less(self, lead: Angle) -> Self {
        Self { phi: self.phi - lead, ..self }
    }
}

/// The encoder moved, or stood still, in a way that is impossible for the rotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImplausibleEncoder;

/// Minimum stopping distance from [`JUDGED_FROM`], mechanical turns: 1.4°. A shorter distance would
/// take 2200 rad/s^2, 26 N m on 0.012 kg m^2, several times the torque of such a motor.
const STOPS_WITHIN: f32 = 4e-3;
/// Minimum speed at which a counter that stands still is judged, mechanical turns/s: 100 rpm. Below it,
/// the rotor may have stopped.
const JUDGED_FROM: f32 = 100.0 / 60.0;

/// Accepted range of tau_r relative to the settings; a rotor at 150 °C has 0.65.
pub const TAU_R_LIMITS: [f32; 2] = [0.5, 2.0];
/// Largest change of 1 / tau_r per command, relative to the settings: at ten commands per second a wrong
/// estimate needs 1.5 s for the 30 % of a warm rotor.
pub const TAU_R_STEP: f32 = 0.02;

/// Time constant of the mean speed, s.
const SPEED_FILTER_S: f32 = 5e-3;

impl Indirect {
    /// Creates the orientation for a motor with `counts` of the encoder per mechanical turn, the nominal
    /// magnetising current `i_d`, A, and the `highest` plausible speed, mechanical turns/s.
    pub fn new(motor: &Motor, counts: u32, i_d: f32, highest: f32) -> Self {
        let bits = (u64::from(motor.pole_pairs) << 32) as f64 / f64::from(counts);
        let rate = PERIOD_S / motor.tau_r();
        Self {
            bits_per_count: libm::round(bits) as u32,
            rate,
            nominal_rate: rate,
            least: 0.2 * i_d,
            smoothing: PERIOD_S / SPEED_FILTER_S,
            most_counts: 2 + (highest * PERIOD_S * counts as f32) as i32,
            missed: STOPS_WITHIN * f32::from(motor.pole_pairs),
            judged_from: JUDGED_FROM * f32::from(motor.pole_pairs) * PERIOD_S,
        }
    }

    /// Moves the rotor time constant towards `tau_r`, s, by at most `TAU_R_STEP` of the settings' rate,
    /// and returns the time constant in use now, s. It is not for the control step, since it divides.
    ///
    /// # Errors
    /// The smallest and the largest allowed value, s, when `tau_r` is outside [`TAU_R_LIMITS`].
    #[cold]
    pub fn track_tau_r(&mut self, tau_r: f32) -> Result<f32, [f32; 2]> {
        let limits = TAU_R_LIMITS.map(|factor| factor * PERIOD_S / self.nominal_rate);
        if !(limits[0]..=limits[1]).contains(&tau_r) {
            return Err(limits);
        }
        let most = TAU_R_STEP * self.nominal_rate;
        let change = PERIOD_S / tau_r - self.rate;
        if change.abs() <= most {
            self.rate = PERIOD_S / tau_r;
            return Ok(tau_r);
        }
        self.rate += limited(change, most);
        Ok(PERIOD_S / self.rate)
    }

    /// Returns the flux angle at the present sample from the encoder `count`.
    ///
    /// # Errors
    /// `ImplausibleEncoder` when the counter moved further than the rotor can turn in a period, or stopped
    /// abruptly while the rotor was fast, because a cable or the supply is interrupted.
    pub fn angle(
        &self,
        state: &mut IndirectState,
        count: u32,
    ) -> Result<FluxAngle, ImplausibleEncoder> {
        let moved = count.wrapping_sub(state.last_count.unwrap_or(count)) as i32;
        if moved > self.most_counts || moved < -self.most_counts {
            return Err(ImplausibleEncoder);
        }
        state.last_count = Some(count);
        let moved = Angle::from_bits(moved.wrapping_mul(self.bits_per_count as i32)).to_turns();
        state.rotor_freq += self.smoothing * (moved - state.rotor_freq);
        if moved == 0.0 {
            state.missed += state.moving_freq;
            if state.missed.abs() > self.missed && state.moving_freq.abs() > self.judged_from {
                return Err(ImplausibleEncoder);
            }
        } else {
            (state.missed, state.moving_freq) = (0.0, state.rotor_freq);
        }
        let rotor = Angle::from_bits(count.wrapping_mul(self.bits_per_count) as i32);
        Ok(FluxAngle { phi: rotor + state.slip, freq: state.rotor_freq + state.slip_freq })
    }

    /// Integrates the slip over one control period at the q-axis current `i_q`, A.
    pub fn slip(&self, state: &mut IndirectState, i_q: f32) {
        state.slip_freq = state.slip_per_ampere * i_q;
        state.slip += Angle::within_turn(state.slip_freq);
    }

    /// Updates the magnetising current with the d-axis current `i_d`, A; called once per injection period.
    pub fn magnetise(&self, state: &mut IndirectState, i_d: f32) {
        let i_m =
            state.magnetising + CARRIER_SAMPLES as f32 * self.rate * (i_d - state.magnetising);
        state.magnetising = i_m;
        // NaN propagates to the slip.
        let divisor = if i_m < self.least { self.least } else { i_m };
        state.slip_per_ampere = self.rate * (1.0 / TAU) / divisor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indirect() -> Indirect {
        Indirect::new(&Motor::default(), 10_000, 0.7, 60.0)
    }

    #[test]
    fn a_turn_of_the_rotor_is_two_electrical_turns() {
        let ind = indirect();
        let mut state = IndirectState::default();
        for count in 0..=2500 {
            ind.angle(&mut state, count).unwrap();
        }
        let quarter = ind.angle(&mut state, 2500).unwrap();
        // 2500 counts are a quarter turn, half an electrical turn; the rounding of one count is 1e-10.
        assert!((quarter.phi.to_turns().abs() - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_counter_that_stands_still_while_the_rotor_was_fast_is_refused() {
        let ind = indirect();
        // 8 counts per period are 288 rpm, which is refused after 40 missing counts, five periods.
        // 2 counts per period are 72 rpm, and the rotor may have stopped.
        for (counts, periods) in [(8, Some(5)), (-8, Some(5)), (2, None)] {
            let (mut state, mut count) = (IndirectState::default(), 0_u32);
            for _ in 0..300 {
                count = count.wrapping_add_signed(counts);
                ind.angle(&mut state, count).unwrap();
            }
            let refused = (0..3000).position(|_| ind.angle(&mut state, count).is_err());
            assert_eq!(refused, periods, "{counts}");
        }
    }

    #[test]
    fn slip_integrates_the_ratio_of_the_currents() {
        let ind = indirect();
        let mut state = IndirectState::default();
        // The flux builds up for 10 time constants, then i_q = 2 i_d for 0.1 s.
        for _ in 0..1200 {
            ind.magnetise(&mut state, 0.7);
        }
        for _ in 0..600 {
            ind.slip(&mut state, 1.4);
        }
        let phi = ind.angle(&mut state, 0).unwrap().phi.to_radians();
        assert!((phi - 0.1 * 2.0 / Motor::default().tau_r()).abs() < 1e-3, "{phi}");
    }

    #[test]
    fn a_jump_is_refused_and_a_wrap_is_none() {
        let ind = indirect();
        let mut state = IndirectState::default();
        ind.angle(&mut state, u32::MAX - 3).unwrap();
        ind.angle(&mut state, 3).unwrap();
        assert_eq!(ind.angle(&mut state, 5000), Err(ImplausibleEncoder));
    }

    #[test]
    fn the_rate_is_tracked_in_steps_within_limits() {
        let tau_r = Motor::default().tau_r();
        let rate = |ind: &Indirect| ind.rate / PERIOD_S * tau_r;
        for (target, sign) in [(1.3, 1.0), (0.7, -1.0)] {
            let mut ind = indirect();
            for n in 1..=14 {
                let expected = 1.0 + sign * 0.02 * n as f32;
                let now = ind.track_tau_r(tau_r / target).unwrap();
                assert!(
                    (rate(&ind) - expected).abs() < 1e-5 && (tau_r / now - expected).abs() < 1e-5
                );
            }
            ind.track_tau_r(tau_r / target).unwrap();
            assert_eq!(ind.track_tau_r(tau_r / target), Ok(tau_r / target), "it has arrived");
            assert!((rate(&ind) - target).abs() < 1e-6);
        }
        let mut ind = indirect();
        for beyond in [0.49 * tau_r, 2.01 * tau_r, f32::NAN] {
            let [least, most] = ind.track_tau_r(beyond).unwrap_err();
            assert!((least / tau_r - 0.5).abs() < 1e-5 && (most / tau_r - 2.0).abs() < 1e-5);
        }
        assert_eq!(ind, indirect(), "a refused value changes nothing");
    }

    #[test]
    fn the_flux_turns_with_the_rotor_and_the_slip() {
        let ind = indirect();
        let mut state = IndirectState::default();
        for k in 0..1200_u32 {
            ind.magnetise(&mut state, 0.7);
            ind.slip(&mut state, -1.4);
            let flux = ind.angle(&mut state, 5 * k).unwrap();
            assert_eq!(flux.freq, state.rotor_freq + state.slip_freq);
        }
        // Five counts of 10 000 with two pole pairs are a thousandth of a turn per period.
        assert!((state.rotor_freq - 1e-3).abs() < 1e-6, "{}", state.rotor_freq);
        // The slip is 2 i_d / i_q over tau_r in periods.
        let slip = -2.0 / (Motor::default().tau_r() * 6000.0) / TAU;
        assert!((state.slip_freq / slip - 1.0).abs() < 1e-3, "{}", state.slip_freq);
    }

    #[test]
    fn the_magnetising_current_follows_with_the_rotor_time_constant() {
        let ind = indirect();
        let mut state = IndirectState::default();
        ind.magnetise(&mut state, 0.0);
        ind.slip(&mut state, 1.0);
        // Without flux the slip is computed with a fifth of the magnetising current.
        let slip = 1.0 / (0.2 * 0.7) * PERIOD_S / Motor::default().tau_r() / TAU;
        assert!((state.slip_freq / slip - 1.0).abs() < 1e-5);
        for _ in 0..(600.0 * Motor::default().tau_r()) as u32 {
            ind.magnetise(&mut state, 0.7);
        }
        assert!((state.magnetising / 0.7 - 0.632).abs() < 0.003, "{}", state.magnetising);
    }

    #[test]
    fn the_rotor_turns_no_faster_than_it_can() {
        // 60 turns/s are 100 counts per period; two more are allowed.
        for (counts, possible) in [(102, true), (-102, true), (103, false), (-103, false)] {
            let mut state = IndirectState::default();
            indirect().angle(&mut state, 7).unwrap();
            let moved = indirect().angle(&mut state, 7_u32.wrapping_add_signed(counts));
            assert_eq!(moved.is_ok(), possible, "{counts}");
        }
    }

    #[test]
    fn an_eighth_of_a_turn_is_a_quarter_of_the_flux() {
        // The motor has two pole pairs, 10 000 counts per mechanical turn, 0.7 A, and at most 60 turns/s.
        let indirect = Indirect::new(&Motor::default(), 10_000, 0.7, 60.0);
        let mut state = IndirectState::default();
        // The rotor is an eighth of a mechanical turn further, without slip so far.
        let flux = indirect.angle(&mut state, 1250).unwrap();
        assert!((flux.phi.to_degrees() - 90.0).abs() < 0.01);
        // At standstill, 1250 counts from one period to the next are implausible.
        assert!(indirect.angle(&mut state, 2500).is_err());
    }
}
