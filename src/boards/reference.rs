//! The inverter of the dissertation on ST's morpho motor-control pins.

use drive_core::settings::{Flux, Line};

use super::converter::calibrated;
use super::{Analog, Board, Currents, Gates, Level, assumed, morpho, read};

/// The board.
pub const BOARD: Board = Board {
    name: "reference",
    title: "NUCLEO-G474RE with the inverter and the current sensors of the dissertation",
    high: Gates {
        pins: morpho::HIGH,
        on_at: assumed(
            Level::High,
            "power stage off: pull each high-side input up; its gate must go on",
        ),
    },
    low: Gates {
        pins: morpho::LOW,
        on_at: assumed(
            Level::High,
            "power stage off: pull each low-side input up; its gate must go on",
        ),
    },
    fault: morpho::fault("ground the fault input: `status` must show the break"),
    // Both switches of a leg are off for this long at every change.
    dead_time_s: read(2.2e-6, "dissertation, section 3.9"),
    // The needs of fast and slow power modules.
    dead_time_range_s: (0.5e-6, 6e-6),
    currents: Currents::InLine([
        Analog {
            pin: morpho::CURRENTS[0],
            line: read(calibrated(Line::CHANNEL_A), "dissertation, Eq. 3.5 and 3.4"),
        },
        Analog {
            pin: morpho::CURRENTS[1],
            line: read(calibrated(Line::CHANNEL_B), "dissertation, Eq. 3.5 and 3.4"),
        },
    ]),
    current_delay_s: read(30e-6, "dissertation, Figure 16: a filter of 5305 Hz"),
    // A divider by 136.5, so that 450 V are full scale. The dissertation does not describe its own.
    dc_link: morpho::dc_link(
        0.11,
        "10 V at the dc link: `status` must show them within 3 %; otherwise set scales.dc_link.gain",
    ),
    heat_sink: morpho::HEAT_SINK,
    ntc: morpho::NTC,
    dc_link_v: 311.0,
    flux: Flux::Low,
    highest_dc_link_v: assumed(450.0, "the voltage of the capacitors and of the switches"),
    bus: Some(morpho::BUS),
    pulls: "pull-down resistors of 10 kOhm at all six driver inputs",
};
