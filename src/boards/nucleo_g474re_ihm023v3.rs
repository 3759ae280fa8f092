//! NUCLEO-G474RE with the adapter X-NUCLEO-IHM09M1 and STEVAL-IHM023V3: motors of 230 V to 1 kW, the set that ST names
//! for induction motors.
//!
//! A template: its sources are thin and nobody has tried it. Every step of the bench page comes before mains.

use drive_core::settings::Flux;

use super::converter::{CODES, REFERENCE_V};
use super::{Board, Gates, Level, assumed, morpho, read};

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm023v3",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM09M1 and STEVAL-IHM023V3, 1 kW at 230 V (template)",
    high: Gates { pins: morpho::HIGH, on_at: read(Level::High, "L6390 data sheet, HIN") },
    low: morpho::LOW_SIDES,
    fault: morpho::FAULT,
    dead_time_s: assumed(
        2.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 1.5 us between off and on",
    ),
    dead_time_range_s: (1.5e-6, 6e-6),
    // Shunt, ohm, and gain of its amplifier: 0.255 V/A. A current into the motor lowers the output.
    currents: morpho::shunts(-0.15 * 1.7, 1.7),
    current_delay_s: morpho::CURRENT_DELAY_S,
    // 0.0075 V/V.
    dc_link: morpho::dc_link(REFERENCE_V / CODES as f32 / 0.0075, morpho::DC_LINK_STEP),
    heat_sink: morpho::HEAT_SINK,
    ntc: morpho::NTC,
    dc_link_v: 311.0,
    flux: Flux::High,
    highest_dc_link_v: read(400.0, "STEVAL-IHM023V3, supply range"),
    // Whether the adapter leaves pins of USART3 free is not known.
    bus: None,
    pulls: morpho::PULLS,
};
