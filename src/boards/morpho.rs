//! ST's morpho connector for motor control, where all boards here have their signals, and the power boards of ST at it:
//! drivers L639x, which switch a low side on at a low level, and three shunts below the low sides.

use drive_core::settings::{Line, Ntc};

use super::converter::{CODES, REFERENCE_V};
use super::pin::{Pin, pa, pb, pc};
use super::{Analog, Currents, FaultInput, Gates, Level, Rs485, Stated, assumed};

/// High sides.
pub const HIGH: [Pin; 3] = [pa(8), pa(9), pa(10)];
/// Low sides.
pub const LOW: [Pin; 3] = [pa(7), pb(0), pb(1)];
/// Phase currents.
pub const CURRENTS: [Pin; 3] = [pa(0), pc(1), pc(0)];
/// Thermistor.
pub const HEAT_SINK: Pin = pc(2);
/// The port of the field bus: three pins beside each other on CN7, which the boards here do not use.
pub const BUS: Rs485 = Rs485 { transmit: pc(10), receive: pc(11), driver: pc(12) };
/// The thermistor of the dissertation.
pub const NTC: Stated<Ntc> =
    assumed(Ntc::DEFAULT, "room temperature: `status` must show it within 5 degC");

/// A fault output that pulls PA6 low.
pub const fn fault(bench_step: &'static str) -> FaultInput {
    FaultInput { pin: pa(6), trips_at: assumed(Level::Low, bench_step) }
}

/// The dc link, with this many volts a code.
pub const fn dc_link(gain: f32, bench_step: &'static str) -> Analog {
    Analog { pin: pa(1), line: assumed(Line { gain, offset: 0.0 }, bench_step) }
}

/// The low sides of a driver L639x.
// The data sheet of the driver says so; whether a board inverts between Nucleo and driver is not known.
pub const LOW_SIDES: Gates = Gates {
    pins: LOW,
    on_at: assumed(
        Level::Low,
        "motor supply off: ground each low-side pin; the gate of that low side must go on",
    ),
};
/// The fault output of a power board of ST.
pub const FAULT: FaultInput = fault("ground PA6: `status` must show the break");
/// Delay of the amplifiers, s.
pub const CURRENT_DELAY_S: Stated<f32> =
    assumed(0.4e-6, "rise time of the amplifier's output after a low side goes on");
/// Bench step for the scale of the dc link.
pub const DC_LINK_STEP: &str = "10 V at the dc link: `status` must show them within 3 %";
/// Advice on resistors.
pub const PULLS: &str = "none: the drivers hold their inputs off; a pull-down at a low-side input switches that low side on";

/// Shunts below the low sides, with amplifiers that give `zero_v` without current and `v_per_a` more for each ampere into
/// the motor, V.
pub const fn shunts(v_per_a: f32, zero_v: f32) -> Currents {
    let line = assumed(
        Line::of_sensor(v_per_a, zero_v, REFERENCE_V, CODES),
        "1 A of a laboratory supply through each shunt: `status` must show it, with its sign",
    );
    let [a, b, c] = CURRENTS;
    Currents::LowSide {
        shunts: [Analog { pin: a, line }, Analog { pin: b, line }, Analog { pin: c, line }],
        settle_s: assumed(
            2e-6,
            "oscilloscope at PA0 beside the gate of low side a: settled within this time",
        ),
    }
}
