//! The page of the boards lists what the board files state.

use std::fmt::Write;

use super::{ALL, Board, Level, Source};

const SCALES: [&str; 3] = ["scale of current a", "scale of current b", "scale of current c"];

/// The sections of the boards as `docs/boards.md` has to contain them.
fn section(board: &Board) -> String {
    let level = |level: Level| if level == Level::High { "high" } else { "low" };
    let pins = |pins: [super::pin::Pin; 3]| pins.map(|pin| pin.to_string()).join(" ");
    let currents: Vec<_> = board.currents.a_and_b().into_iter().chain(board.currents.c()).collect();
    let lines: Vec<_> = currents.iter().map(|sensor| sensor.line.value).collect();
    let values = [
        ("high sides: level that switches on", level(board.high.on_at.value).to_owned()),
        ("low sides: level that switches on", level(board.low.on_at.value).to_owned()),
        ("fault input: level that trips", level(board.fault.trips_at.value).to_owned()),
        ("dead time", format!("{:.1} µs", board.dead_time_s.value * 1e6)),
    ]
    .into_iter()
    .chain(SCALES.into_iter().zip(&lines).map(|(name, line)| {
        (name, format!("{:.3} mA a code, {:.3} A at code 0", line.gain * 1e3, line.offset))
    }))
    .chain(match &board.currents {
        super::Currents::LowSide { settle_s, .. } => {
            Some(("settling of the shunts", format!("{:.1} µs", settle_s.value * 1e6)))
        }
        super::Currents::InLine(_) => None,
    })
    .chain([
        ("scale of the dc link", format!("{:.3} V a code", board.dc_link.line.value.gain)),
        ("highest dc link", format!("{:.0} V", board.highest_dc_link_v.value)),
        ("thermistor", format!("{:.0} Ω at 25 °C", board.ntc.value.ohm_25)),
    ]);
    let sources = board.sources();
    let mut text = format!(
        "## {}\n\n{}. High sides {}, low sides {}, fault input {}, currents {}, dc link {}, heat sink {}.\nNominal dc link {:.0} V. Resistors at the driver inputs: {}.\n\n| item | value | source |\n|---|---|---|\n",
        board.name,
        board.title,
        pins(board.high.pins),
        pins(board.low.pins),
        board.fault.pin,
        currents.iter().map(|sensor| sensor.pin.to_string()).collect::<Vec<_>>().join(" "),
        board.dc_link.pin,
        board.heat_sink,
        board.dc_link_v,
        board.pulls,
    );
    for (item, value) in values {
        let source = sources.iter().find(|(name, _)| *name == item).and_then(|(_, source)| *source);
        let source = match source {
            Some(Source::Read(document)) => format!("read: {document}"),
            Some(Source::Assumed(step)) => format!("**assumed**; bench: {step}"),
            None => panic!("{item}"),
        };
        writeln!(text, "| {item} | {value} | {source} |").unwrap();
    }
    text
}

/// On a difference the message is the section as it should be.
#[test]
fn the_manual_lists_the_boards() {
    let manual = include_str!("../../docs/boards.md");
    let sections = ALL.map(section);
    let all = sections.iter().all(|section| manual.contains(section));
    assert!(all, "docs/boards.md has to contain:\n{}", sections.join("\n"));
}
