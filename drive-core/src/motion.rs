//! Speed and position control: the cascaded loops of section 4.1 around the torque, with or without the encoder.
//!
//! ```text
//! position error -> braking curve -> limit -> ramp -> PI on the speed -> limit -> i_q
//! ```
//!
//! The speed mode enters at the limit. The PI controller of Eq. 3.35 is designed by
//! `tuning::design_motion_loops` of the settings for the inertia and for the source of the
//! rotor position; the current for the ramp is fed forward. (The PI on the position of Eq. 4.2 is unstable
//! with the plant of Eq. 4.1, |z| = 1.046: its design ignores one integrator of the plant. A PI on the
//! speed inside a P on the position has the same terms.)
//!
//! The loops run at 100 Hz with an encoder and with the PII tracking of the dissertation, whose speed is the difference of two
//! counted angles. If angle filter and observer estimate the speed, the loops use that estimate, once an injection period.
//!
//! # Without the encoder
//! The rotor angle is the flux angle minus the slip integrated since the start:
//! `theta_r = phi - (1/tau_r) ∫ i_q/i_d dt`, Eq. 2.10 solved for the rotor angle. The injection observes
//! the flux but not the rotor, since a cage is rotationally symmetric. A slip error is therefore a speed
//! error, and its integral a position error that nothing corrects. Measured on the simulated motor
//! (experiment `sensorless-position`), mechanical: a step of five turns ends within 8° (ten runs). A
//! position held for a minute drifts by about 10° without load, and under load by 130° per ampere and
//! percent of error of the rotor resistance. The saliency self-commissioning with the shaft locked
//! removes that error until the rotor temperature changes.
//!
//! The acceleration reference is also fed forward to the tracking loop, which would otherwise lag by the
//! acceleration divided by the square of its natural frequency.

pub mod ramp;
#[cfg(test)]
mod tests;

use crate::current::{Pi, PiState};
use crate::math::{limited, within};
use crate::{Angle, PERIOD_S};

use ramp::{Ramp, RampState};

/// Largest position reference, mechanical turns: f32 resolves 0.02° there.
pub const LARGEST_POSITION: f32 = 1000.0;
/// Speed below which the shaft counts as at rest, if it lasts 0.1 s, mechanical turns/s: 12 rpm, which is above the noise
/// without an encoder.
const REST: f32 = 0.2;

/// Controllers of speed and position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionGains {
    /// Gain of the PI controller of the speed, A per turn/s.
    pub k_c: f64,
    /// Zero of that controller.
    pub z_c: f64,
    /// Gain of the P controller of the position, turns/s per turn.
    pub k_x: f64,
    /// Acceleration per ampere of q-axis current, mechanical turns/s^2.
    pub acceleration: f64,
    /// Share of the newest value in the first-order low-pass of the speed; 1 for none.
    pub smoothing: f64,
    /// Sampling period of the loops, s.
    pub period_s: f64,
}

/// Limits of the change of the speed reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramps {
    /// Acceleration, mechanical turns/s^2.
    pub usual: f32,
    /// Deceleration of a quick stop, at least as large as the usual one, mechanical turns/s^2.
    pub quick: f32,
    /// Time in which the usual acceleration rises and falls, s, except in position mode, in which the braking curve determines it.
    pub rise_s: f32,
}

/// Coefficients of the loops. Speeds are in mechanical turns/s, positions in mechanical turns.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// Speed controller, A per turn/s.
    pub pi: Pi,
    /// Feed-forward current for a change of the speed reference, A per turn/s in one step of the loops.
    forward: f32,
    turns_per_count: f32,
    /// Steps of the loops per second.
    rate: f32,
    /// Share of the newest value in the low-pass of the speed.
    smoothing: f32,
    /// Largest speed reference, turns/s.
    pub speed_limit: f32,
    /// Largest position reference, turns.
    pub position_limit: f32,
    /// Change of the speed reference per change of the current in the same step, turns/s per A.
    per_change: f32,
    /// Ramps of the speed reference, turns/s per step of the loops, with limited jerk and without.
    ramp: Ramp,
    straight_ramp: Ramp,
    /// Ramp of a quick stop.
    quick_ramp: Ramp,
    /// Twice the deceleration of the braking curve, turns/s^2.
    twice_braking: f32,
    /// Speed at which the braking curve changes from linear to square root, turns/s.
    bend: f32,
    /// Largest current, A.
    i_q_limit: f32,
    /// Control periods per step of the loops. If a step is an injection period, the speed is estimated, otherwise counted.
    divider: u8,
    /// Number of steps in 0.1 s.
    rest_steps: u8,
}

/// Reference of the loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Speed, mechanical turns/s.
    Speed(f32),
    /// Position, mechanical turns from the start.
    Position(f32),
    /// Braking to rest. The reference waits if the current cannot brake the rotor as fast.
    Rest {
        /// Whether by the ramp of a quick stop.
        quick: bool,
    },
}

/// State of the loops.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotionState {
    pi: PiState,
    /// Speed reference, turns/s.
    ramp: RampState,
    /// Rate of change of the speed reference, turns/s per control period.
    pub acceleration: f32,
    /// Filtered speed of the rotor, turns/s.
    speed: f32,
    /// Speed reference before limit and ramp, turns/s.
    wanted: f32,
    /// Count at position 0.
    pub(crate) origin: u32,
    last: Option<u32>,
    phase: u8,
    /// Steps of the loops for which the rotor was at rest, up to the steps of 0.1 s.
    rest: u8,
    output: f32,
}

impl Motion {
    /// Control periods per step of the loops with an encoder and with the PII tracking: 100 Hz.
    pub const DIVIDER: u8 = 60;
    /// Control periods per step of the loops with the estimated speed: one injection period.
    pub const ESTIMATED: u8 = 10;
    /// Counts of an estimated rotor position per electrical turn.
    pub const COUNTS_PER_TURN: u32 = 1 << 16;

    /// Creates the loops with the controllers `design` and `counts` of the position per mechanical turn.
    ///
    /// `speed_limit`, mechanical turns/s, `ramps` and `i_q_limit`, A, are the limits of the references.
    pub fn new(
        design: &MotionGains,
        counts: u32,
        speed_limit: f32,
        ramps: &Ramps,
        i_q_limit: f32,
    ) -> Self {
        let rate = (1.0 / design.period_s) as f32;
        let (k_c, forward) = (design.k_c as f32, rate / design.acceleration as f32);
        Self {
            pi: Pi { k_c, z_c: design.z_c as f32 },
            forward,
            per_change: 1.0 / (k_c + forward),
            turns_per_count: 1.0 / counts as f32,
            rate,
            smoothing: design.smoothing as f32,
            speed_limit,
            position_limit: limited(0.5 * i32::MAX as f32 / counts as f32, LARGEST_POSITION),
            ramp: Ramp::new(ramps.usual / rate, ramps.rise_s * rate),
            straight_ramp: Ramp::new(ramps.usual / rate, 0.0),
            quick_ramp: Ramp::new(ramps.quick / rate, 0.0),
            twice_braking: 2.0 * ramps.usual,
            bend: ramps.usual / design.k_x as f32,
            i_q_limit,
            divider: (design.period_s / f64::from(PERIOD_S) + 0.5) as u8,
            rest_steps: (0.1 * rate + 0.5) as u8,
        }
    }

    /// Lowers the largest current to `limit`, A, if it is larger.
    pub fn limit_current(&mut self, limit: f32) {
        self.i_q_limit = limited(self.i_q_limit, limit);
    }

    /// Resets `state` to zero current at the position `count`, which becomes the origin.
    pub fn start(&self, state: &mut MotionState, count: u32) {
        *state = MotionState { origin: count, ..MotionState::default() };
    }

    /// Takes over from any source of the q-axis current `i_q`, A, with the rotor at `count` and `speed`, turns/s. The speed
    /// loop continues from these values, with its present acceleration.
    pub fn take_over(&self, state: &mut MotionState, count: u32, speed: f32, i_q: f32) {
        let step = state.acceleration * f32::from(self.divider);
        *state = MotionState {
            pi: PiState::at_rest(i_q - self.forward * step),
            ramp: RampState { reference: speed, change: step },
            speed,
            wanted: speed,
            // The speed is known up to the last period.
            last: Some(count),
            phase: 1,
            rest: 0,
            output: i_q,
            ..*state
        };
    }

    /// Makes the position `turns` position 0 and returns its count.
    pub fn shift_origin(&self, state: &mut MotionState, turns: f32) -> u32 {
        let counts = (turns / self.turns_per_count) as i32;
        state.origin = state.origin.wrapping_add_signed(counts);
        state.origin
    }

    /// Whether reference and rotor have been at rest for 0.1 s.
    pub fn is_at_rest(&self, state: &MotionState) -> bool {
        state.rest >= self.rest_steps
    }

    /// Returns the position in mechanical turns from the start.
    pub fn turns(&self, state: &MotionState, count: u32) -> f32 {
        count.wrapping_sub(state.origin) as i32 as f32 * self.turns_per_count
    }

    /// Returns the position in which the rotor can come to rest on the braking curve, turns.
    pub fn stopping_point(&self, state: &MotionState, count: u32) -> f32 {
        let braking = state.speed * (state.speed.abs() + 2.0 * self.bend) / self.twice_braking;
        self.turns(state, count) + braking
    }

    /// Returns the q-axis current, A, for the goal at the position `count`; called in every control period. The current changes
    /// once in a step of the loops.
    ///
    /// The computation is spread over three periods: speed, speed reference, current.
    ///
    /// `estimated` is the estimated speed, turns/s, which the loops use without an encoder. `range` is the least and the largest
    /// current, A, that is possible now.
    pub fn step(
        &self,
        state: &mut MotionState,
        goal: Target,
        count: u32,
        estimated: f32,
        range: (f32, f32),
    ) -> f32 {
        match state.phase {
            0 => {
                let moved = count.wrapping_sub(state.last.unwrap_or(count)) as i32 as f32;
                state.last = Some(count);
                let counted = moved * self.turns_per_count * self.rate;
                let speed = if self.divider == Self::ESTIMATED { estimated } else { counted };
                state.speed += self.smoothing * (speed - state.speed);
            }
            1 => {
                state.wanted = match goal {
                    Target::Speed(speed) => speed,
                    Target::Rest { .. } => 0.0,
                    Target::Position(turns) => self.braking_curve(turns - self.turns(state, count)),
                };
            }
            2 => {
                let (ramp, waits) = match goal {
                    Target::Speed(_) => (&self.ramp, false),
                    Target::Position(_) => (&self.straight_ramp, false),
                    Target::Rest { quick: false } => (&self.ramp, true),
                    Target::Rest { quick: true } => (&self.quick_ramp, true),
                };
                let mut step = ramp.step(&mut state.ramp, limited(state.wanted, self.speed_limit));
                let error = state.ramp.reference - state.speed;
                let mut wanted = self.pi.step(&mut state.pi, error) + self.forward * step;
                state.output = within(limited(wanted, self.i_q_limit), range);
                if state.output != wanted {
                    // The rotor does not accelerate as fast as the reference.
                    if waits {
                        // The reference goes back to its previous value at most.
                        let room = if step < 0.0 { (0.0, -step) } else { (-step, 0.0) };
                        let more = within(self.per_change * (state.output - wanted), room);
                        state.ramp.shift(more);
                        wanted += self.pi.revise(&mut state.pi, more) + self.forward * more;
                        step += more;
                    } else {
                        step = 0.0;
                    }
                }
                self.pi.condition(&mut state.pi, state.output - wanted);
                state.acceleration = step * (1.0 / f32::from(self.divider));
                let moves = state.ramp.reference != 0.0 || state.speed.abs() >= REST;
                state.rest =
                    if moves { 0 } else { self.rest_steps.min(state.rest.saturating_add(1)) };
            }
            _ => {}
        }
        state.phase = if state.phase < self.divider - 1 { state.phase + 1 } else { 0 };
        state.output
    }

    /// Returns the speed, turns/s, from which the rotor comes to rest over a position `error` in turns:
    /// `k_x e` for small errors, the square root of `2 a e` for large ones, so that the deceleration
    /// stays below `a`.
    fn braking_curve(&self, error: f32) -> f32 {
        // This is sqrt(bend^2 + 2 a |e|) - bend with the sign of e, written without cancellation.
        let square = self.bend * self.bend + self.twice_braking * error.abs();
        self.twice_braking * error / (fpu_sqrt::sqrtf(square) + self.bend)
    }
}

/// Counter of the estimated rotor angle, which replaces an encoder: [`Motion::COUNTS_PER_TURN`] per electrical
/// turn, wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RotorCount {
    count: u32,
}

impl RotorCount {
    /// Follows the rotor to its present electrical angle, which is less than half a turn away, and returns the count.
    pub fn follow(&mut self, rotor: Angle) -> u32 {
        let now = (rotor.to_bits() >> 16) as u16;
        let moved = now.wrapping_sub(self.count as u16) as i16;
        self.count = self.count.wrapping_add_signed(i32::from(moved));
        self.count
    }
}
