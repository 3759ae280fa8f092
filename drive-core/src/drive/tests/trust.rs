//! Test of the table of [`Trust`] in every phase of the flux and for every source of the angle.

use super::*;
use crate::carrier::at_start::AtStartState;
use crate::drive::trust::{Check, Lock, Trust};
use crate::flux::catch::{CatchState, Origin, Try};
use crate::flux::hand_over::Source;

const BUILT: crate::blocks::Catch = crate::blocks::Catch::IN_BUILD.unwrap();

/// Returns a row of the table without its name.
fn row(trust: &Trust) -> String {
    let source = match trust.source {
        Source::Slip => "slip, shaft locked",
        Source::Nothing => "nothing, injection off",
        Source::Injection => "injection",
        Source::Both => "injection and voltage",
    };
    let frame = if trust.rotates { "rotating" } else { "fixed" };
    let lock = match trust.lock {
        Lock::Off => "off",
        Lock::Baseline => "baseline",
        Lock::Watch => "watches",
    };
    let current = match trust.current {
        Check::Off => "no",
        Check::Wide => "wide threshold",
        Check::Narrow => "normal threshold",
    };
    let mean = if trust.mean_voltage { "judged" } else { "restarts" };
    let resistance = match (trust.resistance, trust.measures_drop) {
        (true, false) => "by flux or injection",
        (false, true) => "with the inverter voltage error",
        (false, false) => "kept",
        (true, true) => panic!("two ways to the resistance"),
    };
    format!("{source} | {frame} | {lock} | {current} | {mean} | {resistance} |")
}

/// Each phase of the flux and each frame has its row in docs/control-law.md.
#[test]
fn every_phase_and_frame_has_a_row_of_valid_estimates() {
    let mut settings = Settings::default();
    (settings.observer.enabled, settings.sequence.flying_start) = (true, true);
    let c = settings.build().unwrap();
    let alone = c.flying_start.unwrap().injection_only;
    let fixed = Try { _built: BUILT, from: Origin::Fixed, freq: 0.0, steps: 0 };
    let rotating = Try { from: Origin::Run, freq: 0.01, ..fixed };
    let phases = [
        (FluxPhase::Search(CatchState::new(fixed)), 5),
        (FluxPhase::Search(CatchState::new(rotating)), 5),
        (FluxPhase::Asymmetry(AtStartState::new(false)), 5),
        (FluxPhase::Build { from: 7, at: fixed }, 7 + alone - 1),
        (FluxPhase::Build { from: 7, at: fixed }, 7 + alone),
        (FluxPhase::Hold, 5),
        (FluxPhase::Verify, 5),
        (FluxPhase::ready(), 5),
        (FluxPhase::Learn(Default::default()), 5),
    ];
    let mut table = Vec::<(&str, String)>::new();
    for (number, (flux, elapsed)) in phases.into_iter().enumerate() {
        for frame in [Frame::Encoder, Frame::LockedShaft, Frame::Tracked] {
            let field = Field { flux: flux.clone(), frame, ..Field::default() };
            let name = match (number, frame) {
                (0, _) => "flying start, search in a fixed frame",
                (1, _) => "flying start, search in a rotating frame",
                (2, _) => "at rest, the asymmetry is measured",
                (3, _) => "rotating shaft, found in a fixed frame",
                (4, _) => "0.2 s later, or found in a rotating frame",
                (5, Frame::LockedShaft) => "magnetising to learn",
                (5, Frame::Encoder | Frame::Tracked) => "magnetising",
                (_, Frame::LockedShaft) => "learning, and stopping from it",
                (_, Frame::Encoder | Frame::Tracked) => "verifying, regulating, stopping",
            };
            let row = row(&c.trust(&field, elapsed));
            match table.iter().find(|(known, _)| *known == name) {
                Some((_, known)) => assert_eq!(*known, row, "{name}"),
                None => table.push((name, row)),
            }
        }
    }
    let head = "| phase | angle by | frame | lock monitor | current against voltage | its mean | stator resistance |";
    let rows = table.iter().map(|(name, row)| format!("| {name} | {row}\n"));
    let rows = rows.collect::<String>();
    crate::generated::check(
        "control-law.md",
        "trust",
        &format!("{head}\n|---|---|---|---|---|---|---|\n{rows}"),
    );
}
