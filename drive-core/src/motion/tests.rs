use super::*;

/// Range without a limit from outside.
const ANY: (f32, f32) = (f32::MIN, f32::MAX);
use crate::tuning::{SpeedSource, design_motion_loops};
use core::f64::consts::TAU;

/// Acceleration of the motor of Table 5 with 0.012 kg m^2 by 1 A: 26.8 rad/s^2.
const ACCELERATION: f64 = 26.8 / TAU;
const COUNTS: u32 = 10_000;

fn motion(limit: f32, ramp: f32) -> Motion {
    let design = design_motion_loops(ACCELERATION, SpeedSource::Encoder, 60.0, 0.01).unwrap();
    Motion::new(
        &design.gains,
        COUNTS,
        limit,
        &Ramps { usual: ramp, quick: 3.0 * ramp, rise_s: 0.0 },
        3.0,
    )
}

/// Result of a run of a rigid rotor, in f64.
#[derive(Debug, Default)]
struct Done {
    /// Position and speed at the end.
    end: (f64, f64),
    furthest: f64,
    fastest: f64,
    /// Last time at which the position was more than a degree from the end, s.
    settled: f64,
}

/// Runs with a load in A of q-axis current from `load.0` s on, and a motor whose inertia is larger
/// than in the design by the factor `heavier`.
fn run(motion: &Motion, goal: Target, load: (f64, f64), heavier: f64, seconds: f64) -> Done {
    const DT: f64 = 1.0 / 6000.0;
    let mut state = MotionState::default();
    motion.start(&mut state, 77);
    let (mut x, mut v, mut done) = (0.0_f64, 0.0_f64, Done::default());
    for k in 0..(seconds / DT) as u32 {
        let t = f64::from(k) * DT;
        let count = 77_u32.wrapping_add((x * f64::from(COUNTS)) as i64 as u32);
        let i = f64::from(motion.step(&mut state, goal, count, 0.0, ANY));
        let i_load = if t >= load.0 { load.1 } else { 0.0 };
        v += (ACCELERATION * (i - i_load) - 0.08 * v) / heavier * DT;
        x += v * DT;
        done.furthest = done.furthest.max(x);
        done.fastest = done.fastest.max(v);
        if let Target::Position(turns) = goal
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
        let done = run(&motion(limit, ramp), Target::Position(5.0), (9e9, 0.0), heavier, 8.0);
        assert!(done.furthest < 5.0 * 1.01, "{done:?}");
        assert!(done.settled < 3.5, "{done:?}");
    }
}

#[test]
fn speed_is_reached_held_under_load_and_limited() {
    for (goal, limit, end) in [(5.0, 24.0, 5.0), (30.0, 24.0, 24.0)] {
        let motion = motion(limit, 10.0);
        let done = run(&motion, Target::Speed(goal), (4.0, 1.5), 1.0, 6.0);
        assert!((done.end.1 - end).abs() < 0.01, "{done:?}");
        // The overshoot is due to the friction, which was unknown during the acceleration.
        assert!(done.fastest < end * 1.04, "{done:?}");
    }
}

/// For two seconds there is a load that the current cannot hold, then none. The integrator has not
/// wound up, and the speed returns without overshooting the reference by more than a tenth.
#[test]
fn limits_do_not_wind_up() {
    let (motion, mut state) = (motion(24.0, 10.0), MotionState::default());
    let (mut x, mut v, mut most) = (0.0_f64, 5.0_f64, 0.0_f64);
    for k in 0..60_000 {
        let t = f64::from(k) / 6000.0;
        let count = (x * f64::from(COUNTS)) as i64 as u32;
        let i = f64::from(motion.step(&mut state, Target::Speed(5.0), count, 0.0, ANY));
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
        // 0.47 turns per step is about the largest possible; the sum is 4700 turns.
        rotor.follow(Angle::from_turns((f64::from(k) * 0.47 % 1.0) as f32));
    }
    assert!(rotor.count.abs_diff(4700 * Motion::COUNTS_PER_TURN) <= 1, "{rotor:?}");
    for k in (0..=20_000).rev() {
        rotor.follow(Angle::from_turns(((f64::from(k) - 10_000.0) * 0.47 % 1.0) as f32));
    }
    assert!((rotor.count as i32 + 4700 * Motion::COUNTS_PER_TURN as i32).abs() <= 1, "{rotor:?}");
}

/// From the speed v with the deceleration a, v^2 / 2 a turns are needed; near the goal k_x e is slower.
#[test]
fn the_braking_curve_ends_at_the_goal() {
    let motion = motion(24.0, 12.0);
    let (a, bend) = (0.5 * f64::from(motion.twice_braking), f64::from(motion.bend));
    assert!((a - 12.0).abs() < 1e-5);
    for error in [1e-4, 0.01, 0.3, 2.0, 50.0] {
        let v = f64::from(motion.braking_curve(error));
        assert!(((v * v / 2.0 + v * bend) / a / f64::from(error) - 1.0).abs() < 1e-5, "{error}");
        assert_eq!(f64::from(motion.braking_curve(-error)), -v);
    }
    let design = design_motion_loops(ACCELERATION, SpeedSource::Encoder, 60.0, 0.01).unwrap();
    let slope = f64::from(motion.braking_curve(1e-4)) / 1e-4;
    assert!((slope / design.gains.k_x - 1.0).abs() < 1e-3, "{slope}");
}

#[test]
fn turns_are_counted() {
    let mut rotor = RotorCount::default();
    let turns = [0.25, 0.5, 0.75, 0.0, 0.25];
    let counts = turns.map(|turns| rotor.follow(Angle::from_turns(turns)));
    assert_eq!(counts[4], 5 * Motion::COUNTS_PER_TURN / 4);
}
