//! NUCLEO-G474RE with the adapter X-NUCLEO-IHM09M1 and STEVAL-IPM10B: a SLLIMM module of IGBTs, STGIB10CH60TS-L, with three shunts. The
//! dc link with its capacitors is outside.
//!
//! A template: its sources are thin and nobody has tried it. Every step of the bench page comes before mains.

use super::converter::CODES;
use super::{Board, DcLinkLimits, assumed, morpho, nucleo_g474re_ipmm10b, read};

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ipm10b",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM09M1 and STEVAL-IPM10B, 1.2 kW at 230 V (template)",
    // The amplifiers reach 1.65 V at 25 A, the peak of the module.
    currents: morpho::shunts(assumed(-1.65 / 25.0, morpho::SHUNT_STEP), 1.65),
    dc_link: morpho::dc_link(read(415.8 / CODES as f32, "ST MC library 2016, motor profiler")),
    // Below the range of the divider, so that both trips lie within it.
    dc_link_limits: DcLinkLimits {
        operation: assumed(380.0, "the voltage that all dc-link parts withstand continuously"),
        switches: read(600.0, "STGIB10CH60TS-L data sheet, collector to emitter"),
        capacitors: assumed(425.0, "at least this voltage is printed on the capacitors"),
    },
    // The same inputs, thermistor, comparator and adapter.
    ..nucleo_g474re_ipmm10b::BOARD
};
