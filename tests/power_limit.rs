//! Procedure: dc current and power at their limits, by the current that the plant takes from its dc link.

use crate::common::config;
use drive_core::{Command, Limiting, Mode, State};
use hil_sim::plant::Load;
use hil_sim::rig::{RATE_HZ, Rig};

/// Statistics over a window of time.
#[derive(Debug, Default)]
struct Seen {
    /// Mean current from the dc link, A.
    mean_a: f64,
    /// Largest and smallest mean over 20 ms, A.
    most_a: f64,
    least_a: f64,
    /// Share of the time in which the power is the limiting factor.
    limited: f64,
    /// Mean, largest and smallest reference of the q-axis current, A.
    i_q: f64,
    i_q_most: f64,
    i_q_least: f64,
}

fn watch(rig: &mut Rig, seconds: f64) -> Seen {
    let (n, short) = (seconds * RATE_HZ, 0.02 * RATE_HZ);
    let mut seen = Seen {
        most_a: f64::MIN,
        least_a: f64::MAX,
        i_q_most: f64::MIN,
        i_q_least: f64::MAX,
        ..Seen::default()
    };
    let mut sum = 0.0;
    for k in 1..=n as u32 {
        rig.step();
        let amperes = rig.plant.dc_current(1.0 / RATE_HZ);
        sum += amperes / short;
        seen.mean_a += amperes / n;
        if k % short as u32 == 0 {
            (seen.most_a, seen.least_a) = (seen.most_a.max(sum), seen.least_a.min(sum));
            sum = 0.0;
        }
        seen.limited += f64::from(u8::from(rig.drive.limiting() == Limiting::Power)) / n;
        let i_q = f64::from(rig.drive.telemetry().reference.q);
        seen.i_q += i_q / n;
        (seen.i_q_most, seen.i_q_least) = (seen.i_q_most.max(i_q), seen.i_q_least.min(i_q));
    }
    seen
}

/// A drive that regulates torque while a dynamometer holds the speed.
fn driven(changes: &[&str], seed: u64, rpm: f64) -> Rig {
    let mut rig = Rig::from_config(&config(changes), seed).unwrap();
    rig.start(Mode::Torque).unwrap();
    rig.bring_to(rpm, 1000, 1e-3).unwrap();
    rig
}

const A: &[&str] = &["load.mode=speed", "sequence.i_d=1.4", "injection.allow_unlearned=yes"];
const M4B: &[&str] = &["plant=m4b", "flux_level=high", "sequence.flux=high", "prepare.learn=yes"];

/// Four quadrants, both models, with the encoder and without. Measured: within 0.5 %.
#[test]
fn the_dc_current_is_within_three_percent_of_its_limits() {
    for (motor, source, seed) in [
        (A, "encoder", 1),
        (A, "injection", 2),
        (A, "injection", 3),
        (M4B, "encoder", 1),
        (M4B, "injection", 2),
    ] {
        for (rpm, motoring, generating) in [(1500.0, 0.8, 0.3), (-900.0, 0.6, 0.12)] {
            let (from, to) = (
                format!("limits.dc_motoring_a={motoring}"),
                format!("limits.dc_generating_a={generating}"),
            );
            let source = format!("angle_source={source}");
            let changes = [motor, &[&from, &to, &source]].concat();
            let mut rig = driven(&changes, seed, rpm);
            for i_q in [3.0_f32, -3.0] {
                rig.command(&Command::Torque(i_q)).unwrap();
                let stepped = watch(&mut rig, 0.5);
                let seen = watch(&mut rig, 0.5);
                let motors = f64::from(i_q) * rpm > 0.0;
                let limit = if motors { motoring } else { -generating };
                let error = seen.mean_a / limit - 1.0;
                let beyond =
                    if motors { stepped.most_a - motoring } else { -stepped.least_a - generating };
                assert_eq!(rig.drive.state(), State::Torque, "{changes:?} {rpm}");
                assert!(
                    error.abs() < 0.03 && seen.limited > 0.99,
                    "{changes:?} {rpm} {i_q}: {seen:?}"
                );
                // There is no chatter, and the step overshoots by less than a tenth.
                assert!(seen.i_q_most - seen.i_q_least < 0.2, "{changes:?} {seen:?}");
                assert!(beyond < 0.1 * limit.abs() + 0.01, "{changes:?} {rpm} {i_q}: {beyond} A");
            }
        }
    }
}

/// The power is held while the speed passes through all quadrants, with the requested torque where the power allows it.
#[test]
fn the_power_is_held_over_all_speeds() {
    let limits = ["limits.motoring_w=150", "limits.generating_w=50", "angle_source=encoder"];
    for i_q in [2.5_f32, -2.5] {
        let mut rig = driven(&[A, &limits].concat(), 1, 0.0);
        rig.command(&Command::Torque(i_q)).unwrap();
        rig.wait(0.1);
        for (from, to) in [(0.0, 1700.0), (1700.0, -1700.0)] {
            for step in 0..100 {
                let at = |n: i32| from + (to - from) * f64::from(n) / 100.0;
                rig.turn(at(step)).unwrap();
                let seen = watch(&mut rig, 0.06);
                let watts = (311.0 * seen.least_a, 311.0 * seen.most_a);
                let case = format!("{i_q} A, {:.0} rpm: {watts:?} W, {:.2} A", at(step), seen.i_q);
                assert_eq!(rig.drive.state(), State::Torque, "{case}");
                assert!(watts.0 > -58.0 && watts.1 < 165.0, "{case}");
                assert!(seen.i_q * f64::from(i_q) > 0.0, "{case}");
                assert!(
                    at(step).abs() > 290.0 || (seen.i_q - f64::from(i_q)).abs() < 0.05,
                    "{case}"
                );
            }
        }
    }
}

/// At rest: if no power may flow back into the link, a position is held against a pulling load, and the shaft yields slowly. A motoring
/// limit that the losses use up leaves no torque; a limit below the need of the d-axis current is refused.
#[test]
fn at_rest_torque_is_not_reversed() {
    let none = [
        "limits.generating_w=0",
        "limits.motoring_w=120",
        "angle_source=encoder",
        "load.mode=free",
    ];
    let mut rig = Rig::from_config(&config(&[&A[1..], &none].concat()), 1).unwrap();
    rig.start(Mode::Speed).unwrap();
    for (torque, rpm) in [(1.0, 0.0), (-1.0, 0.0), (1.0, -60.0), (-1.0, -60.0)] {
        rig.command(&Command::Speed(rpm as f32)).unwrap();
        rig.set_load(Load::Free { torque }).unwrap();
        rig.wait(1.5);
        let found = rig.rpm();
        assert!((found - rpm).abs() < 5.0, "{torque} Nm, {rpm} rpm: {found}");
    }
    let least = 1.5 * 5.4 * 1.4 * 1.4;
    let few = [format!("limits.motoring_w={}", least + 0.1), "angle_source=encoder".into()];
    let changes = [A, &[few[0].as_str(), few[1].as_str()]].concat();
    let mut rig = driven(&changes, 1, 0.0);
    rig.command(&Command::Torque(2.0)).unwrap();
    rig.wait(0.3);
    let seen = watch(&mut rig, 0.5);
    assert!(seen.i_q.abs() < 0.4 && seen.i_q_least > -0.01 && seen.limited > 0.99, "{seen:?}");
    let mut settings = config(A).drive;
    settings.limits.motoring_w = least - 0.1;
    let error = settings.build().unwrap_err().to_string();
    assert!(error.starts_with("limits.motoring_w = 15.7"), "{error}");
}
