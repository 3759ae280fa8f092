//! The torque that `status` promises, against the simulated motor.

use std::f64::consts::TAU;

use hil_sim::Config;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;

use super::*;

/// Least and largest torque, Nm, and q-axis current, A, in a status line.
fn promised(status: &str) -> ([f64; 2], [f64; 2]) {
    let (_, rest) = status.split_once("torque now ").unwrap();
    let numbers: Vec<f64> =
        rest.split([' ', '(']).filter_map(|word| word.parse().ok()).take(4).collect();
    ([numbers[0], numbers[1]], [numbers[2], numbers[3]])
}

/// A drive with encoder on a shaft held at `rpm`, with `volts` at the dc link and as much torque as it gives in the
/// direction of `sign`, after two seconds; and the mean torque of the motor, Nm.
fn pushed(rpm: f64, volts: f64, sign: f32) -> (Rig, f64) {
    let mut config = for_the_range(&Config::default()).unwrap();
    config.drive.angle_source = drive_core::AngleSource::Encoder;
    let mut rig = Rig::from_config(&config, 1).unwrap();
    rig.set_load(Load::Speed { speed: rpm * TAU / 60.0 }).unwrap();
    rig.start(Mode::Torque).unwrap();
    rig.plant.set_dc_link(volts).unwrap();
    rig.command(&Command::Torque(sign * 10.0)).unwrap();
    rig.wait(2.0);
    let (mut sum, mut count) = (0.0, 0.0);
    rig.run(0.2, |point| (sum, count) = (sum + point.torque, count + 1.0));
    (rig, sum / count)
}

#[test]
fn status_tells_the_torque_that_the_motor_then_gives() {
    let mut talk = Talk::new();
    let settings = for_the_range(&Config::default()).unwrap().drive;
    talk.front.desk =
        Desk::new(FirmwareSettings { drive: settings, ..FirmwareSettings::of_the_board() });
    for (rpm, volts) in
        [(300.0, 311.0), (1800.0, 311.0), (1800.0, 230.0), (2700.0, 311.0), (3300.0, 270.0)]
    {
        for (end, sign) in [(0, -1.0), (1, 1.0)] {
            let (rig, torque) = pushed(rpm, volts, sign);
            talk.drive.drive = rig.drive;
            let status = talk.ask("status");
            let (nm, _) = promised(&status);
            // The current controllers take a part of the voltage, and the trim is not quite still.
            assert!((nm[end] - torque).abs() < 0.02 + 0.03 * torque.abs(), "{torque} Nm: {status}");
        }
    }
}

#[test]
fn a_drive_that_is_off_has_the_torque_of_a_shaft_at_rest_and_a_fault_has_none() {
    let mut talk = Talk::new();
    let settings = drive_settings::Settings::default();
    let (i_d, all) = (settings.i_d(), settings.current_limit_a());
    let (i_q, per_a) = ((all * all - i_d * i_d).sqrt(), settings.motor.torque_per_ampere(i_d));
    let status = talk.ask("status");
    // While no current flows, the sensor values are shown by their calibration.
    let at = |line: drive_core::Line, code| format!("{:.2} A", line.at(code));
    let a = at(settings.scales.current_a, talk.drive.sample.current_a);
    let b = at(settings.scales.current_b, talk.drive.sample.current_b);
    let begin = format!(
        "off; speed 0.0 rpm assumed: nothing measures it, sensors a {a}, b {b}, torque now -"
    );
    assert!(status.starts_with(&begin), "{status}");
    let (nm, a) = promised(&status);
    assert!((nm[1] - f64::from(i_q * per_a)).abs() < 0.01 && nm[0] == -nm[1], "{status}");
    assert!((a[1] - f64::from(i_q)).abs() < 0.01 && a[0] == -a[1], "{status}");
    // A heat sink between derating and trip.
    let warm = (0..4096).find(|code| (84.0..86.0).contains(&settings.scales.ntc.celsius(*code)));
    let sample = Sample { heat_sink: warm.unwrap(), ..talk.drive.sample };
    let mut front_end = FrontEndState::default();
    for _ in 0..100 {
        step(&mut talk.drive.drive, &mut front_end, &sample);
    }
    let (less, _) = promised(&talk.ask("status"));
    assert!(less[1] < nm[1] && less[1] >= 0.0, "{less:?} of {nm:?}");
    talk.drive.drive.command(&Command::Start(Mode::Torque)).unwrap();
    talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    let status = talk.ask("status");
    assert!(status.starts_with("in fault ") && !status.contains("torque now"), "{status}");
}
