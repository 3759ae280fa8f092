//! NUCLEO-G474RE with X-NUCLEO-IHM08M1: 10 to 48 V, three shunts below the low sides. The board to start with: no
//! voltage on it is dangerous to touch.
//!
//! Not tried with a motor yet. Set-up of the jumpers: JP1 and JP2 closed, J5 and J6 at three shunts, JP3 closed, J9 open
//! above 12 V, C3, C5 and C7 removed, JP5 of the Nucleo at E5V.

use drive_core::settings::{Line, Ntc};

use super::converter::{CODES, REFERENCE_V};
use super::pin::{pa, pb, pc};
use super::{Analog, Board, Currents, FaultInput, Gates, Level, assumed, read, shunt};

/// Shunt, ohm, and gain of its amplifier: 51.8 mV/A. A current into the motor lowers the output.
const V_PER_A: f32 = -0.010 * 5.18;
/// Output of the amplifiers without current, V.
const ZERO_V: f32 = 1.71;

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm08m1",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM08M1, 10 to 48 V",
    high: Gates { pins: [pa(8), pa(9), pa(10)], on_at: read(Level::High, "L6398 data sheet, HIN") },
    low: Gates {
        pins: [pa(7), pb(0), pb(1)],
        // The data sheet of the driver says so; whether the board inverts between Nucleo and driver is not known.
        on_at: assumed(
            Level::Low,
            "motor supply off: ground each low-side pin; the gate of that low side must go on",
        ),
    },
    fault: FaultInput {
        pin: pa(6),
        trips_at: assumed(Level::Low, "ground PA6: `status` must show the break"),
    },
    // The driver adds 320 ns of its own.
    dead_time_s: assumed(
        1.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 0.5 us between off and on",
    ),
    dead_time_range_s: (0.5e-6, 3e-6),
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
        // A divider of 169 and 9.31 kOhm.
        line: assumed(
            Line { gain: 19.15 * REFERENCE_V / CODES as f32, offset: 0.0 },
            "10 V at the dc link: `status` must show them within 3 %",
        ),
    },
    heat_sink: pc(2),
    ntc: assumed(Ntc::DEFAULT, "room temperature: `status` must show it within 5 degC"),
    dc_link_v: 48.0,
    highest_dc_link_v: read(60.0, "STL220N6F7 data sheet, drain to source"),
    pulls: "none: the drivers hold their inputs off; a pull-down at a low-side input switches that low side on",
};
