//! NUCLEO-G474RE with X-NUCLEO-IHM08M1: 10 to 48 V, three shunts below the low sides. The board to start with: no
//! voltage on it is dangerous to touch.
//!
//! Not tried with a motor yet. Set-up of the jumpers: JP1 and JP2 closed, J5 and J6 at three shunts, JP3 closed, J9 open
//! above 12 V, C3, C5 and C7 removed, JP5 of the Nucleo at E5V.

use drive_core::settings::Flux;

use super::converter::{CODES, REFERENCE_V};
use super::{Board, Gates, Level, assumed, morpho, read};

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm08m1",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM08M1, 10 to 48 V",
    high: Gates { pins: morpho::HIGH, on_at: read(Level::High, "L6398 data sheet, HIN") },
    low: morpho::LOW_SIDES,
    fault: morpho::FAULT,
    // The driver adds 320 ns of its own.
    dead_time_s: assumed(
        1.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 0.5 us between off and on",
    ),
    dead_time_range_s: (0.5e-6, 3e-6),
    // Shunt, ohm, and gain of its amplifier: 51.8 mV/A. A current into the motor lowers the output.
    currents: morpho::shunts(-0.010 * 5.18, 1.71),
    current_delay_s: morpho::CURRENT_DELAY_S,
    // A divider of 169 and 9.31 kOhm.
    dc_link: morpho::dc_link(19.15 * REFERENCE_V / CODES as f32, morpho::DC_LINK_STEP),
    heat_sink: morpho::HEAT_SINK,
    ntc: morpho::NTC,
    dc_link_v: 48.0,
    flux: Flux::High,
    highest_dc_link_v: read(60.0, "STL220N6F7 data sheet, drain to source"),
    bus: Some(morpho::BUS),
    pulls: morpho::PULLS,
};
