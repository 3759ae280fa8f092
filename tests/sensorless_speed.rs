//! Procedure: the speed of a free shaft regulated without a position sensor, on the simulated rotor.

use crate::common::{coast, config, plant_settings};
use drive_core::{Command, Mode, State};
use hil_sim::Config;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;

/// A drive that regulates the speed of a free shaft at `rpm`, settled.
fn regulating(config: &Config, seed: u64, rpm: f64) -> Rig {
    let mut rig = Rig::from_config(config, seed).unwrap();
    rig.start(Mode::Speed).unwrap();
    rig.command(&Command::Speed(rpm as f32)).unwrap();
    rig.wait(1.5 + rpm.abs() / 300.0);
    rig
}

const FREE: &str = "load.mode=free";

/// Mean and largest deviation of the true speed, rpm, and the largest angle error, degrees.
fn watch(rig: &mut Rig, rpm: f64, seconds: f64) -> (f64, f64, f64) {
    let [speed, angle] = rig.stats(seconds, |p| [p.speed_rpm - rpm, p.angle_error_deg]);
    (speed.mean(), speed.largest(), angle.largest())
}

#[test]
fn the_rotor_turns_as_asked_for_in_both_directions_and_through_standstill() {
    for (seed, speeds) in
        [(1, [150.0, -150.0, 30.0, 0.0, 300.0]), (2, [-300.0, -30.0, 0.0, 90.0, 5.0])]
    {
        let mut rig = regulating(&config(&[FREE]), seed, 0.0);
        let mut before = 0.0_f64;
        for rpm in speeds {
            rig.command(&Command::Speed(rpm as f32)).unwrap();
            // The ramp of 300 rpm/s, and a second to settle.
            let (.., on_the_way) = watch(&mut rig, rpm, (rpm - before).abs() / 300.0 + 1.0);
            let (mean, most, angle) = watch(&mut rig, rpm, 0.5);
            // Without a load there is no slip error: only noise remains.
            assert!(mean.abs() < 2.0 && most < 6.0, "{rpm} rpm: {mean} {most}");
            assert!(on_the_way < 14.0 && angle < 11.0, "{rpm} rpm: {on_the_way} {angle}");
            before = rpm;
        }
        assert_eq!(rig.drive.state(), State::Speed);
    }
}

/// With a load step of half the largest torque at standstill, forwards and backwards, the lock is kept and the speed returns to within
/// the error of the slip.
#[test]
fn a_load_step_is_carried() {
    for (seed, rpm) in [(11, 0.0), (12, 30.0), (13, -150.0)] {
        let mut rig = regulating(&config(&[FREE]), seed, rpm);
        rig.set_load(Load::Free { torque: 0.6 }).unwrap();
        let (_, dip, angle) = watch(&mut rig, rpm, 1.0);
        // The zero of the controller, at a quarter of the crossover, causes a tail of half a second.
        watch(&mut rig, rpm, 1.0);
        let (mean, ..) = watch(&mut rig, rpm, 1.0);
        // 0.6 Nm on 0.012 kg m^2 are 480 rpm/s; the loop responds with its crossover of 1.4 Hz.
        assert!((10.0..70.0).contains(&dip), "{rpm}: {dip}");
        assert!(mean.abs() < 4.0, "{rpm}: {mean}");
        // The peak of the mean response is 8, and noise adds to it.
        assert!(angle < 12.0, "{rpm}: {angle}");
        assert_eq!(rig.drive.state(), State::Speed);
    }
}

/// The drive has the wrong inertia: half and twice the value that it was designed for.
#[test]
fn the_inertia_need_not_be_known_well() {
    for factor in [0.5, 2.0] {
        let config = config(&[FREE]);
        let mut settings = config.drive;
        settings.inertia = Some(settings.inertia() * factor);
        let mut rig = Rig::new(&plant_settings(&config), &settings, 5).unwrap();
        rig.start(Mode::Speed).unwrap();
        rig.command(&Command::Speed(150.0)).unwrap();
        let (.., angle) = watch(&mut rig, 150.0, 2.0);
        let (mean, most, _) = watch(&mut rig, 150.0, 1.0);
        assert!(
            mean.abs() < 3.0 && most < 15.0 && angle < 15.0,
            "x{factor}: {mean} {most} {angle}"
        );
    }
}

/// The shaft is blocked while a speed is requested: the current stays at its limit, the lock is kept, and the shaft turns when it is
/// released.
#[test]
fn a_blocked_shaft_is_survived() {
    let mut rig = regulating(&config(&[FREE]), 7, 0.0);
    rig.set_load(Load::Locked).unwrap();
    rig.command(&Command::Speed(100.0)).unwrap();
    let (.., angle) = watch(&mut rig, 100.0, 2.0);
    let i_q = rig.drive.telemetry().reference.q;
    assert!(i_q > 2.9 && angle < 15.0, "{i_q} A, {angle} deg");
    rig.set_load(Load::Free { torque: 0.0 }).unwrap();
    rig.wait(2.0);
    let (mean, ..) = watch(&mut rig, 100.0, 1.0);
    assert!(mean.abs() < 3.0, "{mean}");
    assert_eq!(rig.drive.state(), State::Speed);
}

/// The speed mode with the encoder.
#[test]
fn with_the_encoder_the_speed_is_exact() {
    let config = config(&[FREE, "angle_source=encoder", "speed.limit_rpm=1440"]);
    let mut rig = regulating(&config, 3, 600.0);
    rig.set_load(Load::Free { torque: 0.6 }).unwrap();
    let (_, dip, _) = watch(&mut rig, 600.0, 1.0);
    let (mean, most, angle) = watch(&mut rig, 600.0, 0.5);
    // One count in 10 ms is 0.6 rpm.
    assert!(
        dip < 30.0 && mean.abs() < 0.1 && most < 1.0 && angle < 1.0,
        "{dip} {mean} {most} {angle}"
    );
    let truth = rig.rpm();
    assert!((truth - 600.0).abs() < 1.0, "{truth}");
}

/// Half of the rated torque on the free shaft of a motor with saturation at 80 % of its rated speed, at the default and with the phase
/// margin for a stiff shaft: lowest speed, rpm below the reference, area of the dip, percent of the rated speed times s, and largest
/// angle error, degrees.
#[test]
fn the_speed_falls_no_further_than_with_an_encoder() {
    const RPM: f64 = 1150.0;
    let step = |seed, source: &str, margin: f64| {
        let settings = [
            "plant=r".to_owned(),
            FREE.to_owned(),
            "prepare.learn=yes".to_owned(),
            format!("angle_source={source}"),
            format!("speed.phase_margin_deg={margin}"),
            "speed.ramp_rpm_per_s=3000".to_owned(),
            // Its rule gives a far lower limit with an encoder.
            "speed.limit_rpm=1400".to_owned(),
        ];
        let config = Config::load(Some("motulator-2kw2"), None, &settings).unwrap();
        let mut rig = regulating(&config, seed, RPM);
        rig.set_load(Load::Free { torque: 0.5 * config.rated_nm() }).unwrap();
        let (mut lowest, mut area, mut angle) = (RPM, 0.0, 0.0_f64);
        rig.run(2.0, |p| {
            lowest = lowest.min(p.speed_rpm);
            area += (RPM - p.speed_rpm) / 6000.0;
            angle = angle.max(p.angle_error_deg.abs());
        });
        assert_eq!(rig.drive.state(), State::Speed);
        let rated = f64::from(config.drive.nameplate.speed_rpm);
        (RPM - lowest, 100.0 * area / rated, angle)
    };
    for (seed, margin, most) in [(1, 60.0, 1.7), (2, 45.0, 1.0)] {
        let [(dip, area, angle), (encoder, ..)] =
            ["injection", "encoder"].map(|source| step(seed, source, margin));
        assert!(
            dip < 1.3 * encoder && area < most && angle < 7.0,
            "{dip} {encoder} {area} {angle}"
        );
    }
}

/// A flying start continues from the speed that it finds: it does not brake the shaft. (Speed control once began at rest, and braked a
/// light shaft to a standstill.)
#[test]
fn a_start_on_a_turning_shaft_does_not_brake_it() {
    let settings = ["plant=r", FREE, "prepare.learn=yes", "speed.ramp_rpm_per_s=3000"];
    for (seed, rpm) in [(1, 1300.0), (2, -560.0)] {
        let config = Config::load(Some("motulator-2kw2"), None, &settings).unwrap();
        let mut rig = regulating(&config, seed, rpm);
        coast(&mut rig);
        rig.start(Mode::Speed).unwrap();
        rig.command(&Command::Speed(rpm as f32)).unwrap();
        let mut slowest = f64::INFINITY;
        rig.run(2.0, |p| slowest = slowest.min(p.speed_rpm / rpm));
        assert!(slowest > 0.85, "{rpm} rpm: {slowest}");
        assert_eq!(rig.drive.state(), State::Speed);
    }
}
