//! The inverter of the dissertation on ST's morpho motor-control pins.

use drive_core::Line;
use drive_settings::{Carrier, Flux};

use super::converter::calibrated;
use super::pin::{pa, pb, pc};
use super::{
    Analog, Board, Currents, DcLinkLimits, Level, TerminalPins, Terminals, assumed, morpho, read,
};

#[rustfmt::skip] // Two references and the motor's sensor, each at an ADC; contacts; outputs.
const TERMINALS: TerminalPins = [
    Some(pb(12)), Some(pb(13)), Some(pb(14)),
    Some(pb(5)), Some(pb(7)), Some(pb(9)), Some(pb(10)), Some(pb(11)), Some(pc(4)), Some(pc(5)),
    Some(pc(7)), Some(pc(9)), Some(pa(12)),
];

/// The calibration lines of the current sensors.
const LINES: &str = "dissertation, Eq. 3.5 and 3.4";

/// The board.
pub const BOARD: Board = Board {
    name: "reference",
    title: "NUCLEO-G474RE with the inverter and the current sensors of the dissertation",
    high: morpho::high(assumed(
        Level::High,
        "power stage off: pull each high-side input up; its gate must go on",
    )),
    low: morpho::low(assumed(
        Level::High,
        "power stage off: pull each low-side input up; its gate must go on",
    )),
    fault: morpho::fault("ground the fault input: `status` must show the break"),
    // Both switches of a leg are off for this time at every change.
    dead_time_s: read(2.2e-6, "dissertation, section 3.9"),
    // Slow power modules need up to this dead time.
    dead_time_max_s: 6e-6,
    // Assumed: the dissertation names no switches; the heat sink shows whether they withstand the losses.
    carrier_max_khz: Carrier::Khz18,
    currents: Currents {
        a: Analog { pin: morpho::CURRENTS[0], line: read(calibrated(Line::CHANNEL_A), LINES) },
        b: Analog { pin: morpho::CURRENTS[1], line: read(calibrated(Line::CHANNEL_B), LINES) },
        shunts: None,
    },
    current_delay_s: read(30e-6, "dissertation, Figure 16: a filter of 5305 Hz"),
    // A divider by 136.5, so that 450 V are full scale. The dissertation does not describe its own.
    dc_link: morpho::dc_link(assumed(
        0.11,
        "10 V at the dc link: `status` must show them within 3 %; otherwise set scales.dc_link.gain",
    )),
    heat_sink: morpho::HEAT_SINK,
    ntc: morpho::ntc(4700.0),
    dc_link_v: 311.0,
    flux: Flux::Low,
    // With another divider all three voltages scale with it.
    dc_link_limits: DcLinkLimits {
        operation: assumed(392.0, "the voltage that all dc-link parts withstand continuously"),
        switches: assumed(600.0, "data sheet of the switches: highest voltage when off"),
        capacitors: assumed(450.0, "the voltage that is printed on the capacitors"),
    },
    over_current: Some(assumed(
        "required of the power stage, at the fault input",
        "inject a current above limits.trip_a into its detector: `status` must show the break",
    )),
    analog_only: &[],
    bus: Some(morpho::BUS),
    // PB4 and PB6 have the pull-downs of USB-C after a reset, PB8 selects the program that starts.
    terminals: Terminals::of(TERMINALS),
    wiring: morpho::NUCLEO,
    pulls: "pull-down resistors of 10 kOhm at all six driver inputs",
};
