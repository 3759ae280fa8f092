//! Saliency self-commissioning at the console: when it is needed, from scratch, and again at another rotor position.

use drive_core::AngleSource;
use drive_core::carrier::Asymmetry;
use drive_core::learned::{Fitted, Learned};

use super::*;

/// The settings of the board, whose angle comes from the injection.
fn fresh() -> FirmwareSettings {
    let mut settings = FirmwareSettings::of_the_board();
    settings.command.wiring_checked = true;
    settings.confirm_board();
    settings
}

/// The coefficients with which the drive was configured last.
fn configured(talk: &Talk) -> &drive_core::Coefficients {
    let last = talk.drive.commands.iter().rev().find_map(|command| match command {
        Command::Configure(coefficients) => Some(coefficients),
        _ => None,
    });
    last.expect("no order")
}

/// Coefficients with this result in force.
fn with(learned: Option<Learned>) -> drive_core::Coefficients {
    FirmwareSettings { learned, ..fresh() }.build().unwrap()
}

/// A result with this gain mismatch and asymmetry.
fn result(gain: f32, asymmetry: Asymmetry, misfit: f32) -> Learned {
    Learned { gain_mismatch: Fitted { value: gain, misfit, accepted: true }, asymmetry, ..found() }
}

/// Ends the self-commissioning with this result.
fn ends_with(talk: &mut Talk, found: Learned) -> String {
    talk.drive.drive.command(&Command::Stop(Stop::Coast)).unwrap();
    talk.drive.found = Some(found);
    let lines = talk.say("");
    lines.into_iter().find(|line| line.contains("learned: ") || line.contains("refused: ")).unwrap()
}

#[test]
fn a_drive_that_has_not_learned_does_not_start_without_an_encoder() {
    let mut talk = Talk::with(fresh());
    for mode in ["torque", "speed", "position"] {
        let answer = talk.ask(&format!("start {mode}"));
        assert_eq!(
            answer,
            "error: nothing is learned of this motor with these settings: lock the shaft and `learn` first"
        );
        assert_eq!(talk.drive.drive.state(), State::Off);
    }
    // With the encoder where that is allowed, and once the drive has learned.
    assert_eq!(talk.ask("set angle_source encoder"), "ok: staged");
    assert_eq!((talk.ask("start"), talk.ask("stop")), ("ok".into(), "ok".into()));
    assert_eq!(talk.ask("set angle_source injection injection.allow_unlearned yes"), "ok: staged");
    assert_eq!((talk.ask("start"), talk.ask("stop")), ("ok".into(), "ok".into()));
    assert_eq!(talk.ask("set injection.allow_unlearned no"), "ok: staged");
    assert!(talk.ask("start").starts_with("error: nothing is learned"));
    let mut learned = fresh();
    learned.learn(&found(), false);
    assert_eq!(Talk::with(learned).ask("start"), "ok");
}

/// The drive keeps its learned values while it learns again at another rotor position, and drops them while it learns from scratch.
#[test]
fn learn_begins_anew_and_learn_again_adds_a_rotor_position() {
    let asymmetry = |constant, sin, cos| Asymmetry { constant, sin, cos };
    let mut talk = Talk::with(fresh());
    assert_eq!(
        talk.ask("learn again"),
        "error: nothing is learned with these settings: `learn` first"
    );
    // There is nothing to leave out, so no design takes place.
    assert_eq!(talk.say("learn\n"), ["ok"]);
    assert!(matches!(talk.drive.commands[..], [Command::Start(Mode::Learning)]));
    let first = result(0.01, asymmetry(0.002, 0.003, -0.004), 0.0054);
    assert_eq!(
        ends_with(&mut talk, first),
        "* learned: slope -0.0700 /rad, torque current up to 2.75 A; one rotor position: `learn again` at another \
         separates slot effects from the stator; `save` keeps it"
    );

    assert_eq!(talk.say("learn again\n"), ["ok"]);
    assert!(matches!(talk.drive.commands[1..], [Command::Start(Mode::Learning)]), "as it was");
    // The rotor slots have moved: the result tells the difference to the first one.
    let told = ends_with(&mut talk, result(-0.004, asymmetry(-0.001, 0.0, 0.006), 0.006));
    assert_eq!(told, "* learned: slope -0.0700 /rad, torque current up to 2.75 A; `save` keeps it");
    let both = talk.front.desk.settings().in_force().learned.unwrap();
    assert!((both.gain_mismatch.value - 0.008).abs() < 1e-6, "{both:?}");
    assert!(both.asymmetry.plus(&asymmetry(0.0015, 0.003, -0.001), -1.0).size() < 1e-6, "{both:?}");
    assert_eq!(both.positions, 2);
    assert!(talk.say("learned\n")[0].contains("; rotor positions 2; asymmetry 0.00350; "));
    // The next start uses the mean.
    assert_eq!(talk.say("start\n"), ["* designing...", "ok"]);
    assert_eq!(*configured(&talk), with(Some(both)));
    talk.say("stop\n");
    assert_eq!(talk.say("start\nstop\n"), ["ok", "ok"], "once");

    // From scratch: without the earlier result, and only the new one is left.
    assert_eq!(talk.say("learn\n"), ["* designing...", "ok"]);
    assert_eq!(*configured(&talk), with(None));
    let third = result(0.002, Asymmetry::default(), 0.0);
    assert!(ends_with(&mut talk, third).ends_with("2.75 A; `save` keeps it"));
    assert_eq!(talk.front.desk.settings().in_force().learned, Some(third));
}

/// A self-commissioning without a result leaves the values learned before in force.
#[test]
fn after_a_refused_learning_the_result_before_holds() {
    for end in ["refused", "stopped", "fault"] {
        let mut settings = fresh();
        settings.learn(&found(), false);
        let mut talk = Talk::with(settings);
        assert_eq!(talk.say("learn\n"), ["* designing...", "ok"]);
        assert_eq!(*configured(&talk), with(None));
        match end {
            "refused" => {
                let refused = Learned { verdict: Verdict::Uneven, spread: 0.01, ..found() };
                assert!(ends_with(&mut talk, refused).ends_with("nothing was changed"));
            }
            "stopped" => assert_eq!(talk.ask("stop"), "ok"),
            _ => {
                talk.drive
                    .drive
                    .step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
                talk.say("clear\n");
            }
        }
        assert_eq!(talk.front.desk.settings().in_force().learned, Some(found()));
        assert_eq!(talk.say("start\n").last().unwrap(), "ok", "{end}");
        assert_eq!(*configured(&talk), with(Some(found())), "{end}");
    }
}

#[test]
fn learning_is_refused_where_a_start_is() {
    let mut talk = Talk::with(fresh());
    assert_eq!(talk.ask("learn twice"), "error: too many words, from `twice` on");
    assert_eq!(talk.ask("learn"), "ok");
    assert_eq!(talk.ask("learn"), "error: not possible while the drive is calibrating");
    assert_eq!(talk.ask("learn again"), "error: not possible while the drive is calibrating");
    let mut unconfirmed = FirmwareSettings::of(boards::ALL[1]);
    unconfirmed.drive.angle_source = AngleSource::Injection;
    assert!(Talk::with(unconfirmed).ask("learn").starts_with("error: the board's polarities"));
    // The first start after the defaults checks the wiring, whatever it starts.
    let mut unchecked = fresh();
    unchecked.command.wiring_checked = false;
    let mut talk = Talk::with(unchecked);
    assert_eq!(talk.ask("learn"), "ok: the wiring is checked first");
    assert!(matches!(
        talk.drive.commands[..],
        [Command::CheckWiring, Command::Start(Mode::Learning)]
    ));
}
