//! NUCLEO-G474RE with X-NUCLEO-IHM08M1: up to 48 V while braking, so 42 V nominal; three shunts below the low sides. It is the board to
//! start with: no voltage on it is dangerous to touch.
//!
//! Not tried with a motor yet. Set-up of the jumpers: JP1 and JP2 closed, J5 and J6 at three shunts, JP3 closed, J9 open
//! above 12 V, C3, C5 and C7 removed, JP5 of the Nucleo at E5V.

use drive_settings::{Carrier, Flux};

use super::converter::{CODES, REFERENCE_V};
use super::pin::{pa, pb, pc};
use super::{Board, DcLinkLimits, Level, TerminalPins, Terminals, assumed, morpho, read};

/// The NuttX port to this board, which has run motors: polarity, gain, sign and divider.
const NUTTX: &str = "apache/nuttx, boards/arm/stm32/common/src/stm32_ihm08m1.c";

#[rustfmt::skip] // All pins that the board leaves free beside PB4, PB6 and PB8: REFERENCE and the motor's sensor; ENABLE, START, STOP, RESET.
const TERMINALS: TerminalPins = [
    Some(pb(12)), None, Some(pb(13)),
    Some(pb(5)), Some(pb(7)), Some(pb(9)), None, Some(pc(7)), None, None,
    None, None, None,
];

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm08m1",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM08M1, supply 42 V",
    high: morpho::high(read(Level::High, "L6398 data sheet, HIN")),
    low: morpho::low(read(Level::Low, NUTTX)),
    fault: morpho::FAULT,
    // The driver adds 320 ns of its own.
    dead_time_s: assumed(
        1.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 0.5 us between off and on",
    ),
    dead_time_max_s: 3e-6,
    // Assumed: MOSFETs, which ST's own motor control switches at 16 to 30 kHz.
    carrier_max_khz: Carrier::Khz18,
    // Shunt, ohm, and gain of its amplifier: 51.8 mV/A. A current into the motor lowers the output.
    currents: morpho::shunts(read(-0.010 * 5.18, NUTTX), 1.71),
    current_delay_s: morpho::CURRENT_DELAY_S,
    // A divider of 169 and 9.31 kOhm.
    dc_link: morpho::dc_link(read(19.15 * REFERENCE_V / CODES as f32, NUTTX)),
    heat_sink: morpho::HEAT_SINK,
    ntc: morpho::ntc(4700.0),
    // Braking raises the link by 14 %, to the maximum operating voltage.
    dc_link_v: 42.0,
    flux: Flux::High,
    dc_link_limits: DcLinkLimits {
        operation: read(48.0, "UM1996, supply range"),
        switches: read(60.0, "STL220N6F7 data sheet, drain to source"),
        capacitors: assumed(63.0, "the voltage that is printed on the capacitors at the supply"),
    },
    // The sources disagree on what sets the comparator's threshold: a divider, or a voltage at PB4.
    over_current: Some(assumed(
        "comparator on the shunts, about 30 A, at the fault input",
        "CURRENT REF (CN10-27) must have a voltage; below it the comparator does not trip",
    )),
    // Tied to the fault input (PA11, PB14) and to the low side of leg a (PB15).
    analog_only: &[pa(11), pb(14), pb(15)],
    bus: Some(morpho::BUS),
    terminals: Terminals::of(TERMINALS),
    wiring: morpho::NUCLEO,
    pulls: morpho::PULLS,
};
