//! The table of [`Trust`] in every state and mode.

use super::*;
use crate::drive::trust::{Judged, Lock, Source, Trust};

const STATES: [State; 17] = [
    State::Off,
    State::Calibrating,
    State::Precharge,
    State::CheckingWiring,
    State::Exciting,
    State::Catching,
    State::Magnetising,
    State::Verifying,
    State::Torque,
    State::Speed,
    State::Position,
    State::VoltsPerHertz,
    State::Learning,
    State::Braking,
    State::BrakingByFrequency,
    State::Stopping,
    State::Fault(Fault::Break),
];

/// A row of the table, but for its name.
fn row(trust: &Trust) -> String {
    let source = match trust.source {
        Source::Slip => "slip, shaft locked",
        Source::Nothing => "nothing, carrier off",
        Source::Injection => "injection",
        Source::Both => "injection and voltage",
    };
    let frame = if trust.turns { "turns" } else { "stands" };
    let lock = match trust.lock {
        Lock::Off => "off",
        Lock::Baseline => "baseline",
        Lock::OwnBaseline => "baseline, unless one is kept",
        Lock::Watch => "watches",
    };
    let current = match trust.current {
        Judged::No => "no",
        Judged::Tolerantly => "tolerantly",
        Judged::Strictly => "strictly",
    };
    let mean = if trust.mean { "judged" } else { "begins anew" };
    let resistance = match (trust.resistance, trust.drop) {
        (true, false) => "by flux or injection",
        (false, true) => "with the drop of the inverter",
        (false, false) => "kept",
        (true, true) => panic!("two ways to the resistance"),
    };
    format!("{source} | {frame} | {lock} | {current} | {mean} | {resistance} |")
}

/// Each state and mode has its row in docs/control-law.md, and no other row is there.
#[test]
fn what_may_be_believed_is_a_row_for_every_state_and_mode() {
    let mut settings = Settings::default();
    (settings.observer.enabled, settings.sequence.catch) = (true, true);
    let mut drive = Drive::new(settings.build().unwrap());
    let alone = drive.c.catching.unwrap().alone;
    let mut table = std::collections::BTreeMap::<&str, String>::new();
    let mut note = |name: &'static str, trust: &Trust| {
        let row = row(trust);
        assert_eq!(*table.entry(name).or_insert_with(|| row.clone()), row, "{name}");
    };
    for (state, mode) in STATES.into_iter().flat_map(|state| MODES.map(|mode| (state, mode))) {
        (drive.state, drive.mode) = (state, mode);
        let learns = mode == Mode::Learning;
        let name = match state {
            State::Catching => {
                for (found, elapsed, name) in [
                    (None, 5, "looking for a turning shaft"),
                    (Some(7), 7 + alone - 1, "the same, found"),
                    (Some(7), 7 + alone, "the same, 0.2 s later"),
                ] {
                    (drive.control.catching.found, drive.elapsed) = (found, elapsed);
                    note(name, &drive.trust());
                }
                continue;
            }
            State::Magnetising if learns => "magnetising to learn",
            State::Magnetising => "magnetising",
            State::Learning => "learning, and stopping from it",
            State::Stopping if learns => "learning, and stopping from it",
            State::Verifying
            | State::Torque
            | State::Speed
            | State::Position
            | State::Braking
            | State::Stopping => "verifying, regulating, stopping",
            State::Off
            | State::Calibrating
            | State::Precharge
            | State::CheckingWiring
            | State::Exciting
            | State::VoltsPerHertz
            | State::BrakingByFrequency
            | State::Fault(_) => "without a frame of the flux",
        };
        note(name, &drive.trust());
    }
    let manual = include_str!("../../../../docs/control-law.md");
    let (_, after) = manual.split_once("| phase | angle by | frame |").expect("the table");
    let rows: Vec<_> = after.lines().skip(2).take_while(|line| line.starts_with('|')).collect();
    for (name, row) in &table {
        let line = format!("| {name} | {row}");
        assert!(rows.contains(&line.as_str()), "not in docs/control-law.md: {line}");
    }
    assert_eq!(rows.len(), table.len());
}
