//! The boards: one board, one file. To add one, see `docs/boards.md`.
//!
//! A [`Board`] is data: pins, polarities, dead time, sensors, scales and limits. Each number of the power stage is
//! [`Stated`]: read in a source, or assumed. A board refuses to start until the bench steps for what is assumed were done and
//! confirmed at the console.

mod confirm;
pub mod converter;
pub mod identity;
mod morpho;
pub mod pin;
#[cfg(test)]
mod tests;

mod nucleo_g474re_ihm023v3;
mod nucleo_g474re_ihm08m1;
mod nucleo_g474re_ipm10b;
mod nucleo_g474re_ipmm10b;
#[path = "../tests/boards/own_board.rs"]
mod own_board;
mod reference;

use drive_core::Line;
use drive_settings::rules::dc_link::{HIGHEST_OF_NOMINAL, OVER_OF_HIGHEST};
use drive_settings::{Carrier, Flux, Ntc};

use pin::{Pin, pa, pb, pc};

/// All boards.
pub const ALL: [&Board; 6] = [
    &reference::BOARD,
    &nucleo_g474re_ihm08m1::BOARD,
    &nucleo_g474re_ihm023v3::BOARD,
    &nucleo_g474re_ipmm10b::BOARD,
    &nucleo_g474re_ipm10b::BOARD,
    &own_board::BOARD,
];

/// Their names.
pub const NAMES: [&str; ALL.len()] =
    [ALL[0].name, ALL[1].name, ALL[2].name, ALL[3].name, ALL[4].name, ALL[5].name];
/// Their names in a line.
pub const ALL_NAMES: &str = "reference nucleo-g474re-ihm08m1 nucleo-g474re-ihm023v3 nucleo-g474re-ipmm10b nucleo-g474re-ipm10b own-board";

/// The board that this firmware is built for: `cargo firmware --board NAME`, by default the reference.
pub const SELECTED: &Board = match option_env!("INDUCTION_DRIVE_BOARD") {
    Some(name) => find(name).expect("INDUCTION_DRIVE_BOARD: src/boards.rs lists the boards"),
    None => &reference::BOARD,
};

/// The board with this name.
pub const fn find(name: &str) -> Option<&'static Board> {
    let mut i = 0;
    while i < ALL.len() {
        if ALL[i].name.eq_ignore_ascii_case(name) {
            return Some(ALL[i]);
        }
        i += 1;
    }
    None
}

/// A value with its source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated<T> {
    /// The value.
    pub value: T,
    /// Its source.
    pub source: Source,
}

/// The source of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Read in this document.
    Read(&'static str),
    /// Assumed; the text is the bench step that shows whether it holds.
    Assumed(&'static str),
}

/// A value read in a document.
pub const fn read<T: Copy>(value: T, document: &'static str) -> Stated<T> {
    Stated { value, source: Source::Read(document) }
}

/// An assumed value, with the bench step that shows whether it holds.
pub const fn assumed<T: Copy>(value: T, bench_step: &'static str) -> Stated<T> {
    Stated { value, source: Source::Assumed(bench_step) }
}

/// A logic level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Ground.
    Low,
    /// The supply of the chip.
    High,
}

/// The gate signals of the three high sides, or of the three low sides.
#[derive(Clone, Copy, Debug)]
pub struct Gates {
    /// Pins of the legs a, b, c.
    pub pins: [Pin; 3],
    /// The level at which the driver switches on.
    pub on_at: Stated<Level>,
}

/// The fault output of the power stage.
#[derive(Clone, Copy, Debug)]
pub struct FaultInput {
    /// Its pin.
    pub pin: Pin,
    /// The level that trips. The chip pulls an open wire there.
    pub trips_at: Stated<Level>,
    /// Resistor of the power stage that holds the input at the other level, ohm.
    pub pull_ohm: Stated<f32>,
}

/// Voltages of the dc link that the power stage withstands, V.
#[derive(Clone, Copy, Debug)]
pub struct DcLinkLimits {
    /// Maximum operating voltage: the braking limit is at most here.
    pub operation: Stated<f32>,
    /// Absolute maximum of the switches.
    pub switches: Stated<f32>,
    /// Rating of the capacitors.
    pub capacitors: Stated<f32>,
}

/// Share of the switches' absolute maximum at which the comparator trips: the ringing at a turn-off adds to it.
const OF_SWITCHES: f32 = 0.9;
/// Largest relative error of the measured dc link: the bench step for its scale allows it.
const SENSING_ERROR: f32 = 0.03;
/// Least distance from the software's trip to the comparator's, relative. It covers the offsets of comparator and DAC, which share
/// divider and reference with the software.
const COMPARATOR_ERROR: f32 = 0.03;

impl DcLinkLimits {
    /// Highest measured dc link at which the comparator may trip, V.
    pub const fn comparator_v(&self) -> f32 {
        let (switches, capacitors) = (OF_SWITCHES * self.switches.value, self.capacitors.value);
        (if switches < capacitors { switches } else { capacitors }) / (1.0 + SENSING_ERROR)
    }
}

/// An analog signal.
#[derive(Clone, Copy, Debug)]
pub struct Analog {
    /// Its pin.
    pub pin: Pin,
    /// Its calibration line.
    pub line: Stated<Line>,
}

/// The current sensors.
#[derive(Clone, Copy, Debug)]
pub struct Currents {
    /// Sensor of current a.
    pub a: Analog,
    /// Sensor of current b.
    pub b: Analog,
    /// Third shunt and settling time, if all three currents are measured by shunts below the low sides. Without shunts, sensors in the
    /// lines measure a and b at any time.
    pub shunts: Option<Shunts>,
}

/// Shunts below the low sides: each sees its current only while its low side is on.
#[derive(Clone, Copy, Debug)]
pub struct Shunts {
    /// Shunt of current c.
    pub c: Analog,
    /// Time from the turn-on of a low side until its amplifier has settled, s, without the dead time.
    pub settle_s: Stated<f32>,
}

/// The connections of the chip that do not belong to the power stage. The default values are those of a NUCLEO-G474RE.
#[derive(Clone, Copy, Debug)]
pub struct Wiring {
    /// The crystal, Hz.
    pub crystal_hz: u32,
    /// Transmit and receive of the console, LPUART1.
    pub console: [Pin; 2],
    /// Tracks A and B of the encoder, channels 1 and 2 of TIM2.
    pub encoder: [Pin; 2],
    /// Output for the brake chopper, channel 1 of TIM8, on at a high level. It needs an external pull-down: it floats in reset.
    pub chopper: Pin,
    /// Output for the precharge relay, on at a high level, with a pull-down as well.
    pub relay: Pin,
}

/// A board: an STM32G474RE, for example on a NUCLEO-G474RE, with its power stage.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// Name at the command line and in saved settings.
    pub name: &'static str,
    /// The boards it consists of, one line.
    pub title: &'static str,
    /// High sides.
    pub high: Gates,
    /// Low sides.
    pub low: Gates,
    /// Fault output.
    pub fault: FaultInput,
    /// Dead time that the timer generates, s: the default of `inverter.dead_time_s`. The dead time of the drivers adds to it.
    pub dead_time_s: Stated<f32>,
    /// Longest dead time that the setting accepts, s; the shortest is the board's own.
    pub dead_time_max_s: f32,
    /// Highest switching frequency that its switches allow. (With shunts the limit is 6 kHz anyway.)
    pub carrier_max_khz: Carrier,
    /// Phase currents.
    pub currents: Currents,
    /// Delay of the analog filters of the currents, s.
    pub current_delay_s: Stated<f32>,
    /// Dc link. Its pin is an input of comparator 1 or 3.
    pub dc_link: Analog,
    /// Pin of the heat sink's thermistor.
    pub heat_sink: Pin,
    /// The thermistor.
    pub ntc: Stated<Ntc>,
    /// Nominal voltage of the dc link, V: the default of `inverter.dc_link_v`.
    pub dc_link_v: f32,
    /// Flux of the motor: the default of `sequence.flux`.
    pub flux: Flux,
    /// Voltages that the power stage withstands.
    pub dc_link_limits: DcLinkLimits,
    /// Over-current shut-down of the power stage that needs no sample. Up to 60 V a board may do without; above, the ADCs detect a short
    /// circuit too late.
    pub over_current: Option<Stated<&'static str>>,
    /// Pins that the power stage ties to nets of other signals: they stay analog.
    pub analog_only: &'static [Pin],
    /// The port of the field bus, on pins that the power stage leaves free; `None` for a board without a bus.
    pub bus: Option<Rs485>,
    /// The terminals, on pins that the power stage leaves free.
    pub terminals: Terminals,
    /// Crystal, console, encoder, chopper and relay.
    pub wiring: Wiring,
    /// Advice on resistors at the driver inputs, one sentence: the pins float while the chip is in reset or flashed.
    pub pulls: &'static str,
}

/// The port of the field bus: USART3 and the pin that switches the RS-485 driver on, at a high level.
#[derive(Clone, Copy, Debug)]
pub struct Rs485 {
    /// Data to the transceiver (DI).
    pub transmit: Pin,
    /// Data from the transceiver (RO).
    pub receive: Pin,
    /// Driver enable (DE, with its inverse at /RE: one wire to both).
    pub driver: Pin,
}

/// The terminals by name: first the analog ones, then the contacts, then the outputs.
#[rustfmt::skip]
pub const TERMINALS: [&str; 13] = [
    "REFERENCE", "REFERENCE2", "MOTOR SENSOR",
    "ENABLE", "START", "STOP", "REVERSE", "RESET", "PRESET1", "PRESET2",
    "RUN", "FAULT", "BRAKE",
];
/// Number of analog terminals, and of contacts.
pub const ANALOG: usize = 3;
/// See [`ANALOG`].
pub const CONTACTS: usize = 7;

/// A pin for each of the [`TERMINALS`] that a board has.
pub type TerminalPins = [Option<Pin>; TERMINALS.len()];

/// The terminals of a board. Contacts are behind opto-couplers or filters; the chip pulls an open contact to the level opposite to a closed
/// one. Active outputs are high. They need external pull-downs: they float in reset.
#[derive(Clone, Copy, Debug)]
pub struct Terminals {
    /// Pins in the order of [`TERMINALS`]; analog ones are at ADC3 or ADC4.
    pub pins: TerminalPins,
    /// The level at a closed contact.
    pub closed_at: Level,
    /// Voltage at the pins of the references at 10 V, and at 20 mA, V.
    pub full_v: f32,
}

impl Terminals {
    /// A board without terminals.
    pub const NONE: Self = Self::of([None; TERMINALS.len()]);

    /// Contacts to ground, and 150 ohm for the current loop.
    pub const fn of(pins: TerminalPins) -> Self {
        Self { pins, closed_at: Level::Low, full_v: 3.0 }
    }
}

impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Board {
    /// ADC counts at the maximum operating voltage, which no setting of the scale raises.
    pub const fn highest_dc_link(&self) -> u16 {
        let Line { gain, offset } = self.dc_link.line.value;
        // Rounded up: the limit itself is allowed.
        ((self.dc_link_limits.operation.value - offset) / gain) as u16 + 1
    }

    /// Number of signals at a pin. The debug port and a pin that must stay analog count as signals.
    const fn signals_at(&self, pin: Pin) -> usize {
        let Currents { a, b, shunts } = self.currents;
        let c = if let Some(Shunts { c, .. }) = shunts { pin.times(&[c.pin]) } else { 0 };
        let bus = match self.bus {
            Some(Rs485 { transmit, receive, driver }) => pin.times(&[transmit, receive, driver]),
            None => 0,
        };
        let gates = pin.times(&self.high.pins) + pin.times(&self.low.pins);
        let Wiring { console, encoder, chopper, relay, .. } = self.wiring;
        let inputs = [self.fault.pin, a.pin, b.pin, self.dc_link.pin, self.heat_sink];
        let wires = pin.times(&console) + pin.times(&encoder);
        let single = pin.times(&inputs) + pin.times(&[chopper, relay, pa(13), pa(14)]);
        let others = pin.times(self.analog_only) + pin.times_of_some(&self.terminals.pins);
        gates + c + bus + wires + single + others
    }
}

/// Least resistance of the chip's resistor at a pin, ohm (datasheet: 25 to 55 kOhm).
const CHIP_PULL_OHM: f32 = 25e3;
/// Share of the supply that remains as a reliable high level: 2.6 V of 3.3, where the input needs 0.7 of the supply.
const SURE_LEVEL: f32 = 2.6 / 3.3;
/// Dc link voltage above which an over-current shut-down is required, V. Above it the voltage is no longer extra-low, and switches do not
/// withstand a short circuit until the next sample.
pub const EXTRA_LOW_V: f32 = 60.0;

/// Checks a board when compiling.
const fn check(board: &Board) {
    let mut leg = 0;
    while leg < 3 {
        let (channel, complementary) = pin::TIM1_LEGS[leg];
        assert!(board.high.pins[leg].is(channel), "a high side is not on its leg's channel");
        assert!(board.low.pins[leg].is(complementary), "a low side is not on its leg's channel");
        leg += 1;
    }
    assert!(board.fault.pin.is(pin::TIM1_BKIN), "the fault input is not a break input");
    let Currents { a, b, shunts } = board.currents;
    assert!(a.pin.adc1().is_some() && b.pin.adc2().is_some(), "a current has no ADC");
    if let Some(Shunts { c, .. }) = shunts {
        assert!(c.pin.adc1().is_some(), "current c has no ADC");
    }
    assert!(board.dc_link.pin.comparator().is_some(), "no comparator reaches the dc link");
    assert!(board.dc_link.pin.adc1().is_some() && board.heat_sink.adc2().is_some());
    let (own, longest) = (board.dead_time_s.value, board.dead_time_max_s);
    assert!(own > 0.0 && own <= longest && longest <= 6e-6, "dead time");
    assert!(
        CHIP_PULL_OHM / (CHIP_PULL_OHM + board.fault.pull_ohm.value) >= SURE_LEVEL,
        "the resistor at the fault input is too large: the chip pulls against it"
    );
    let Wiring { console: [tx, rx], encoder: [a, b], chopper, .. } = board.wiring;
    assert!(tx.is(pin::LPUART1_TX) && rx.is(pin::LPUART1_RX), "the console is not at LPUART1");
    assert!(a.is(pin::TIM2_CH1) && b.is(pin::TIM2_CH2), "the encoder is not at TIM2");
    assert!(chopper.is(pin::TIM8_CH1), "the chopper is not at channel 1 of TIM8");
    if let Some(Rs485 { transmit: tx, receive: rx, .. }) = board.bus {
        assert!(tx.is(pin::USART3_TX) && rx.is(pin::USART3_RX), "the bus is not at USART3");
    }
    let mut i = 0;
    while i < TERMINALS.len() {
        if let Some(pin) = board.terminals.pins[i] {
            assert!(i >= ANALOG || pin.adc34().is_some(), "a terminal has no ADC");
        }
        i += 1;
    }
    let mut i = 0;
    while i < 16 {
        let most = board.signals_at(pa(i)) | board.signals_at(pb(i)) | board.signals_at(pc(i));
        assert!(most <= 1, "two signals have the same pin, or a pin must stay analog");
        i += 1;
    }
    // Nominal dc link < braking limit <= maximum operating voltage < trip of the software < trip of the comparator <= voltages that
    // switches and capacitors withstand.
    let limits = &board.dc_link_limits;
    let (operation_v, comparator_v) = (limits.operation.value, limits.comparator_v());
    assert!(
        board.dc_link_v > 0.0 && HIGHEST_OF_NOMINAL * board.dc_link_v <= operation_v,
        "the nominal dc link is too close to the maximum operating voltage"
    );
    assert!(
        OVER_OF_HIGHEST * operation_v * (1.0 + COMPARATOR_ERROR) <= comparator_v,
        "no two trips fit between the maximum operating voltage and the limits of switches and capacitors"
    );
    let range_v = board.dc_link.line.value.gain * 4095.0 + board.dc_link.line.value.offset;
    assert!(comparator_v <= range_v, "the ADC does not reach the trips of the dc link");
    assert!(
        board.over_current.is_some() || operation_v <= EXTRA_LOW_V,
        "above 60 V the power stage needs an over-current shut-down of its own"
    );
}
const _: () = {
    let mut i = 0;
    while i < ALL.len() {
        check(ALL[i]);
        i += 1;
    }
};
