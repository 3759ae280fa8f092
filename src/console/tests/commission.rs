//! The commissioning at the console: its requests, its lines, and the acceptance of its results.

use drive_commission::Step;
use drive_settings::Settings;
use hil_sim::Config;
use hil_sim::config::{LoadMode, plant_settings};
use hil_sim::rig::Rig;

use super::*;
use crate::commissioning::{News, Session};
use crate::recording::ring::Record;

/// A session on a simulated motor of 6 ohm that a drive with these settings has identified.
fn found_on_a_motor(settings: &Settings) -> Session {
    let mut config = Config::default();
    config.motor.r_s = 6.0;
    config.load.mode = LoadMode::Free;
    // The simulation bench has its own ADCs.
    let mut rig = Rig::new(&plant_settings(&config), &config.drive, 1).unwrap();
    let mut session = Session::new(settings);
    session.begin(Step::Nameplate, Step::Leakage);
    for n in 0.. {
        rig.step();
        if rig.drive.is_testing() {
            let telemetry = *rig.drive.telemetry();
            session.take(&Record { period: n, telemetry, ..Record::default() });
        }
        if let Some(command) = session.poll(&rig.drive.test_report(), |_| ()) {
            rig.drive.command(&command).unwrap();
        }
        match session.news() {
            Some(News::Report(report)) => assert_eq!(report.refusal, None, "{report}"),
            Some(News::Ended { sound, .. }) => assert!(sound),
            None => {}
        }
        if !session.is_running() {
            break;
        }
    }
    session
}

#[test]
fn accept_puts_in_force_and_saves_what_was_found_and_nothing_else() {
    let mut talk = Talk::new();
    let before = *talk.front.desk.settings().in_force();
    assert_eq!(talk.ask("accept"), "error: nothing new was found: `commission` first");
    assert_eq!(talk.drive.saved, None);
    talk.drive.session = found_on_a_motor(&before.drive);
    // Values that the user has staged stay.
    assert_eq!(talk.ask("set motor.inertia 0.02"), "ok: staged");
    let answers = talk.say("accept\n");
    assert_eq!(answers.last().unwrap(), "ok", "{answers:?}");
    let saved = talk.drive.saved.expect("not saved");
    assert_eq!(&saved, talk.front.desk.settings().in_force());
    assert!((saved.drive.motor.r_s / 6.0 - 1.0).abs() < 0.01, "{}", saved.drive.motor.r_s);
    assert_eq!(saved.drive.inertia, Some(0.02));
    assert_eq!(saved.drive.nameplate, before.drive.nameplate);
    assert_eq!(saved.drive.limits, before.drive.limits);
    assert!(saved.command.wiring_checked);
    // The result is in force, so there is nothing new.
    assert!(talk.ask("accept").starts_with("error: nothing new"));
    assert!(talk.drive.commands.iter().any(|command| matches!(command, Command::Configure(_))));
}
