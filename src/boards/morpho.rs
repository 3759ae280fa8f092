//! ST's morpho connector for motor control, to which all boards here connect their signals, and ST's power boards on it. These have
//! drivers L639x, which switch a low side on at a low level, and three shunts below the low sides.

use drive_core::Line;
use drive_settings::Ntc;

use super::converter::{CODES, REFERENCE_V};
use super::pin::{Pin, pa, pb, pc};
use super::{Analog, Currents, FaultInput, Gates, Level, Rs485, Shunts, Stated, Wiring, assumed};

/// Low sides.
pub const LOW: [Pin; 3] = [pa(7), pb(0), pb(1)];
/// Phase currents.
pub const CURRENTS: [Pin; 3] = [pa(0), pc(1), pc(0)];
/// Thermistor.
pub const HEAT_SINK: Pin = pc(2);
/// The port of the field bus: three pins beside each other on CN7, which the boards here do not use.
pub const BUS: Rs485 = Rs485 { transmit: pc(10), receive: pc(11), driver: pc(12) };

/// The connections of a NUCLEO-G474RE. The console is the ST-LINK's serial port.
pub const NUCLEO: Wiring = Wiring {
    crystal_hz: 24_000_000,
    console: [pa(2), pa(3)],
    encoder: [pa(15), pb(3)],
    chopper: pc(6),
    relay: pc(8),
};

/// Bench step of a shunt.
pub const SHUNT_STEP: &str =
    "1 A of a laboratory supply through each shunt: `status` must show it, with its sign";
/// Bench step of a thermistor.
pub const NTC_STEP: &str = "room temperature: `status` must show it within 5 degC, and more with a finger on the heat sink";

/// The high sides, which are on at this level.
pub const fn high(on_at: Stated<Level>) -> Gates {
    Gates { pins: [pa(8), pa(9), pa(10)], on_at }
}

/// The low sides, which are on at this level.
pub const fn low(on_at: Stated<Level>) -> Gates {
    Gates { pins: LOW, on_at }
}

/// A thermistor with this resistor in series. If the topology differs, the temperature is wrong or falls when it should rise.
pub const fn ntc(divider_ohm: f32) -> Stated<Ntc> {
    assumed(Ntc { divider_ohm, ..Ntc::DEFAULT }, NTC_STEP)
}

/// A fault output that pulls the fault input low, and its pull-up.
pub const fn fault(bench_step: &'static str) -> FaultInput {
    FaultInput {
        pin: pa(6),
        trips_at: assumed(Level::Low, bench_step),
        pull_ohm: assumed(
            4.7e3,
            "firmware running, no fault: at least 2.6 V at the fault input; otherwise 4.7 kOhm from it to 3.3 V",
        ),
    }
}

/// The dc link, with this many volts per ADC count.
pub const fn dc_link(gain: Stated<f32>) -> Analog {
    let line = Line { gain: gain.value, offset: 0.0 };
    Analog { pin: pa(1), line: Stated { value: line, source: gain.source } }
}

/// The fault output of a power board of ST.
pub const FAULT: FaultInput = fault("ground PA6: `status` must show the break");
/// Delay of the amplifiers, s.
pub const CURRENT_DELAY_S: Stated<f32> =
    assumed(0.4e-6, "rise time of the amplifier's output after a low side goes on");
/// Advice on resistors.
pub const PULLS: &str = "10 kOhm to 3.3 V at each low-side input, 10 kOhm to ground at each high-side input, because the pull resistors inside the drivers are weak";

/// Shunts below the low sides. Their amplifiers give `zero_v` without current and `v_per_a` more for each ampere into the motor, V.
pub const fn shunts(v_per_a: Stated<f32>, zero_v: f32) -> Currents {
    let value = Line::of_sensor(v_per_a.value, zero_v, REFERENCE_V, CODES);
    let line = Stated { value, source: v_per_a.source };
    let [a, b, c] = CURRENTS;
    let settle_s = assumed(
        2e-6,
        "oscilloscope at PA0 beside the gate of low side a: settled within this time",
    );
    Currents {
        a: Analog { pin: a, line },
        b: Analog { pin: b, line },
        shunts: Some(Shunts { c: Analog { pin: c, line }, settle_s }),
    }
}
