use super::*;

#[test]
fn lists_end_with_ok_and_the_next_line_cuts_them_short() {
    let mut talk = Talk::new();
    let help = talk.say("help\n");
    assert_eq!((help.len(), help.last().unwrap().as_str()), (HELP.len() + 2, "ok"));
    let all = talk.say("get\n");
    assert_eq!(all.len(), keys::COUNT + 1);
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

/// A sensor with a negative gain has a smaller count for a larger current.
#[test]
fn the_level_of_a_trigger_is_in_the_unit_of_the_recorder() {
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
    // In the unit of the recorder: 30 rpm are one electrical turn a second.
    let mut talk = Talk::new();
    talk.ask("trace 4 i_q_a on speed_rpm above 30");
    let Trigger::Level { level, .. } = talk.drive.plan.unwrap().trigger else { panic!() };
    assert!((level - PERIOD_S).abs() < 1e-9, "{level}");
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
    talk.ask("set limits.heat_sink_c 70");
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
}
