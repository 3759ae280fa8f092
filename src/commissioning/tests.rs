use drive_core::{Command, Drive, Mode, Refused, State};
use drive_settings::PlantSource;
use hil_sim::Config;
use hil_sim::config::{LoadMode, plant_settings};
use hil_sim::experiments::drawn_machine::Circuit;
use hil_sim::rig::Rig;

use super::*;

/// Control periods from one pass of the main loop to the next.
const PASS: u64 = 7;
/// Longest commissioning, control periods.
const LONGEST: u64 = 240_000;

/// A bench with a free shaft, whose drive has the settings of another motor.
fn bench(seed: u64) -> (Rig, Settings) {
    let mut config = Config::default();
    config.load.mode = LoadMode::Free;
    let mut settings = config.drive;
    settings.motor.r_s *= 3.0;
    settings.motor.l_m *= 0.5;
    (Rig::new(&plant_settings(&config), &settings, seed).unwrap(), settings)
}

/// Plays the part of the firmware until the session ends, and returns its events. Periods for which `lost` is true do not arrive.
fn play(rig: &mut Rig, session: &mut Session, lost: impl Fn(u64, &Session) -> bool) -> Vec<News> {
    let mut told = Vec::new();
    for n in 0..LONGEST {
        rig.step();
        let seen = rig.drive.is_testing() || rig.drive.state().regulates();
        if seen && !lost(n, session) {
            let telemetry = *rig.drive.telemetry();
            session.take(&Period { period: n as u32, telemetry, ..Period::default() });
        }
        if !n.is_multiple_of(PASS) {
            continue;
        }
        let command = session.poll(&rig.drive.test_report(), |commissioning| {
            assert_eq!(rig.drive.state(), State::Off, "it takes a second");
            commissioning.design();
        });
        if let Some(command) = command
            && let Err(why) = rig.drive.command(&command)
        {
            session.refused(Some(why));
        }
        told.extend(session.news());
        if let Some(News::Ended { .. }) = told.last() {
            return told;
        }
    }
    panic!("no end: {told:?}");
}

fn refusal(told: &[News]) -> (Step, Refusal) {
    let refused = |news: &News| match news {
        News::Report(report) => report.refusal.map(|why| (report.step, why)),
        News::Ended { .. } => None,
    };
    told.iter().find_map(refused).expect("nothing was refused")
}

#[test]
fn the_motor_is_found_from_its_nameplate() {
    let (mut rig, settings) = bench(3);
    let mut session = Session::new(&settings);
    assert_eq!(session.found(&settings), None);
    session.begin(Step::Nameplate, Step::LAST);
    let told = play(&mut rig, &mut session, |_, _| false);
    assert_eq!(told.last(), Some(&News::Ended { sound: true, step: Step::LAST }), "{told:?}");
    assert_eq!(rig.drive.state(), State::Off);
    let found = session.found(&settings).unwrap().motor;
    let truth = Config::default().motor;
    for (found, truth) in [
        (found.r_s, truth.r_s),
        (found.r_r, truth.r_r),
        (found.l_m, truth.l_m),
        (found.l_ls, truth.l_ls),
    ] {
        assert!((f64::from(found) / truth - 1.0).abs() < 0.015, "{found} {truth}");
    }
    // New settings, as for another motor.
    session.configured(&settings);
    assert_eq!(session.found(&settings), None);
}

#[test]
fn samples_that_are_lost_while_they_count_refuse_the_step() {
    let (mut rig, settings) = bench(4);
    let mut session = Session::new(&settings);
    session.begin(Step::Nameplate, Step::Leakage);
    // One period is lost, a second into the dc resistance test.
    let told = play(&mut rig, &mut session, |n, _| n == 12_000);
    assert_eq!(refusal(&told), (Step::Levels, Refusal::SamplesLost));
    assert_eq!((session.found(&settings), rig.drive.state()), (None, State::Off));
    // If the step is begun again, the lost period does not count.
    session.begin(Step::Nameplate, Step::Levels);
    let told = play(&mut rig, &mut session, |_, _| false);
    assert_eq!(told.last(), Some(&News::Ended { sound: true, step: Step::Levels }), "{told:?}");
}

#[test]
fn a_command_that_is_not_taken_ends_it() {
    let settings = Config::default().drive;
    let mut drive = Drive::new(settings.build().unwrap());
    let mut session = Session::new(&settings);
    session.begin(Step::Nameplate, Step::LAST);
    // Somebody starts the drive in between.
    drive.command(&Command::Start(Mode::Learning)).unwrap();
    let report = loop {
        // The session has not learned of the start, so it takes the drive to be off.
        let stale = TestReport::default();
        if let Some(command) = session.poll(&stale, |_| panic!("too early")) {
            let why = drive.command(&command).unwrap_err();
            session.refused(Some(why));
        }
        match session.news() {
            Some(News::Report(report)) if report.refusal.is_some() => break report,
            _ => {}
        }
    };
    assert_eq!(report.step, Step::Sensors);
    let refused = Refused::State(State::Calibrating);
    assert_eq!(report.refusal, Some(Refusal::Command(refused)));
}

/// Inertia from 0.2 to 2 times that of the settings, half of it with friction.
#[test]
fn the_inertia_is_found_with_a_free_shaft() {
    for (seed, inertia, friction) in
        [(1, 0.012, 0.0), (2, 0.0024, 0.0), (3, 0.024, 0.05), (4, 0.006, 0.05)]
    {
        let mut config = Config::default();
        config.load.mode = LoadMode::Free;
        config.motor.inertia = inertia;
        config.shaft.static_nm = friction;
        let settings = config.drive;
        let mut rig = Rig::new(&plant_settings(&config), &settings, seed).unwrap();
        let mut session = Session::new(&settings);
        session.begin(Step::Inertia, Step::Inertia);
        let told = play(&mut rig, &mut session, |_, _| false);
        assert_eq!(
            told.last(),
            Some(&News::Ended { sound: true, step: Step::Inertia }),
            "{inertia}: {told:?}"
        );
        let found = session.found(&settings).unwrap();
        let error = f64::from(found.inertia.unwrap()) / inertia - 1.0;
        assert!(error.abs() < 0.03, "{inertia} {friction}: {error}, {told:?}");
        assert_eq!(found.motor.r_s, settings.motor.r_s, "nothing else is touched");
        assert_eq!(found.speed, settings.speed, "a rigid shaft: {told:?}");
    }
    // A locked shaft.
    let mut config = Config::default();
    config.load.mode = LoadMode::Locked;
    let mut rig = Rig::new(&plant_settings(&config), &config.drive, 5).unwrap();
    let mut session = Session::new(&config.drive);
    session.begin(Step::Inertia, Step::Inertia);
    let told = play(&mut rig, &mut session, |_, _| false);
    let (step, why) = refusal(&told);
    assert!(step == Step::Inertia && why.to_string().contains("free to turn"), "{why}");
    assert_eq!(rig.drive.state(), State::Off);
}

/// The plants identified from the pseudo-random voltage are the motor's, and go into the settings with the other results.
#[test]
fn the_plants_of_the_current_loop_are_identified_on_request() {
    for (seed, scale) in [(1, 1.0), (2, 0.6), (3, 1.7)] {
        let mut config = Config::default();
        config.load.mode = LoadMode::Locked;
        config.motor.l_ls *= scale;
        config.motor.l_lr *= scale;
        let settings = config.drive;
        let mut rig = Rig::new(&plant_settings(&config), &settings, seed).unwrap();
        let mut session = Session::new(&settings);
        session.begin(Step::Nameplate, Step::LAST);
        play(&mut rig, &mut session, |_, _| false);
        let parameters = session.found(&settings).unwrap();
        assert_eq!(parameters.current_plant.source, PlantSource::Motor);
        rig.wait(1.0);
        session.begin(Step::Plant, Step::Plant);
        let told = play(&mut rig, &mut session, |_, _| false);
        assert_eq!(told.last(), Some(&News::Ended { sound: true, step: Step::Plant }), "{told:?}");
        let found = session.found(&settings).unwrap();
        assert_eq!(found.current_plant.source, PlantSource::Identified);
        assert_eq!(found.motor, parameters.motor);
        // The plant computed from the motor's parameters. The saliencies of the flux and of the current hardly show at half the test
        // current.
        let truth = Circuit::of_plant(&config);
        let pole = (-(truth.r_s + truth.r_r) / (6000.0 * truth.leakage)).exp();
        let gain = (1.0 - pole) / (truth.r_s + truth.r_r);
        for plant in [found.current_plant.d, found.current_plant.q] {
            let (k, p) = (f64::from(plant.k.unwrap()), f64::from(plant.p.unwrap()));
            let (k, lag) = (k / gain, (1.0 - p) / (1.0 - pole));
            assert!((k - 1.0).abs() < 0.03 && (lag - 1.0).abs() < 0.15, "x{scale}: {k} {lag}");
        }
        found.build().unwrap();
    }
}

/// A free shaft without and with an elastic coupling between two equal inertias, whose resonance is at this frequency, with 3 % of the
/// rated torque as friction. (On `krause-3hp` couplings of 15 and 30 Hz are not seen, and do not disturb the loop.)
#[test]
fn a_shaft_that_rings_gets_a_slower_speed_loop() {
    for (name, inertia, coupled_hz) in [
        ("motulator-2kw2", 0.015, None),
        ("krause-3hp", 0.089, None),
        ("spindle-2kw2", 0.0006, Some(30.0)),
    ] {
        let mut config = Config::of_motor(Some(name)).unwrap();
        config.load.mode = LoadMode::Free;
        config.shaft.static_nm = 0.03 * config.rated_nm();
        config.prepare.learn = true;
        assert!((config.motor.inertia / inertia - 1.0).abs() < 0.05, "{name}");
        let coupled = coupled_hz.is_some();
        if let Some(hz) = coupled_hz {
            let (half, omega) = (0.5 * config.motor.inertia, hz * std::f64::consts::TAU);
            (config.motor.inertia, config.shaft.load_inertia) = (half, half);
            // The resonance of two equal inertias, with a damping ratio of 0.7 %.
            config.shaft.stiffness = 0.5 * half * omega * omega;
            config.shaft.damping = 0.007 * half * omega;
        }
        let (mut rig, settings) = (Rig::from_config(&config, 1).unwrap(), config.drive);
        let mut session = Session::new(&settings);
        session.begin(Step::Inertia, Step::Inertia);
        let told = play(&mut rig, &mut session, |_, _| false);
        let found = session.found(&settings).unwrap();
        let error = f64::from(found.inertia.unwrap()) / inertia - 1.0;
        assert!(error.abs() < 0.1, "{name}: {error}, {told:?}");
        let margin = if coupled { 70.0 } else { settings.speed.phase_margin_deg };
        assert_eq!(found.speed.phase_margin_deg, margin, "{name}: {told:?}");
        let said = told.iter().any(|news| matches!(news, News::Report(report) if report.to_string().contains("the shaft rings")));
        assert_eq!(said, coupled, "{name}: {told:?}");
    }
}
