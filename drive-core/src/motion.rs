//! Speed and position control: the cascaded loops of section 4.1 around the torque, at 100 Hz, with or
//! without the encoder.
//!
//! ```text
//! position error -> braking curve -> limit -> ramp -> PI on the speed -> limit -> i_q
//! ```
//!
//! The speed mode enters at the limit. The PI controller of Eq. 3.35 is designed by
//! [`design_motion_loops`](crate::tuning::design_motion_loops) for the inertia and for the source of the
//! rotor position; the current for the ramp is fed forward. (The PI on the position of Eq. 4.2 is unstable
//! with the plant of Eq. 4.1, |z| = 1.046: its design ignores one integrator of the plant. A PI on the
//! speed inside a P on the position has the same terms.)
//!
//! # Without the encoder
//! The rotor angle is the flux angle minus the slip integrated since the start:
//! `theta_r = phi - (1/tau_r) ∫ i_q/i_d dt`, Eq. 2.10 solved for the rotor angle. The injection observes
//! the flux but not the rotor, since a cage is rotationally symmetric. A slip error is therefore a speed
//! error, and its integral a position error that nothing corrects. Measured on the simulated motor
//! (experiment `sensorless-position`), mechanical: a step of five turns ends within 8° (ten runs); a
//! position held for a minute drifts by some 10° without load, and under load by 130° per ampere and
//! percent of error of the rotor resistance. Learning the reference of the saliency with the shaft locked
//! removes that error until the rotor temperature changes.
//!
//! The acceleration reference is also fed forward to the tracking loop, which would otherwise lag by the
//! acceleration divided by the square of its natural frequency.

use crate::current::pi::{Pi, PiState};
use crate::math::angle::Angle;
use crate::math::{limited, within};
use crate::tuning::MotionDesign;

/// Control periods per step of the loops: 100 Hz.
pub const DIVIDER: u8 = 60;
/// Counts of [`RotorCount`] per electrical turn.
pub const COUNTS_PER_TURN: u32 = 1 << 16;

/// Largest position reference, mechanical turns: f32 resolves 0.02° there.
pub const LARGEST_POSITION: f32 = 1000.0;

/// Coefficients of the loops. Speeds in mechanical turns/s, positions in mechanical turns.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Largest change of the speed reference per step of the loops, turns/s.
    ramp: f32,
    /// Twice the deceleration of the braking curve, turns/s^2.
    twice_braking: f32,
    /// Speed at which the braking curve changes from linear to square root, turns/s.
    bend: f32,
    /// Largest current, A.
    i_q_limit: f32,
}

/// Reference of the loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Speed, mechanical turns/s.
    Speed(f32),
    /// Position, mechanical turns from the start.
    Position(f32),
}

/// State of the loops.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotionState {
    pi: PiState,
    /// Ramped speed reference, turns/s.
    reference: f32,
    /// Rate of change of the speed reference, turns/s per control period.
    pub acceleration: f32,
    /// Filtered speed of the rotor, turns/s.
    speed: f32,
    /// Speed reference before limit and ramp, turns/s.
    wanted: f32,
    origin: u32,
    last: Option<u32>,
    phase: u8,
    output: f32,
}

impl Motion {
    /// Loops with the controllers of `design` and `counts` of the position per mechanical turn.
    ///
    /// Limits of the references: `speed_limit`, mechanical turns/s; acceleration `ramp`, mechanical
    /// turns/s^2; `i_q_limit`, A.
    pub fn new(
        design: &MotionDesign,
        counts: u32,
        speed_limit: f32,
        ramp: f32,
        i_q_limit: f32,
    ) -> Self {
        let rate = (1.0 / design.period_s) as f32;
        Self {
            pi: Pi { k_c: design.k_c as f32, z_c: design.z_c as f32 },
            forward: rate / design.acceleration as f32,
            turns_per_count: 1.0 / counts as f32,
            rate,
            smoothing: design.smoothing as f32,
            speed_limit,
            position_limit: limited(0.5 * i32::MAX as f32 / counts as f32, LARGEST_POSITION),
            ramp: ramp / rate,
            twice_braking: 2.0 * ramp,
            bend: ramp / design.k_x as f32,
            i_q_limit,
        }
    }

    /// Lowers the largest current to `limit`, A, where it is larger.
    pub fn limit_current(&mut self, limit: f32) {
        self.i_q_limit = limited(self.i_q_limit, limit);
    }

    /// Resets `state` to zero current at the position `count`, which becomes the origin.
    pub fn start(&self, state: &mut MotionState, count: u32) {
        *state = MotionState { origin: count, ..MotionState::default() };
    }

    /// Position in mechanical turns from the start.
    pub fn turns(&self, state: &MotionState, count: u32) -> f32 {
        count.wrapping_sub(state.origin) as i32 as f32 * self.turns_per_count
    }

    /// Returns the quadrature current, A, for the goal at the position `count`; called in every control
    /// period. The current changes every [`DIVIDER`] periods.
    ///
    /// The computation is spread over three periods: speed, speed reference, current.
    ///
    /// `range` is the least and the largest current, A, that is possible now.
    pub fn step(&self, state: &mut MotionState, goal: Goal, count: u32, range: (f32, f32)) -> f32 {
        match state.phase {
            0 => {
                let moved = count.wrapping_sub(state.last.unwrap_or(count)) as i32 as f32;
                state.last = Some(count);
                let speed = moved * self.turns_per_count * self.rate;
                state.speed += self.smoothing * (speed - state.speed);
            }
            1 => {
                state.wanted = match goal {
                    Goal::Speed(speed) => speed,
                    Goal::Position(turns) => self.braking_curve(turns - self.turns(state, count)),
                };
            }
            2 => {
                let change = limited(state.wanted, self.speed_limit) - state.reference;
                let step = limited(change, self.ramp);
                state.reference += step;
                state.acceleration = step * (1.0 / DIVIDER as f32);

                let error = state.reference - state.speed;
                let wanted = self.pi.step(&mut state.pi, error) + self.forward * step;
                state.output = within(limited(wanted, self.i_q_limit), range);
                state.pi.back_calculate(state.output - wanted);
                if state.output != wanted {
                    // The rotor does not accelerate as wanted.
                    state.acceleration = 0.0;
                }
            }
            _ => {}
        }
        state.phase = if state.phase < DIVIDER - 1 { state.phase + 1 } else { 0 };
        state.output
    }

    /// Speed, turns/s, from which the rotor comes to rest over a position `error` in turns: `k_x e` for
    /// small errors, the square root of `2 a e` for large ones, so that the deceleration stays below `a`.
    fn braking_curve(&self, error: f32) -> f32 {
        // sqrt(bend^2 + 2 a |e|) - bend with the sign of e, written without cancellation.
        let square = self.bend * self.bend + self.twice_braking * error.abs();
        self.twice_braking * error / (libm::sqrtf(square) + self.bend)
    }
}

/// Counter of the estimated rotor angle in place of an encoder: [`COUNTS_PER_TURN`] per electrical turn,
/// wrapping.
///
/// ```
/// use drive_core::{Angle, motion::{COUNTS_PER_TURN, RotorCount}};
///
/// let mut rotor = RotorCount::default();
/// let turns = [0.25, 0.5, 0.75, 0.0, 0.25];
/// let counts = turns.map(|turns| rotor.follow(Angle::from_turns(turns)));
/// assert_eq!(counts[4], 5 * COUNTS_PER_TURN / 4);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RotorCount {
    count: u32,
}

impl RotorCount {
    /// Follows the rotor to its present electrical angle, less than half a turn away; returns the count.
    pub fn follow(&mut self, rotor: Angle) -> u32 {
        let now = (rotor.to_bits() >> 16) as u16;
        let moved = now.wrapping_sub(self.count as u16) as i16;
        self.count = self.count.wrapping_add_signed(i32::from(moved));
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No limit but the own.
    const ANY: (f32, f32) = (f32::MIN, f32::MAX);
    use crate::tuning::design_motion_loops;
    use core::f64::consts::TAU;

    /// 1 A accelerates the motor of Table 5 with 0.012 kg m^2 by 26.8 rad/s^2.
    const ACCELERATION: f64 = 26.8 / TAU;
    const COUNTS: u32 = 10_000;

    fn motion(limit: f32, ramp: f32) -> Motion {
        let design = design_motion_loops(ACCELERATION, None, 60.0, 0.01).unwrap();
        Motion::new(&design, COUNTS, limit, ramp, 3.0)
    }

    /// What a rigid rotor, in f64, did in some seconds.
    #[derive(Debug, Default)]
    struct Done {
        /// Position, speed.
        end: (f64, f64),
        furthest: f64,
        fastest: f64,
        /// When it was more than a degree from the end for the last time, s.
        settled: f64,
    }

    /// With a load in A of torque current from `load.0` s on, and a motor whose inertia is `heavier`
    /// than the design's.
    fn run(motion: &Motion, goal: Goal, load: (f64, f64), heavier: f64, seconds: f64) -> Done {
        const DT: f64 = 1.0 / 6000.0;
        let mut state = MotionState::default();
        motion.start(&mut state, 77);
        let (mut x, mut v, mut done) = (0.0_f64, 0.0_f64, Done::default());
        for k in 0..(seconds / DT) as u32 {
            let t = f64::from(k) * DT;
            let count = 77_u32.wrapping_add((x * f64::from(COUNTS)) as i64 as u32);
            let i = f64::from(motion.step(&mut state, goal, count, ANY));
            let i_load = if t >= load.0 { load.1 } else { 0.0 };
            v += (ACCELERATION * (i - i_load) - 0.08 * v) / heavier * DT;
            x += v * DT;
            done.furthest = done.furthest.max(x);
            done.fastest = done.fastest.max(v);
            if let Goal::Position(turns) = goal
                && (x - f64::from(turns)).abs() > 1.0 / 360.0
            {
                done.settled = t;
            }
        }
        Done { end: (x, v), ..done }
    }

    #[test]
    fn five_turns_without_overshoot_whatever_the_limits() {
        for (limit, ramp, heavier) in
            [(24.0, 12.0, 1.0), (24.0, 5.0, 1.0), (5.0, 5.0, 1.0), (5.0, 5.0, 1.5), (5.0, 5.0, 0.7)]
        {
            let done = run(&motion(limit, ramp), Goal::Position(5.0), (9e9, 0.0), heavier, 8.0);
            println!("{limit} turns/s, {ramp} turns/s^2, inertia x{heavier}: {done:?}");
            assert!(done.furthest < 5.0 * 1.01, "{done:?}");
            assert!(done.settled < 3.5, "{done:?}");
        }
    }

    #[test]
    fn speed_is_reached_held_under_load_and_limited() {
        for (goal, limit, end) in [(5.0, 24.0, 5.0), (30.0, 24.0, 24.0)] {
            let motion = motion(limit, 10.0);
            let done = run(&motion, Goal::Speed(goal), (4.0, 1.5), 1.0, 6.0);
            assert!((done.end.1 - end).abs() < 0.01, "{done:?}");
            // The friction it did not know of on the way up.
            assert!(done.fastest < end * 1.04, "{done:?}");
        }
    }

    /// A load that the current cannot hold, for two seconds, then none: the integrator has not wound
    /// up, and the speed comes back without going beyond the reference by more than a tenth.
    #[test]
    fn limits_do_not_wind_up() {
        let (motion, mut state) = (motion(24.0, 10.0), MotionState::default());
        let (mut x, mut v, mut most) = (0.0_f64, 5.0_f64, 0.0_f64);
        for k in 0..60_000 {
            let t = f64::from(k) / 6000.0;
            let count = (x * f64::from(COUNTS)) as i64 as u32;
            let i = f64::from(motion.step(&mut state, Goal::Speed(5.0), count, ANY));
            assert!(i.abs() <= 3.0);
            let i_load = if (2.0..4.0).contains(&t) { 3.4 } else { 0.0 };
            v += ACCELERATION * (i - i_load) / 6000.0;
            x += v / 6000.0;
            if t > 4.0 {
                most = most.max(v);
            }
        }
        assert!((v - 5.0).abs() < 0.01 && most < 5.5, "{v} {most}");
    }

    #[test]
    fn position_works_from_a_wrapped_count() {
        let (motion, mut state) = (motion(5.0, 5.0), MotionState::default());
        motion.start(&mut state, u32::MAX - 10);
        assert!((motion.turns(&state, 9) - 0.002).abs() < 1e-6);
    }

    #[test]
    fn the_rotor_is_counted_over_turns_both_ways() {
        let mut rotor = RotorCount::default();
        for k in 0..=10_000 {
            // 0.47 turns a step, the most there is: 4700 turns.
            rotor.follow(Angle::from_turns((f64::from(k) * 0.47 % 1.0) as f32));
        }
        assert!(rotor.count.abs_diff(4700 * COUNTS_PER_TURN) <= 1, "{rotor:?}");
        for k in (0..=20_000).rev() {
            rotor.follow(Angle::from_turns(((f64::from(k) - 10_000.0) * 0.47 % 1.0) as f32));
        }
        assert!((rotor.count as i32 + 4700 * COUNTS_PER_TURN as i32).abs() <= 1, "{rotor:?}");
    }

    /// v^2 / 2 a turns are needed from v on with the deceleration a; near the goal k_x e is slower.
    #[test]
    fn the_braking_curve_ends_at_the_goal() {
        let motion = motion(24.0, 12.0);
        let (a, bend) = (0.5 * f64::from(motion.twice_braking), f64::from(motion.bend));
        assert!((a - 12.0).abs() < 1e-5);
        for error in [1e-4, 0.01, 0.3, 2.0, 50.0] {
            let v = f64::from(motion.braking_curve(error));
            assert!(
                ((v * v / 2.0 + v * bend) / a / f64::from(error) - 1.0).abs() < 1e-5,
                "{error}"
            );
            assert_eq!(f64::from(motion.braking_curve(-error)), -v);
        }
        let design = design_motion_loops(ACCELERATION, None, 60.0, 0.01).unwrap();
        let slope = f64::from(motion.braking_curve(1e-4)) / 1e-4;
        assert!((slope / design.k_x - 1.0).abs() < 1e-3, "{slope}");
    }
}
