//! The boards, each with its sources. "Assumed" marks a value that no source gives.

use drive_settings::Ntc;
use stm32g4_unicorn::circuit::{Pull, Source};

use super::driver::{Driver, Input};
use super::shunts::Shunts;
use super::{GateLimits, PowerStage, Switches, Wiring};

/// All boards.
pub const ALL: [&PowerStage; 6] = [&REFERENCE, &IHM08M1, &IHM023V3, &IPMM10B, &IPM10B, &OWN_BOARD];

/// A NUCLEO-G474RE, whose motor-control pins on ST's morpho connector are the same for all power boards (UM2505).
const NUCLEO: Wiring = Wiring {
    gates: [[((0, 8), 6), ((0, 7), 6)], [((0, 9), 6), ((1, 0), 6)], [((0, 10), 6), ((1, 1), 6)]],
    fault: ((0, 6), 6),
    // PA0, PC1, PC0, PA1, PC2.
    currents: [1, 7, 6],
    dc_link: 2,
    heat_sink: 8,
    relay: (2, 8),
    crystal_hz: 24_000_000,
};

/// TTL levels: below 0.8 V is low, above 2.0 V high.
const TTL: (f64, f64) = (0.8, 2.0);
/// L6398 (data sheet, p. 8: low up to 0.8 V, high above 1.9 to 2.25 V, depending on the part), and L6390 (p. 11) alike.
const L639X: (f64, f64) = (0.8, 2.25);
/// Ringing at a turn-off: 20 nH of the loop, and a current that falls in 40 ns (assumed).
const RINGING: f64 = 20e-9 / 40e-9;

/// HIN of L6398 and L6390: active high; its pull-down draws 260 uA at most from 15 V (L6390 data sheet, p. 11),
/// typically 175 uA.
const HIN: Input = Input {
    on_at_high: true,
    pull: Some(Pull { volts: 0.0, ohm: 15.0 / 175e-6 }),
    thresholds: L639X,
};
/// LIN of L6398 and L6390: active low; it draws 3 to 20 uA at logic 0 and almost nothing at logic 1 (L6398 data sheet,
/// p. 8), so it has a pull-up. Its voltage is assumed to be 5 V, its current 6 uA.
const LIN: Input = Input {
    on_at_high: false,
    pull: Some(Pull { volts: 5.0, ohm: 5.0 / 6e-6 }),
    thresholds: L639X,
};

/// An active-high TTL input with the external pull-down of 10 kOhm that the documentation requires.
const PULLED_DOWN: Input =
    Input { on_at_high: true, pull: Some(Pull { volts: 0.0, ohm: 10e3 }), thresholds: TTL };

/// Amplifiers of shunts, without their scale.
const AMPLIFIERS: Shunts = Shunts {
    volts_per_a: 0.0,
    zero_v: 0.0,
    // TSV994: rail to rail, 10 mV from its supply (assumed).
    rails_v: (0.010, 3.29),
    // Assumed: filter and slew of the amplifier.
    settling_s: 0.4e-6,
    // Resistors of 1 % (assumed): one error of each sign, the third without.
    gain_error: [0.004, -0.004, 0.0],
    // Offset of the amplifiers through the gain (assumed), V.
    offset_v: [2e-3, -2e-3, 1e-3],
    // One ADC count, rms (assumed).
    noise_v: 0.0008,
};

/// The inverter of the dissertation, with sensors in the lines a and b. The other boards use its values for everything
/// that they do not state. The dissertation does not describe its drivers: inputs active high with external pull-downs
/// of 10 kOhm, as the documentation requires, without interlock.
pub const REFERENCE: PowerStage = PowerStage {
    name: "reference",
    wiring: NUCLEO,
    driver: Driver { high: PULLED_DOWN, low: PULLED_DOWN, interlock: false, dead_time_s: 0.0 },
    // 2.2 us (section 3.9). A microsecond, minus the rounding to counts.
    limits: GateLimits { dead_time_s: 2.2e-6, pulse_s: 168.0 / 170e6 },
    // Switches of a drive for 230 V (assumed).
    switches: Switches { rated_v: 600.0, ringing_v_per_a: RINGING },
    // No capacitor (assumed).
    dc_link_pin: Source::Divider { ohm: 10e3, farad: 0.0 },
    // The pull-up that the documentation requires (assumed on all boards).
    fault_pull_ohm: 4700.0,
    analog_only: &[],
    terminals: ["B5 B7 B9 B10 B11 C4 C5", "C7 C9 A12", "B12 B13 B14"],
    ntc: Ntc::DEFAULT,
    shunts: None,
    dc_link_divider: None,
    delay_and_drop: None,
    motor: None,
    supply_v: None,
};

/// X-NUCLEO-IHM08M1 at 42 V: L6398 with STL220N6F7. PA11, PB14 and PB15 are at nets of the fault input and of a gate
/// (R73, R74, R86).
///
/// Pins, dividers and shunts: UM1996 and UM2505 as tabulated by okhsunrog/oxifoc, docs/hw/nucleo-g474re-ihm08m1.md
/// (9e87244), which calculated gain and offset. The sign is that of a shunt between switch and ground at a
/// non-inverting amplifier, and of ST's library (r3_2_g4xx_pwm_curr_fdbk.c: current = offset - code).
const IHM08M1: PowerStage = PowerStage {
    name: "nucleo-g474re-ihm08m1",
    // Truth table with interlock, and a dead time of its own of 320 ns: L6398 data sheet.
    driver: Driver { high: HIN, low: LIN, interlock: true, dead_time_s: 320e-9 },
    // Assumed: the MOSFETs switch in less than 100 ns, so the driver's own dead time is enough.
    limits: GateLimits { dead_time_s: 300e-9, pulse_s: 300e-9 },
    switches: Switches { rated_v: 60.0, ringing_v_per_a: RINGING },
    // 169 kOhm in parallel with 9.31 kOhm. It is not known whether there is a capacitor.
    dc_link_pin: Source::Divider { ohm: 8.82e3, farad: 0.0 },
    analog_only: &[(0, 11), (1, 14), (1, 15)],
    terminals: ["B5 B7 B9 - C7 - -", "- - -", "B12 - B13"],
    shunts: Some(Shunts { volts_per_a: -0.010 * 5.18, zero_v: 1.71, ..AMPLIFIERS }),
    // 169 and 9.31 kOhm.
    dc_link_divider: Some(19.15),
    // 125 ns (L6398 data sheet). The voltage drop of a switch is small; assumed.
    delay_and_drop: Some((125e-9, 0.1)),
    motor: Some("rewound-48v"),
    supply_v: Some(42.0),
    ..REFERENCE
};

/// STEVAL-IHM023V3 with X-NUCLEO-IHM09M1 at 320 V: L6390 with STGP10H60DF. There are few sources: shunts, gain, bias
/// and divider come from third parties that name UM1823 and ST's templates.
const IHM023V3: PowerStage = PowerStage {
    name: "nucleo-g474re-ihm023v3",
    // Interlock: L6390 data sheet, truth table. A resistor sets its dead time: the shortest is assumed.
    driver: Driver { high: HIN, low: LIN, interlock: true, dead_time_s: 180e-9 },
    // Assumed: an IGBT is off within 0.5 us.
    limits: GateLimits { dead_time_s: 0.5e-6, pulse_s: 0.5e-6 },
    terminals: ["- - - - - - -", "- - -", "- - -"],
    ntc: Ntc { divider_ohm: 3600.0, ..Ntc::DEFAULT },
    shunts: Some(Shunts { volts_per_a: -0.15 * 1.7, zero_v: 1.7, ..AMPLIFIERS }),
    dc_link_divider: Some(1.0 / 0.0075),
    // 125 ns (L6390 data sheet); voltage drop of an IGBT, assumed.
    delay_and_drop: Some((125e-9, 1.5)),
    supply_v: Some(320.0),
    ..REFERENCE
};

/// STEVAL-IPMM10B with X-NUCLEO-IHM09M1 at 320 V: a SLLIMM module of the second series. Shunts and gain: UM2702, page
/// 16. Everything else is assumed, as above for the adapter board.
const IPMM10B: PowerStage = PowerStage {
    name: "nucleo-g474re-ipmm10b",
    driver: Driver { high: PULLED_DOWN, low: PULLED_DOWN, interlock: true, dead_time_s: 0.0 },
    ntc: Ntc { ohm_25: 85e3, beta_k: 4092.0, divider_ohm: 12e3, ..Ntc::DEFAULT },
    shunts: Some(Shunts { volts_per_a: -0.08 * 2.1, zero_v: 1.65, ..AMPLIFIERS }),
    delay_and_drop: Some((125e-9, 1.0)),
    ..IHM023V3
};

/// STEVAL-IPM10B with X-NUCLEO-IHM09M1 at 320 V: a SLLIMM module of the second series, STGIB10CH60TS-L. Full range of the dc link: 415.8 V
/// in ST's motor-control library of 2016. The scale of the currents is assumed: the range ends at the peak current of the module, 25 A.
const IPM10B: PowerStage = PowerStage {
    name: "nucleo-g474re-ipm10b",
    shunts: Some(Shunts { volts_per_a: -0.066, zero_v: 1.65, ..AMPLIFIERS }),
    dc_link_divider: Some(126.0),
    ..IPMM10B
};

/// The inverter of the dissertation at other pins: PC0, PB13; PC1, PB14; PC2, PB15; fault input PB12; currents at PA1 and PA7, dc link at
/// PA0, heat sink at PA6. Relay at PC9.
const OWN_BOARD: PowerStage = PowerStage {
    name: "own-board",
    wiring: Wiring {
        gates: [
            [((2, 0), 2), ((1, 13), 6)],
            [((2, 1), 2), ((1, 14), 6)],
            [((2, 2), 2), ((1, 15), 4)],
        ],
        fault: ((1, 12), 6),
        currents: [2, 4, 6],
        dc_link: 1,
        heat_sink: 3,
        relay: (2, 9),
        crystal_hz: 8_000_000,
    },
    terminals: ["- - - - - - -", "- - -", "- - -"],
    ..REFERENCE
};
