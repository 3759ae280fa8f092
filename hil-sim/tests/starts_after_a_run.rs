//! Flying starts after a run that ended without a known speed: residual flux is present, and must not be short-circuited.

use drive_core::{Command, Mode, State, Stop};
use hil_sim::Config;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;

const RPM: f64 = 2000.0;

/// The dissertation's motor, and a large one.
const MOTORS: [Option<&str>; 2] = [None, Some("modelica-18kw5")];

/// Returns a drive that has learned, on a shaft that a dynamometer will turn, and the current that trips, A.
fn learned(motor: Option<&str>) -> (Rig, f64) {
    let config = Config::load(motor, None, &["prepare.learn=yes"]).expect("settings");
    let config = for_the_range(&config).expect("settings");
    (Rig::from_config(&config, 5).expect("a bench"), config.drive.trip_a().into())
}

/// Starts in torque mode; returns the largest current, A, and whether the low sides have short-circuited the motor.
fn start(rig: &mut Rig, until: State) -> (f64, bool) {
    rig.command(&Command::Start(Mode::Torque)).expect("a start");
    let (mut largest, mut shorted) = (0.0_f64, false);
    for _ in 0..12_000 {
        rig.run(1.0 / 6000.0, |point| largest = largest.max(point.current));
        shorted |= rig.drive.state() == State::Precharge;
        if rig.drive.state() == until {
            return (largest, shorted);
        }
    }
    panic!("the drive is {}, {largest} A, short circuit: {shorted}", rig.drive.state());
}

/// Checks that residual flux was present and was not short-circuited; and the current of flux and search as a share of
/// the trip, which may reach 0.7.
fn as_expected(motor: Option<&str>, flux: f64, share: f64, shorted: bool) {
    assert!(flux > 0.1, "{motor:?}: {flux} V s");
    assert!(share < 0.75, "{motor:?}: {share} of the trip");
    assert!(!shorted, "{motor:?}");
}

/// Checks that the drive regulates with the right angle.
fn regulates(rig: &mut Rig) {
    rig.command(&Command::Torque(1.0)).expect("a torque");
    let mut largest = 0.0_f64;
    rig.wait(0.3);
    rig.run(0.5, |point| largest = largest.max(point.angle_error_deg.abs()));
    assert_eq!(rig.drive.state(), State::Torque);
    assert!(largest < 3.0, "{largest} degrees");
}

/// The drive was stopped while it searched for the speed, and started again at once: the residual flux of the first run is still there.
#[test]
fn a_start_that_was_stopped_in_its_search_is_repeated() {
    for motor in MOTORS {
        let (mut rig, trip) = learned(motor);
        rig.start(Mode::Torque).expect("a start");
        rig.bring_to(RPM, 100, 0.02).expect("a load");
        rig.settle(&Command::Stop(Stop::Coast), 0.02).expect("a stop");
        start(&mut rig, State::FlyingStart);
        rig.wait(0.015);
        rig.settle(&Command::Stop(Stop::Coast), 0.005).expect("a stop");
        let flux = rig.plant.rotor_flux().norm();
        let (largest, shorted) = start(&mut rig, State::Torque);
        as_expected(motor, flux, largest / trip, shorted);
        regulates(&mut rig);
    }
}

/// The same after a run with V/f control, in which the drive knows no flux.
#[test]
fn a_start_follows_a_run_by_voltage_and_frequency() {
    for motor in MOTORS {
        let (mut rig, trip) = learned(motor);
        rig.set_load(Load::Free { torque: 0.0 }).expect("a load");
        rig.start(Mode::VoltsPerHertz).expect("a start");
        rig.settle(&Command::Speed(RPM as f32), 8.0).expect("a speed");
        let rpm = rig.rpm();
        rig.settle(&Command::Stop(Stop::Coast), 0.02).expect("a stop");
        rig.turn(rpm).expect("a load");
        let flux = rig.plant.rotor_flux().norm();
        let (largest, shorted) = start(&mut rig, State::Torque);
        as_expected(motor, flux, largest / trip, shorted);
        regulates(&mut rig);
    }
}

/// A light shaft that the search has moved is started as a flying start, which measures no resistance: the resistance
/// of the previous run bounds it. (With a start at standstill the vibration of the shaft changed it by 25 %, up to
/// fault 41.)
#[test]
fn a_start_that_measures_no_resistance_keeps_what_was_measured() {
    let config = Config::load(Some("marathon-0kw2"), None, &["plant=r", "prepare.learn=yes"]);
    for seed in [1, 2] {
        let mut rig = Rig::from_config(config.as_ref().expect("settings"), seed).expect("a bench");
        let before = rig.drive.stator_resistance().unwrap_or_default();
        rig.set_load(Load::Free { torque: 0.0 }).expect("a load");
        rig.start(Mode::Speed).expect("a start");
        let mut largest = 0.0_f32;
        for _ in 0..200 {
            rig.wait(0.01);
            let deviation = rig.drive.stator_resistance().expect("an observer") - before;
            largest = largest.max(deviation.abs());
        }
        assert_eq!(rig.drive.state(), State::Speed, "seed {seed}");
        assert!(largest < 0.12, "seed {seed}: {largest}");
    }
}

/// A start on a rotating shaft measures no resistance. If the winding has had the time to warm by 30 % since the last
/// measurement, the drive finds most of that change from the torque. (If the drive took the measured resistance for
/// certain, the error was 12.7 degrees rms at -85 rpm, and the lock was lost at -40.)
#[test]
fn a_start_on_a_rotating_shaft_finds_a_resistance_that_has_changed() {
    let config = Config::load(None, None, &["plant=r", "prepare.learn=yes"]).expect("settings");
    let config = for_the_range(&config).expect("settings");
    let mut rested = Rig::from_config(&config, 5).expect("a bench");
    rested.wait(105.0);
    rested.plant.set_resistances(7.0, config.motor.r_r).expect("resistances");
    for rpm in [85.0, -85.0, 40.0, -40.0, 120.0, -120.0, 250.0, -250.0] {
        let mut rig = rested.clone();
        rig.turn(rpm).expect("a load");
        start(&mut rig, State::Torque);
        rig.settle(&Command::Torque(2.0), 0.1).expect("a torque");
        let (mut sum, mut count) = (0.0, 0.0);
        rig.run(0.6, |point| (sum, count) = (sum + point.angle_error_deg.powi(2), count + 1.0));
        let (rms, found) = ((sum / count).sqrt(), rig.drive.stator_resistance());
        assert!(rms < 3.5 && found > Some(0.1), "{rpm}: {rms}, {found:?}");
    }
}
