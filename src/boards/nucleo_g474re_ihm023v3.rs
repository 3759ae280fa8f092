//! NUCLEO-G474RE with the adapter X-NUCLEO-IHM09M1 and STEVAL-IHM023V3: motors of 230 V to 1 kW, the set that ST names
//! for induction motors.
//!
//! A template: its sources are thin and nobody has tried it. Every step of the bench page comes before mains.

use drive_core::settings::{Line, Ntc};

use super::converter::{CODES, REFERENCE_V};
use super::pin::{pa, pb, pc};
use super::{Analog, Board, Currents, FaultInput, Gates, Level, assumed, read, shunt};

/// Shunt, ohm, and gain of its amplifier: 0.255 V/A. A current into the motor lowers the output.
const V_PER_A: f32 = -0.15 * 1.7;
/// Output of the amplifiers without current, V.
const ZERO_V: f32 = 1.7;

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm023v3",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM09M1 and STEVAL-IHM023V3, 1 kW at 230 V (template)",
    high: Gates { pins: [pa(8), pa(9), pa(10)], on_at: read(Level::High, "L6390 data sheet, HIN") },
    low: Gates {
        pins: [pa(7), pb(0), pb(1)],
        on_at: assumed(
            Level::Low,
            "motor supply off: ground each low-side pin; the gate of that low side must go on",
        ),
    },
    fault: FaultInput {
        pin: pa(6),
        trips_at: assumed(Level::Low, "ground PA6: `status` must show the break"),
    },
    dead_time_s: assumed(
        2.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 1.5 us between off and on",
    ),
    dead_time_range_s: (1.5e-6, 6e-6),
    currents: Currents::LowSide {
        shunts: [
            shunt(pa(0), V_PER_A, ZERO_V),
            shunt(pc(1), V_PER_A, ZERO_V),
            shunt(pc(0), V_PER_A, ZERO_V),
        ],
        settle_s: assumed(
            2e-6,
            "oscilloscope at PA0 beside the gate of low side a: settled within this time",
        ),
    },
    current_delay_s: assumed(
        0.4e-6,
        "rise time of the amplifier's output after a low side goes on",
    ),
    dc_link: Analog {
        pin: pa(1),
        line: assumed(
            // 0.0075 V/V.
            Line { gain: REFERENCE_V / CODES as f32 / 0.0075, offset: 0.0 },
            "10 V at the dc link: `status` must show them within 3 %",
        ),
    },
    heat_sink: pc(2),
    ntc: assumed(Ntc::DEFAULT, "room temperature: `status` must show it within 5 degC"),
    dc_link_v: 311.0,
    highest_dc_link_v: read(400.0, "STEVAL-IHM023V3, supply range"),
    pulls: "none: the drivers hold their inputs off; a pull-down at a low-side input switches that low side on",
};
