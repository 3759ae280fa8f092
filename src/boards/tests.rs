//! The boards against the limits of their power stages, and against the page that lists what their files state.

use std::fmt::Write;

use super::{
    ALL, Board, COMPARATOR_ERROR, Currents, Level, OF_SWITCHES, SENSING_ERROR, Source, check,
    identity::Identity,
    pin,
    pin::{Pin, Port},
};
use crate::board::{protection, settings_of};
use crate::generated;
use crate::settings::FirmwareSettings;
use drive_settings::Carrier;
use drive_settings::value::Words as _;

const SCALES: [&str; 3] = ["scale of current a", "scale of current b", "scale of current c"];

/// The sections of the boards as `docs/boards.md` has to contain them.
fn section(board: &Board) -> String {
    let level = |level: Level| if level == Level::High { "high" } else { "low" };
    let volts = |volts: f32| format!("{volts:.0} V");
    let list =
        |pins: &[pin::Pin]| pins.iter().map(|pin| pin.to_string()).collect::<Vec<_>>().join(" ");
    let Currents { a, b, shunts } = &board.currents;
    let currents: Vec<_> =
        [a, b].into_iter().chain(shunts.as_ref().map(|three| &three.c)).collect();
    let lines: Vec<_> = currents.iter().map(|sensor| sensor.line.value).collect();
    let values = [
        ("high sides: level that switches on", level(board.high.on_at.value).to_owned()),
        ("low sides: level that switches on", level(board.low.on_at.value).to_owned()),
        ("fault input: level that trips", level(board.fault.trips_at.value).to_owned()),
        ("fault input: resistor", format!("{:.1} kΩ", board.fault.pull_ohm.value * 1e-3)),
        ("dead time", format!("{:.1} µs", board.dead_time_s.value * 1e6)),
    ]
    .into_iter()
    .chain(SCALES.into_iter().zip(&lines).map(|(name, line)| {
        (name, format!("{:.3} mA per ADC count, {:.3} A at count 0", line.gain * 1e3, line.offset))
    }))
    .chain(
        shunts.map(|shunts| {
            ("settling of the shunts", format!("{:.1} µs", shunts.settle_s.value * 1e6))
        }),
    )
    .chain([
        ("scale of the dc link", format!("{:.3} V per ADC count", board.dc_link.line.value.gain)),
        ("maximum operating voltage", volts(board.dc_link_limits.operation.value)),
        ("switches withstand", volts(board.dc_link_limits.switches.value)),
        ("capacitors withstand", volts(board.dc_link_limits.capacitors.value)),
    ])
    .chain(
        board.over_current.map(|shut_down| ("over-current shut-down", shut_down.value.to_owned())),
    )
    .chain([("thermistor", format!("{:.0} Ω at 25 °C", board.ntc.value.ohm_25))]);
    let sources = board.sources();
    let mut text = format!(
        "## {}\n\n{}. High sides {}, low sides {}, fault input {}, currents {}, dc link {}, heat sink {}.\nNominal dc link {:.0} V. Resistors at the driver inputs: {}.\nPins that must stay analog, because the power stage drives them: {}.\n\n| item | value | source |\n|---|---|---|\n",
        board.name,
        board.title,
        list(&board.high.pins),
        list(&board.low.pins),
        board.fault.pin,
        list(&currents.iter().map(|sensor| sensor.pin).collect::<Vec<_>>()),
        board.dc_link.pin,
        board.heat_sink,
        board.dc_link_v,
        board.pulls,
        if board.analog_only.is_empty() { "none".to_owned() } else { list(board.analog_only) },
    );
    let mut rows: Vec<(String, [String; 2])> = Vec::new();
    for (item, value) in values {
        let source = sources.iter().find(|(name, _)| *name == item).and_then(|(_, source)| *source);
        let source = match source {
            Some(Source::Read(document)) => format!("read: {document}"),
            // The `board` command prints its bench step.
            Some(Source::Assumed(_)) => "**assumed**".to_owned(),
            None => panic!("{item}"),
        };
        match rows.last_mut() {
            // Identical sensors share a row.
            Some((items, before))
                if SCALES.contains(&item) && before[..] == [value.clone(), source.clone()] =>
            {
                *items += &item.replace("scale of current", ",");
            }
            _ => rows.push((item.to_owned(), [value, source])),
        }
    }
    for (items, [value, source]) in rows {
        writeln!(text, "| {} | {value} | {source} |", items.replace(" ,", ",")).unwrap();
    }
    text
}

/// Both zero vectors on every board: sensors in the lines allow them, and shunts below the low sides refuse them by name.
#[test]
fn shunts_refuse_both_zero_vectors() {
    for board in ALL {
        let mut settings = settings_of(board);
        settings.scales.both_zero_vectors = true;
        let checked = settings.check().map_err(|why| why.to_string());
        let why = "scales.both_zero_vectors = yes: shunts below the low sides see nothing in the upper zero vector; set it to no";
        let in_line = board.currents.shunts.is_none();
        assert_eq!(checked, if in_line { Ok(()) } else { Err(why.to_owned()) }, "{}", board.name);
    }
}

/// Switching frequencies that each board takes: with sensors in the lines up to the limit of its switches, with shunts 6 kHz only.
#[test]
fn a_carrier_that_a_board_does_not_take_is_refused_by_name() {
    for board in ALL {
        for (switching_khz, word) in Carrier::VALUES.iter().zip(Carrier::WORDS) {
            let mut settings = FirmwareSettings::of(board);
            settings.drive.inverter.switching_khz = *switching_khz;
            let shunts = board.currents.shunts.is_some() && *switching_khz != Carrier::Khz6;
            let why = shunts.then(|| {
                format!("inverter.switching_khz = {word}: shunts below the low sides settle too slowly for shorter pulses; set it to 6")
            });
            assert_eq!(settings.check().err().map(|why| why.to_string()), why, "{}", board.name);
        }
    }
    let slow: &'static Board =
        Box::leak(Box::new(Board { carrier_max_khz: Carrier::Khz12, ..*ALL[0] }));
    let mut settings = FirmwareSettings::of(slow);
    settings.drive.inverter.switching_khz = Carrier::Khz18;
    let why =
        "inverter.switching_khz = 18: the switches of the board do not take it; set a lower one";
    assert_eq!(settings.check().unwrap_err().to_string(), why);
}

#[test]
fn the_manual_lists_the_boards() {
    generated::check("boards.md", "boards", &ALL.map(section).join("\n"));
}

/// Voltages in ascending order, with the margins for the errors: nominal dc link, braking limit, maximum operating voltage, trip of the
/// software, trip of the comparator, limits of switches and capacitors.
#[test]
fn the_voltages_of_every_board_are_in_order() {
    for board in ALL {
        let mut settings = settings_of(board);
        settings.check().unwrap();
        let limits = &board.dc_link_limits;
        let mut highest = [settings.dc_over_v(); 2];
        // First the value by rule, then the highest that may be typed.
        for typed in [false, true] {
            if typed {
                let entry = drive_settings::find("limits.dc_over_v").unwrap();
                highest[1] = entry.range(&settings).unwrap().1;
                settings.limits.dc_over_v = Some(highest[1]);
                settings.check().unwrap();
            }
            let comparator = settings.scales.dc_link.at(protection(board, &settings).over_voltage);
            let [nominal, end, trip] =
                [settings.inverter.dc_link_v, settings.dc_high_v(), settings.dc_over_v()];
            let operation = 1.0005 * limits.operation.value;
            let is_ordered = nominal < end && end <= operation && limits.operation.value < trip;
            assert!(is_ordered, "{}: {nominal} {end} {trip} {comparator}", board.name);
            // The tolerance is one count.
            assert!(comparator > (1.0 + COMPARATOR_ERROR - 0.002) * trip, "{}", board.name);
            let at_most = comparator * (1.0 + SENSING_ERROR);
            assert!(at_most <= OF_SWITCHES * limits.switches.value, "{}", board.name);
            assert!(at_most <= limits.capacitors.value, "{}", board.name);
        }
        assert!(highest[1] >= highest[0]);
        // A typed scale changes neither trip: they are in ADC counts.
        let before = protection(board, &settings).over_voltage;
        settings.scales.dc_link.gain *= 0.5;
        settings.limits.dc_over_v = None;
        settings.inverter.dc_link_v *= 0.5;
        settings.limits.dc_over_v =
            Some(drive_settings::find("limits.dc_over_v").unwrap().range(&settings).unwrap().1);
        assert!(protection(board, &settings).over_voltage.abs_diff(before) <= 1, "{}", board.name);
    }
}

/// Whether the compile-time check refuses a board, and its message.
fn refused(board: Board) -> String {
    let panic = std::panic::catch_unwind(|| check(&board)).expect_err("it is taken");
    panic.downcast_ref::<&str>().copied().unwrap_or_default().to_owned()
}

/// One board after the other, each with an invalid number or pin.
#[test]
fn a_board_that_cannot_be_protected_does_not_compile() {
    for board in ALL {
        check(board);
        let mut other = *board;
        other.dc_link_v = board.dc_link_limits.operation.value;
        assert!(refused(other).contains("nominal dc link is too close"));
        let mut other = *board;
        other.dc_link_limits.switches.value = 1.1 * board.dc_link_limits.operation.value;
        assert!(refused(other).contains("limits of switches and capacitors"));
        let mut other = *board;
        other.dc_link_limits.capacitors.value = 1.02 * board.dc_link_limits.operation.value;
        assert!(refused(other).contains("limits of switches and capacitors"));
        let mut other = *board;
        other.fault.pull_ohm.value = 10e3;
        assert!(refused(other).contains("the chip pulls against it"));
        for pin in [board.low.pins[1], board.fault.pin, board.heat_sink, board.wiring.chopper] {
            let mut other = *board;
            other.analog_only = Box::leak(Box::new([pin]));
            assert!(refused(other).contains("must stay analog"), "{pin}");
        }
        let mut other = *board;
        other.over_current = None;
        if board.dc_link_limits.operation.value > 60.0 {
            assert!(refused(other).contains("over-current shut-down"));
        } else {
            check(&other);
        }
    }
    let mut other = *ALL[0];
    other.terminals.pins[0] = other.terminals.pins[1];
    assert!(refused(other).contains("two signals have the same pin"));
    // Each signal of the chip at a pin that it does not reach, or that has a signal.
    type Move = (fn(&mut Board), &'static str);
    let moves: [Move; 7] = [
        (|board| board.wiring.console[1] = pin::pa(2), "the console is not at LPUART1"),
        (|board| board.wiring.encoder[0] = pin::pb(3), "the encoder is not at TIM2"),
        (|board| board.wiring.encoder[0] = pin::pa(0), "two signals have the same pin"),
        (|board| board.wiring.chopper = pin::pc(8), "the chopper is not at channel 1 of TIM8"),
        (|board| board.wiring.relay = pin::pa(13), "two signals have the same pin"),
        (|board| board.heat_sink = board.dc_link.pin, "two signals have the same pin"),
        (|board| board.dc_link.pin = pin::pc(3), "no comparator reaches the dc link"),
    ];
    for (move_pin, why) in moves {
        let mut other = *ALL[0];
        move_pin(&mut other);
        assert!(refused(other).contains(why), "{why}");
    }
    // As this board was once: its link up to the absolute maximum of its transistors.
    let mut old = *ALL[1];
    (old.dc_link_v, old.dc_link_limits.operation.value) = (48.0, 58.5);
    assert!(refused(old).contains("limits of switches and capacitors"));
}

/// A gate or the fault input at another pin, of another port or number, makes another identity.
#[test]
fn each_pin_is_part_of_the_identity() {
    let pins = |board: &Board| Identity::of(board).pins;
    let moves: [fn(&mut Board) -> &mut Pin; 3] = [
        |board| &mut board.high.pins[0],
        |board| &mut board.low.pins[2],
        |board| &mut board.fault.pin,
    ];
    for pin in moves {
        let (mut number, mut port) = (*ALL[0], *ALL[0]);
        pin(&mut number).number ^= 1;
        let of = pin(&mut port);
        of.port = if of.port == Port::A { Port::B } else { Port::A };
        assert!(pins(&number) != pins(ALL[0]) && pins(&port) != pins(ALL[0]));
    }
}
