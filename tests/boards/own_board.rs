//! The power stage of the reference board at an STM32G474RE on its own circuit board. Every pin that can be elsewhere is elsewhere, the
//! crystal is another one, and the dc link is at comparator 3. The tests prove with it that no pin is fixed.

use super::pin::{pa, pb, pc};
use super::{Analog, Board, Currents, FaultInput, Gates, Terminals, Wiring, reference};

/// The reference board, whose power stage this is.
const REFERENCE: Board = reference::BOARD;

/// The board.
pub const BOARD: Board = Board {
    name: "own-board",
    title: "STM32G474RE on its own circuit board, with the inverter of the reference (example)",
    high: Gates { pins: [pc(0), pc(1), pc(2)], ..REFERENCE.high },
    low: Gates { pins: [pb(13), pb(14), pb(15)], ..REFERENCE.low },
    fault: FaultInput { pin: pb(12), ..REFERENCE.fault },
    currents: Currents {
        a: Analog { pin: pa(1), ..REFERENCE.currents.a },
        b: Analog { pin: pa(7), ..REFERENCE.currents.b },
        shunts: None,
    },
    dc_link: Analog { pin: pa(0), ..REFERENCE.dc_link },
    heat_sink: pa(6),
    terminals: Terminals::NONE,
    // Chopper and relay stay away from PA15, PB4 and PB6, which have resistors of the chip after a reset.
    wiring: Wiring {
        crystal_hz: 8_000_000,
        console: [pb(11), pb(10)],
        encoder: [pa(5), pb(3)],
        relay: pc(9),
        ..REFERENCE.wiring
    },
    ..REFERENCE
};
