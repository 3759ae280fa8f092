//! NUCLEO-G474RE with the adapter X-NUCLEO-IHM09M1 and STEVAL-IPMM10B: a SLLIMM module, STIB1060DM2T-L, on one small board
//! with three shunts and their amplifiers.
//!
//! A template: its sources are thin and nobody has tried it. Every step of the bench page comes before mains.

use drive_settings::{Carrier, Ntc};

use super::{Board, DcLinkLimits, Level, assumed, morpho, nucleo_g474re_ihm023v3};

/// The board.
pub const BOARD: Board = Board {
    name: "nucleo-g474re-ipmm10b",
    title: "NUCLEO-G474RE with X-NUCLEO-IHM09M1 and STEVAL-IPMM10B, 1 kW at 230 V (template)",
    high: morpho::high(assumed(
        Level::High,
        "motor supply off: pull each high-side pin up; its gate must go on",
    )),
    // Unlike the drivers L639x, the module's low-side inputs are high for on.
    low: morpho::low(assumed(
        Level::High,
        "motor supply off: pull each low-side pin up; its gate must go on",
    )),
    dead_time_s: assumed(
        1.5e-6,
        "oscilloscope at both gates of a leg, motor supply off: at least 1.0 us between off and on",
    ),
    // Assumed: a module of IGBTs for up to 20 kHz.
    carrier_max_khz: Carrier::Khz18,
    // Shunts of 0.08 ohm and a gain of 2.1 around half the supply (UM2702, page 16). A current into the motor lowers the output.
    currents: morpho::shunts(assumed(-0.08 * 2.1, morpho::SHUNT_STEP), 1.65),
    // The module's own, 85 kOhm (data sheets of the second series of SLLIMM); the rest is assumed.
    ntc: assumed(
        Ntc { ohm_25: 85e3, beta_k: 4092.0, divider_ohm: 12e3, ..Ntc::DEFAULT },
        morpho::NTC_STEP,
    ),
    dc_link_limits: DcLinkLimits {
        operation: assumed(392.0, "the highest supply that the board's page at ST names, less 2 %"),
        switches: assumed(600.0, "data sheet of the module: highest voltage when off"),
        capacitors: assumed(450.0, "the voltage that is printed on the capacitors of your dc link"),
    },
    over_current: Some(assumed(
        "comparator of the module at its shunts, at its shut-down and at the fault input",
        "ground SD/OD of the module: `status` must show the break",
    )),
    pulls: "10 kOhm to ground at all six driver inputs, because the pull resistors inside the module are weak",
    // The same adapter, with its unknown pins for USART3, and a dc link of the same voltage.
    ..nucleo_g474re_ihm023v3::BOARD
};
