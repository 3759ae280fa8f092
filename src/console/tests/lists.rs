use super::*;
use crate::settings::staging::UNCONFIRMED;

#[test]
fn lists_end_with_ok_and_the_next_line_cuts_them_short() {
    let mut talk = Talk::new();
    let help = talk.say("help\n");
    assert_eq!((help.len(), help.last().unwrap().as_str()), (HELP.len() + 2, "ok"));
    let all = talk.say("get\n");
    assert_eq!(all.len(), keys::COUNT + 1);
    let motor = talk.say("get motor\n");
    assert_eq!((motor.len(), motor[0].as_str()), (11 + 1, "motor.r_s = 5.4 ohm (0.0001 to 1000)"));
    // No text can leave, and meanwhile a line comes.
    talk.port.room = 0;
    talk.port.sent.extend(b"get\n");
    talk.poll();
    talk.poll();
    talk.port.sent.extend(b"stop\n");
    talk.port.room = 1000;
    talk.poll();
    talk.poll();
    let lines: Vec<&str> = talk.port.received.lines().collect();
    assert_eq!(lines, [lines[0], "ok"]);
}

#[test]
fn a_trace_has_time_and_units_and_shows_standstill() {
    let mut talk = Talk::new();
    let trace = talk.say("trace 3\n");
    assert_eq!(trace[0], "t_s,phi_deg,i_d_a,i_q_a,i_q_ref_a,v_d_v,v_q_v,delta_i_a,turns");
    let third = ",0.333333".repeat(8);
    assert_eq!(trace[1], format!("0.000000{third}"));
    assert_eq!(trace[3], format!("0.000333{third}"));
    assert_eq!(trace.len(), 5);
    // 1/3 of an electrical turn a period of 1/6000 s is 2000 Hz, 60 000 rpm of four poles.
    let trace = talk.say("trace 2 5 flux_hz speed_rpm dc_link_v\n");
    let header = "t_s,flux_hz,speed_rpm,dc_link_v";
    assert_eq!(trace[..2], [header, "0.000000,2000.00,60000.0,0.333333"]);
    assert!(trace[2].starts_with("0.000833,"), "{trace:?}");
}

#[test]
fn a_trace_with_a_trigger_is_announced_and_printed_when_asked_for() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("trace"), "error: no trace was recorded");
    assert_eq!(talk.ask("trace 4 i_q_a on speed_rpm above 30"), "ok: recording until the trigger");
    // In the unit of the recorder: 30 rpm are one electrical turn a second.
    let Trigger::Level { level, .. } = talk.drive.plan.as_ref().unwrap().trigger else { panic!() };
    assert!((level - PERIOD_S).abs() < 1e-9, "{level}");
    let busy = "error: a trace is being recorded; `trace off` ends it";
    assert_eq!((talk.ask("trace 1"), talk.ask("trace")), (busy.into(), busy.into()));
    assert_eq!(talk.ask("start"), "ok");
    talk.drive.triggered = true;
    assert_eq!(talk.say(""), ["* trace: recorded; `trace` prints it"]);
    let trace = talk.say("trace\n");
    assert_eq!(trace[..2], ["t_s,i_q_a", "-0.000333,0.333333"]);
    assert_eq!((trace.len(), trace[3].as_str()), (6, "0.000000,0.333333"));
    assert_eq!(talk.ask("trace 4 on fault"), "ok: recording until the trigger");
    assert_eq!(talk.ask("trace off"), "ok");
    assert_eq!(talk.ask("trace"), "error: no trace was recorded");
}

/// A sensor with a negative gain has a smaller count for a larger current; a sensor that the board does not have is reported.
#[test]
fn a_trigger_on_a_current_sensor_is_one_on_its_codes() {
    for board in [boards::ALL[0], boards::ALL[1]] {
        let mut settings = FirmwareSettings::of(board);
        settings.confirm_board();
        let line = settings.drive.scales.current_b;
        let mut talk = Talk::with(settings);
        assert_eq!(talk.ask("trace 4 i_b_a on i_b_a above 1.5"), "ok: recording until the trigger");
        let plan = talk.drive.plan.as_ref().unwrap();
        let Trigger::Level { level, above, .. } = plan.trigger else { panic!() };
        assert!((line.gain * level + line.offset - 1.5).abs() < 1e-4, "{level}");
        assert_eq!(above, line.gain > 0.0, "{}", board.name);
    }
    let mut talk = Talk::new();
    let curved = "error: no trigger on it: the board lacks its sensor, or its scale is curved";
    assert_eq!(talk.ask("trace 4 on i_c_a above 1"), curved);
    assert_eq!(talk.ask("trace 4 on heat_sink_c above 40"), curved);
}

/// The object of a line of `describe`: names and texts of its values. Only the help text, which comes last, contains commas between
/// quotes.
fn object(line: &str) -> std::collections::BTreeMap<String, String> {
    let inner = line.strip_prefix('{').and_then(|line| line.strip_suffix('}')).expect(line);
    let (values, help) = inner.split_once(",\"help\":").expect(line);
    let mut rest = values;
    let mut object = std::collections::BTreeMap::from([("help".to_owned(), help.to_owned())]);
    while !rest.is_empty() {
        let (name, value) = rest.split_once(':').expect(line);
        let end = if value.starts_with('[') { value.find(']').unwrap() + 1 } else { 0 };
        let end = value[end..].find(',').map_or(value.len(), |at| at + end);
        object.insert(name.trim_matches('"').to_owned(), value[..end].to_owned());
        rest = value[end..].strip_prefix(',').unwrap_or("");
    }
    object
}

#[test]
fn describe_prints_each_setting_as_json() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("set limits.heat_sink_c 70"), format!("ok: staged; {UNCONFIRMED}"));
    let mut staged = FirmwareSettings::of_the_board();
    staged.drive.limits.heat_sink_c = 70.0;
    let all = talk.say("describe\n");
    assert_eq!((all.len(), all.last().unwrap().as_str()), (keys::COUNT + 1, "ok"));
    for (line, key) in all.iter().zip(keys::all()) {
        // No line is cut off.
        assert!(line.len() + 2 < line::OUTPUT && line.is_ascii() && !line.contains('\\'), "{line}");
        assert_eq!(line.matches('"').count() % 2, 0, "{line}");
        let object = object(line);
        let text = |name: &str| object[name].trim_matches('"').to_owned();
        assert_eq!((text("name"), text("help")), (key.name().to_owned(), key.help().to_owned()));
        assert_eq!((object.len(), object["number"].parse()), (15, Ok(key.id())), "{line}");
        match key.range(&staged) {
            Some((min, max)) => {
                assert_eq!(object["min"].parse(), Ok(min), "{line}");
                assert_eq!(object["max"].parse(), Ok(max), "{line}");
                let effective: f32 = object["effective"].parse().unwrap();
                assert!((min..=max).contains(&effective), "{line}");
            }
            None => {
                assert_eq!((object["min"].as_str(), object["type"].as_str()), ("null", "\"word\""))
            }
        }
    }
    let trip = object(&talk.say("describe limits.trip_a\n")[0]);
    assert_eq!((trip["value"].as_str(), trip["auto"].as_str()), ("\"auto\"", "true"));
    let heat = object(&talk.say("describe limits.heat\n")[0]);
    let values = ["value", "effective", "default", "staged", "change", "learned", "unit", "type"];
    let shown = values.map(|name| heat[name].as_str());
    assert_eq!(shown, ["70", "70", "85", "true", "\"off\"", "false", "\"degC\"", "\"number\""]);
    let words = object(&talk.say("describe angle_source\n")[0]);
    assert_eq!(words["words"], "[\"encoder\",\"injection\"]");
}

#[test]
fn a_latched_fault_is_shown_with_causes_and_cure_and_cleared() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("start"), "ok");
    talk.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    talk.say("");
    let fault = Fault::Break;
    let text = talk.say("faults\n");
    let latched = format!("latched: fault {}, {fault}; last run: power-on", fault.code());
    assert_eq!((text[0].as_str(), text.len()), (latched.as_str(), fault.causes().len() + 3));
    assert_eq!(text[1], format!("cause 1: {}", fault.causes()[0]));
    assert_eq!(text[text.len() - 2..], [format!("cure: {}", fault.cure()), "ok".to_owned()]);
    assert_eq!(talk.say("faults 25\n")[0], "fault 25: too little saliency, or the shaft turns");
    let code = fault.code();
    assert!(talk.ask("start").starts_with(&format!("error: fault {code} is latched")));
    assert_eq!(talk.ask("clear"), "ok");
    assert_eq!(talk.ask("start"), "ok");
}

#[test]
fn what_is_learned_is_listed_saved_and_forgotten_with_its_settings() {
    let mut talk = Talk::new();
    assert_eq!(talk.ask("learned"), "ok: nothing learned with these settings");
    talk.drive.found = Some(found());
    let list = talk.say("learned\n");
    let told = "slope -0.0700 /rad, torque current up to 2.75 A";
    // 3/2 P L_M i_d of Table 5 with 0.7 A: 0.322 Nm/A; L_m i_d: 0.124 Wb.
    let range = "trackable from -0.88 to 0.88 Nm (14 % of rated, -2.75 to 2.75 A) at 0.124 Wb (0.70 A); the limit is the saliency sensitivity, too small beyond";
    let first = [format!("* learned: {told}; `save` keeps it"), format!("* learned: {range}")];
    let list = list.strip_prefix(&first).unwrap();
    assert_eq!(
        list[..4],
        [
            "slope -0.0700 /rad, torque current up to 2.75 A; spread 0.00100; rotor positions 1; \
             asymmetry 0.00050; gain mismatch 0.01000 (misfit 0.00020); \
             current saliency 0.03000 (misfit 0.02000); flux saliency -0.03500",
            "i_q,reference,slope,carrier",
            "0.00,0.00000,-0.07000,1.00000",
            "0.25,0.01617,-0.07000,1.00233",
        ]
    );
    assert_eq!((list.len(), list.last().unwrap().as_str()), (2 + 14 + 1, "ok"));
    assert_eq!(talk.ask("save"), "ok");
    assert_eq!(talk.drive.saved.unwrap().learned, Some(found()));
    // A setting on which it does not depend leaves the learned result, and the drive works with it.
    assert_eq!(talk.ask("set limits.dc_over_v 390"), format!("ok: staged; {UNCONFIRMED}"));
    let limits = "the limits hold in software; analog watchdogs and comparator follow from the next reset on, if saved";
    assert_eq!(talk.ask("apply"), format!("ok: {limits}; {UNCONFIRMED}"));
    let Some(Command::Configure(with)) = talk.drive.commands.last() else { panic!("no order") };
    let mut settings = FirmwareSettings::of_the_board();
    settings.drive.limits.dc_over_v = Some(390.0);
    assert_ne!(*with, settings.build().unwrap());
    settings.learn(&found(), false);
    assert_eq!(*with, settings.build().unwrap());
    // A refused setting leaves the learned result, too.
    assert!(talk.ask("set motor.r_r 0").starts_with("error"));
    assert!(talk.say("learned\n").len() > 10);
    let forgotten = "ok: values learned with another motor.r_r are dropped: learn again";
    assert_eq!(talk.ask("set motor.r_r 1.2"), "ok: staged");
    assert_eq!(talk.ask("apply"), forgotten);
    assert_eq!(talk.ask("learned"), "ok: nothing learned with these settings");
    talk.drive.found = Some(found());
    assert_eq!(talk.ask("defaults"), "ok: staged");
    assert_eq!(talk.ask("apply"), forgotten.replace("ok: ", &format!("ok: {limits}; ")));
    assert_eq!(talk.ask("defaults"), "ok: as in force");
}
