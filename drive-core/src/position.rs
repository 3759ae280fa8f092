//! Position loop of section 4.1: a PI controller at 100 Hz that sets the current on the quadrature
//! axis, behind a reference filter (Eq. 4.3), with the over-speed guard of 1440 rpm.
//!
//! # Why not the printed gains
//! The PI of Eq. 4.2 with the plant of Eq. 4.1 is unstable (|z| = 1.046): it was designed as if one
//! of the plant's integrators were not there. A PI alone needs the friction of the plant for its
//! phase, and a motor with good bearings has little. The loop here feeds the measured speed back,
//! `i_q = PI(e) - k_v v`, which gives the plant the shape of Eq. 4.1, `k / ((z - 1)(z - p))`, with a
//! pole `p` that is chosen instead of found; the zero stays where it was printed, 0.974, and the gain
//! puts the crossover at the geometric mean of zero and pole (symmetric optimum), where the phase
//! margin is largest: 51° with the figures of [`Position::new`].

use core::f64::consts::TAU;

use crate::pi::{Pi, PiState, ReferenceFilter, ReferenceState};

/// Control periods per step of the position loop.
pub const DIVIDER: u8 = 60;
/// Zero of the controller and pole of the reference filter, Eq. 4.2 and 4.3.
pub const ZERO: f64 = 0.974;
/// Pole the speed feedback gives the plant.
const SPEED_POLE: f64 = 0.75;

/// Coefficients of the position loop. Positions in mechanical turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Controller, A per turn.
    pub pi: Pi,
    /// Speed feedback, A per (turn per step of the loop).
    pub damping: f32,
    reference: ReferenceFilter,
    turns_per_count: f32,
    /// Guard: beyond this speed no current accelerates further, turns per step of the loop.
    guard: f32,
    /// Largest current, A.
    limit: f32,
}

/// State of the position loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionState {
    pi: PiState,
    filter: ReferenceState,
    origin: u32,
    last: u32,
    phase: u8,
    output: f32,
}

impl Position {
    /// For the acceleration that 1 A gives, mechanical rad/s^2, encoder counts per turn, guard speed
    /// in turns/s, current limit in A and the period of the control, s.
    pub fn new(acceleration: f32, counts: u32, guard: f32, limit: f32, period_s: f32) -> Self {
        let t = f64::from(period_s) * f64::from(DIVIDER);
        // Turns per step, gained in one step by 1 A.
        let gain = f64::from(acceleration) / TAU * t * t;
        let damping = (1.0 - SPEED_POLE) / gain;
        // Crossover at the geometric mean of the zero and the pole of the speed, as frequencies.
        let (w_zero, w_pole) = ((1.0 - ZERO) / t, -libm::log(SPEED_POLE) / t);
        let crossover = libm::sqrt(w_zero * w_pole);
        let a = crossover / w_zero;
        // |L| = 1 with L = k_c w_zero (1 + s/w_zero) / s * 1 / (k_v s (1 + s/w_pole)); the amounts
        // of the two corner terms are sqrt(1 + a^2) and sqrt(1 + 1/a^2), their ratio is a.
        let k_v = damping * t;
        let k_c = k_v * crossover * crossover / (w_zero * a);
        Self {
            pi: Pi { k_c: k_c as f32, z_c: ZERO as f32 },
            damping: damping as f32,
            reference: ReferenceFilter::new(ZERO),
            turns_per_count: 1.0 / counts as f32,
            guard: guard * t as f32,
            limit,
        }
    }

    /// Starts at the encoder's `count`, which becomes position zero, with no current.
    pub fn start(&self, state: &mut PositionState, count: u32) {
        *state = PositionState { origin: count, last: count, ..PositionState::default() };
    }

    /// Position in turns from the start.
    pub fn turns(&self, state: &PositionState, count: u32) -> f32 {
        count.wrapping_sub(state.origin) as i32 as f32 * self.turns_per_count
    }

    /// Called every control period; every 60th time it computes a new current on the quadrature
    /// axis from the `reference` in turns and the encoder's `count`. Returns that current, A.
    pub fn step(&self, state: &mut PositionState, reference: f32, count: u32) -> f32 {
        if state.phase > 0 {
            state.phase -= 1;
            return state.output;
        }
        state.phase = DIVIDER - 1;

        let moved = count.wrapping_sub(state.last) as i32 as f32 * self.turns_per_count;
        state.last = count;
        let error = self.reference.step(&mut state.filter, reference) - self.turns(state, count);
        let wanted = self.pi.step(&mut state.pi, error) - self.damping * moved;
        // Beyond the guard speed: none that accelerates. (The dissertation takes the current away
        // altogether; braking is left in here.)
        let (low, high) = (
            if moved < -self.guard { 0.0 } else { -self.limit },
            if moved > self.guard { 0.0 } else { self.limit },
        );
        let limited = if wanted > high {
            high
        } else if wanted < low {
            low
        } else {
            wanted
        };
        state.pi.realised(limited - wanted);
        state.output = limited;
        limited
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rigid rotor, in f64: 1 A accelerates by 26.8 rad/s^2.
    fn simulate(turns: f32, friction: f64) -> (f64, f64, f64) {
        let position = Position::new(26.8, 10_000, 24.0, 3.0, 1.0 / 6000.0);
        let mut state = PositionState::default();
        position.start(&mut state, 77);
        let (mut x, mut v, mut most, mut fastest, mut settled) = (0.0_f64, 0.0, 0.0_f64, 0.0, 0.0);
        let dt = 1.0 / 6000.0;
        for k in 0..60_000 {
            let count = 77_u32.wrapping_add((x * 10_000.0) as i64 as u32);
            let i = f64::from(position.step(&mut state, turns, count));
            v += (26.8 / TAU * i - friction * v) * dt;
            x += v * dt;
            most = most.max(x / f64::from(turns));
            fastest = f64::max(fastest, v.abs());
            if (x - f64::from(turns)).abs() > 1.0 / 360.0 {
                settled = f64::from(k) * dt;
            }
        }
        (most - 1.0, settled, fastest)
    }

    #[test]
    fn five_turns_without_overshoot() {
        let (overshoot, settled, _) = simulate(5.0, 0.08);
        assert!(overshoot < 0.02, "overshoot {overshoot}");
        assert!(settled < 3.5, "settled after {settled} s");
    }

    #[test]
    fn the_phase_margin_is_the_stated_one() {
        use crate::tuning::{IntegratorLag, pi_response};
        let position = Position::new(26.8, 10_000, 24.0, 3.0, 1.0 / 6000.0);
        let plant =
            IntegratorLag { k: (1.0 - SPEED_POLE) / f64::from(position.damping), p: SPEED_POLE };
        let open = |w: f64| {
            pi_response(f64::from(position.pi.k_c), f64::from(position.pi.z_c), w)
                * plant.response(w)
        };
        let crossover = (1..3000).map(|n| f64::from(n) * 1e-3).find(|&w| open(w).abs() < 1.0);
        let margin = 180.0 + open(crossover.unwrap()).arg_deg();
        assert!((margin - 51.3).abs() < 0.5, "{margin}");
    }

    #[test]
    fn the_guard_holds_the_speed() {
        // 80 turns would take the rotor far beyond 24 turns/s (1440 rpm).
        let (_, _, fastest) = simulate(80.0, 0.08);
        // One step of the loop at full current is 0.13 turns/s.
        assert!((20.0..24.3).contains(&fastest), "{fastest}");
    }

    #[test]
    fn works_from_a_wrapped_count() {
        let position = Position::new(26.8, 10_000, 24.0, 3.0, 1.0 / 6000.0);
        let mut state = PositionState::default();
        position.start(&mut state, u32::MAX - 10);
        assert!((position.turns(&state, 9) - 0.002).abs() < 1e-6);
    }
}
