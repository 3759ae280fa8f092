//! The commissioning at the console: its requests, its lines, and the acceptance of its results.

use drive_commission::{Refusal, Step};
use drive_settings::Settings;
use hil_sim::Config;
use hil_sim::config::{LoadMode, plant_settings};
use hil_sim::rig::Rig;

use super::*;
use crate::commissioning::{News, Session};
use crate::link::ring::Record;

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
fn the_steps_are_named_and_the_drive_must_be_off_and_confirmed() {
    let mut talk = Talk::new();
    for (line, answer) in
        [("commission", "ok"), ("commission levels leakage", "ok"), ("commission sensors", "ok")]
    {
        assert_eq!(talk.ask(line), answer, "{line}");
        talk.say("stop\n");
    }
    let wrong = talk.ask("commission everything");
    assert!(wrong.contains("everything") && wrong.contains("current-loop"), "{wrong}");
    assert!(talk.ask("commission levels leakage sensors").starts_with("error: "));
    talk.ask("start");
    assert_eq!(talk.ask("commission"), "error: the drive must be off: `stop` first");
    talk.ask("stop");
    talk.drive.running = false;
    assert!(talk.ask("commission").contains("does not run"));
}

#[test]
fn every_value_and_verdict_is_told_on_a_line_of_its_own() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("commission nameplate"), "ok");
    let told = told(&mut talk);
    assert!(told.len() >= 4, "{told:?}");
    assert!(told[0].contains("nameplate: test current 3.578 A"), "{told:?}");
    assert!(told.iter().any(|line| line == "* commissioning: nameplate: sound"), "{told:?}");
    assert!(told.last().unwrap().contains("ended; `accept`"), "{told:?}");

    // A refusal names the step and the reason, and says that nothing has changed.
    let mut talk = Talk::new();
    assert_eq!(talk.ask("commission leakage"), "ok");
    talk.drive.session.refused(None);
    let told = self::told(&mut talk);
    let why = format!("* commissioning: leakage: refused: {}", Refusal::SamplesLost);
    assert_eq!(told, [why.as_str(), "* commissioning: ended; the settings are as they were"]);
}

/// Lines that the console prints until the commissioning has ended.
fn told(talk: &mut Talk) -> Vec<String> {
    let mut told = Vec::new();
    for _ in 0..20 {
        talk.drive.session.poll(&talk.drive.drive.test_report(), |_| ());
        told.extend(talk.say(""));
    }
    told
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
