//! The contacts compared with exhaustive tables and random contacts.

use std::collections::BTreeSet;

use drive_settings::value::Words as _;
use proptest::prelude::*;

mod panel;

use super::contacts::{CLOSES, OPENS};
use super::reference::{Lost, share};
use super::sequence::ARMED;
use super::settings::{Enable, Settings, Start};
use super::*;
use crate::boards::{ALL, CONTACTS, TERMINALS};
use crate::generated;

fn code(full_v: f32, volts_of_ten: f32) -> u16 {
    (volts_of_ten * 0.1 * full_v / 3.3 * 4096.0).round() as u16
}

/// START over some readings, and whether the drive may run; returns the acts.
fn acts(sequence: &mut Sequence, start: Start, looks: &[(bool, Seen)]) -> Vec<Act> {
    looks.iter().map(|(closed, seen)| sequence.step(start, *closed, *closed, *seen)).collect()
}

const OFF: Seen = Seen { commands: true, held: false, busy: false, ended: true };
const RUNNING: Seen = Seen { ended: false, ..OFF };

/// All states of the sequence, reached from the beginning: a name, and the readings before.
fn histories() -> Vec<(&'static str, Vec<(bool, Seen)>)> {
    let open = |n: u8| vec![(false, OFF); n.into()];
    let armed = open(ARMED);
    let started: Vec<_> = armed.iter().copied().chain([(true, OFF)]).collect();
    let running: Vec<_> = started.iter().copied().chain([(true, RUNNING)]).collect();
    vec![
        ("power-up", vec![]),
        ("closed at power-up", vec![(true, OFF); 500]),
        ("nearly armed", open(ARMED - 1)),
        ("armed", armed),
        ("started", started),
        ("running", running.clone()),
        ("runs with START open", running.iter().copied().chain([(false, RUNNING); 99]).collect()),
        ("ended by others", running.iter().copied().chain([(true, OFF); 300]).collect()),
    ]
}

/// Each state with each setting, wire and situation: when it starts, stops, and gives speeds. A start needs an edge.
#[test]
fn every_state_with_every_input() {
    let mut seen_acts = BTreeSet::new();
    for ((name, before), start) in
        histories().into_iter().flat_map(|h| Start::VALUES.iter().map(move |s| (h.clone(), *s)))
    {
        for bits in 0..1 << 4 {
            let bit = |n: u8| bits >> n & 1 == 1;
            let (closed, commands, held, busy) = (bit(0), bit(1), bit(2), bit(3));
            for ended in [false, true] {
                let mut sequence = Sequence::default();
                acts(&mut sequence, start, &before);
                let seen = Seen { commands, held, busy, ended };
                let act = sequence.step(start, closed, closed, seen);
                let case = format!("{name} {start:?} {closed} {seen:?}");
                let runs = matches!(name, "started" | "running" | "runs with START open")
                    && start != Start::Off
                    && commands
                    && (busy || !ended);
                let expected = match name {
                    "armed"
                        if commands && !held && closed && ended && !busy && start != Start::Off =>
                    {
                        Act::Start
                    }
                    _ if !runs || busy => Act::Nothing,
                    _ if start == Start::Switch && !closed => Act::Stop,
                    _ => Act::Go,
                };
                assert_eq!(act, expected, "{case}");
                seen_acts.insert(format!("{act:?}"));
                // For any cause: after the end of a run only a new edge starts the next.
                if ended && !busy {
                    let open = ["nearly armed", "armed", "runs with START open"].contains(&name);
                    let edge = open && !closed && commands && !held && start != Start::Off;
                    for look in 0..300 {
                        let act = sequence.step(start, true, true, OFF);
                        assert_eq!(act == Act::Start, edge && look == 0, "{case}");
                    }
                }
            }
        }
    }
    assert_eq!(seen_acts.len(), 4);
}

/// A switch that bounces while the drive runs stops the drive, and does not start it again when it settles closed.
#[test]
fn a_switch_that_bounces_for_long_is_no_edge() {
    for open in 1..ARMED {
        let mut sequence = Sequence::default();
        acts(&mut sequence, Start::Switch, &histories()[5].1);
        for look in 0..1000 {
            let act = sequence.step(Start::Switch, look % u32::from(open + 1) == 0, false, OFF);
            assert_eq!(act, Act::Nothing);
        }
        assert_eq!(acts(&mut sequence, Start::Switch, &[(true, OFF); 300]), [Act::Nothing; 300]);
    }
}

/// All contacts, with each use of ENABLE and START: whether the drive may run, and how it is stopped.
#[test]
fn the_table_of_what_holds_the_drive() {
    for bits in 0..=u8::MAX >> 1 {
        let closed = Contacts(bits);
        for (enable, start) in
            Enable::VALUES.iter().flat_map(|e| Start::VALUES.iter().map(move |s| (*e, *s)))
        {
            let own = Settings { enable, start, ..Settings::default() };
            let buttons = start == Start::Buttons && bits & 4 == 0;
            let expected = match (enable, bits & 1 == 0) {
                (Enable::Yes, true) => Some(Stop::Coast),
                (Enable::Now, true) => Some(Stop::Now),
                _ => buttons.then_some(Stop::Ramp),
            };
            assert_eq!(own.interlock(closed), expected, "{closed} {own:?}");
        }
    }
}

proptest! {
    /// An input is closed only after about 20 consecutive closed readings, and open two readings after a break. An input that chatters
    /// with one open reading in ten never closes.
    #[test]
    fn chatter_is_open(contacts in prop::collection::vec(0_u8..128, 1..400), every in 2_usize..11) {
        let mut debounce = Debounce::default();
        for (at, contact) in contacts.iter().enumerate() {
            let closed = debounce.look(Contacts(*contact));
            for bit in 0..CONTACTS {
                let of = |n: usize| contacts[at - n] >> bit & 1 == 1;
                let two_open = at >= 1 && !of(0) && !of(1);
                let long = usize::from(CLOSES) - 1;
                let all_closed = at >= long && (0..=long).all(of);
                let now = closed.0 >> bit & 1 == 1;
                prop_assert!(!two_open || !now);
                prop_assert!(!all_closed || now);
            }
        }
        let mut debounce = Debounce::default();
        for at in 0..1000 {
            let contact = if at % every == 0 { 0 } else { 127 };
            prop_assert_eq!(debounce.look(Contacts(contact)), Contacts(0));
        }
    }
}

#[test]
fn a_contact_closes_in_20_looks_and_opens_in_2() {
    let mut debounce = Debounce::default();
    let closes = (1..).find(|_| debounce.look(Contacts(127)) == Contacts(127)).unwrap();
    let opens = (1..).find(|_| debounce.look(Contacts(0)) == Contacts(0)).unwrap();
    assert_eq!((closes, opens), (CLOSES, OPENS));
}

#[test]
fn references_in_and_out_of_range() {
    let pins = |second: bool| {
        let mut pins = ALL[0].terminals;
        pins.pins[1] = pins.pins[1].filter(|_| second);
        pins
    };
    let volts = |v| Some(code(3.0, v));
    let ma = |ma: f32| volts(ma / 2.0);
    for (given, expected) in [
        (None, Err(Lost::Silent)),
        (ma(0.0), Err(Lost::Low)),
        (ma(3.55), Err(Lost::Low)),
        (ma(3.65), Ok(0.0)),
        (ma(4.0), Ok(0.0)),
        (ma(12.0), Ok(0.5)),
        (ma(20.0), Ok(1.0)),
        (ma(20.9), Ok(1.0)),
        (ma(21.1), Err(Lost::High)),
        (Some(4095), Err(Lost::High)),
    ] {
        let found = share(Reference::Current, &pins(true), [given, None, None]);
        assert_eq!(found.map(|x| (x * 100.0).round() / 100.0), expected, "{given:?}");
    }
    for (second, codes, expected) in [
        (false, [volts(0.0), None], Ok(0.0)),
        (false, [volts(5.0), None], Ok(0.5)),
        (false, [volts(10.5), None], Ok(1.0)),
        (false, [Some(4095), None], Err(Lost::End)),
        (false, [None, None], Err(Lost::Silent)),
        (true, [volts(5.0), None], Err(Lost::Silent)),
        (true, [volts(5.0), volts(5.2)], Ok(0.5)),
        (true, [volts(5.2), volts(5.0)], Ok(0.5)),
        (true, [volts(5.0), volts(5.4)], Err(Lost::Differ)),
        (true, [volts(5.4), volts(5.0)], Err(Lost::Differ)),
        (true, [volts(0.0), volts(5.0)], Err(Lost::Differ)),
        (true, [Some(4095), Some(4095)], Err(Lost::End)),
    ] {
        let found = share(Reference::Voltage, &pins(second), [codes[0], codes[1], None]);
        assert_eq!(found.map(|x| (x * 100.0).round() / 100.0), expected, "{codes:?}");
    }
}

/// Above 60 V a signal without a live zero needs a second input.
#[test]
fn a_single_voltage_is_no_reference_at_a_high_dc_link() {
    let mut board = *ALL[0];
    board.terminals.pins[1] = None;
    let check = |reference| Settings { reference, ..Settings::default() }.check(&board);
    let why = check(Reference::Voltage).unwrap_err().to_string();
    assert!(why.starts_with("strip.reference = 0-10v: it has no live zero"), "{why}");
    assert_eq!(check(Reference::Current), Ok(()));
}

/// The wiring of each board, as `docs/terminal-strip.md` has to contain it.
#[test]
fn the_manual_lists_the_terminals() {
    use std::fmt::Write;
    let mut text = String::from("| terminal |");
    let with = || ALL.iter().filter(|board| board.terminals.pins.iter().any(Option::is_some));
    with().for_each(|board| write!(text, " board `{}` |", board.name).unwrap());
    write!(text, "\n|---|{}\n", "---|".repeat(with().count())).unwrap();
    for (n, name) in TERMINALS.into_iter().enumerate() {
        write!(text, "| {name} |").unwrap();
        for board in with() {
            let pin = board.terminals.pins[n].map_or("-".into(), |pin| pin.to_string());
            write!(text, " {pin} |").unwrap();
        }
        text.push('\n');
    }
    generated::check("terminal-strip.md", "terminals", &text);
}
