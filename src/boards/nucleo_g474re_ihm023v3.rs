//! NUCLEO-G474RE with the adapter X-NUCLEO-IHM09M1 and STEVAL-IHM023V3: motors of 230 V to 1 kW, the set that ST names
//! for induction motors.
//!
//! A template: its sources are thin and nobody has tried it. Every step of the bench page comes before mains.

use drive_settings::{Carrier, Flux};

use super::converter::{CODES, REFERENCE_V};
use super::{Board, DcLinkLimits, Level, Terminals, assumed, morpho, read};

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ihm023v3",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM09M1 and STEVAL-IHM023V3, 1 kW at 230 V (template)",
    high: morpho::high(read(Level::High, "L6390 data sheet, HIN")),
    // The data sheet of the driver says so; whether the adapter inverts is not known.
    low: morpho::low(assumed(
        Level::Low,
        "motor supply off: ground each low-side pin; the gate of that low side must go on",
    )),
    fault: morpho::FAULT,
    dead_time_s: assumed(
        2.0e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 1.5 us between off and on",
    ),
    dead_time_max_s: 6e-6,
    // Assumed: IGBTs for up to 20 kHz.
    carrier_max_khz: Carrier::Khz18,
    // Shunt, ohm, and gain of its amplifier: 0.255 V/A. A current into the motor lowers the output.
    currents: morpho::shunts(assumed(-0.15 * 1.7, morpho::SHUNT_STEP), 1.7),
    current_delay_s: morpho::CURRENT_DELAY_S,
    // 0.0075 V/V.
    dc_link: morpho::dc_link(assumed(
        REFERENCE_V / CODES as f32 / 0.0075,
        "130 V at the dc link: `status` must show them within 3 %",
    )),
    heat_sink: morpho::HEAT_SINK,
    // R44.
    ntc: morpho::ntc(3600.0),
    dc_link_v: 311.0,
    flux: Flux::High,
    dc_link_limits: DcLinkLimits {
        operation: read(392.0, "STEVAL-IHM023V3, supply range up to 400 V, less 2 %"),
        switches: read(600.0, "STGP10H60DF data sheet, collector to emitter"),
        capacitors: assumed(450.0, "the voltage that is printed on the capacitors"),
    },
    over_current: Some(assumed(
        "comparators of the drivers L6390, at their shut-down and at the fault input",
        "ground SD/OD of a driver: `status` must show the break",
    )),
    analog_only: &[],
    // Whether the adapter leaves pins of USART3 free is not known.
    bus: None,
    terminals: Terminals::NONE,
    wiring: morpho::NUCLEO,
    pulls: morpho::PULLS,
};
