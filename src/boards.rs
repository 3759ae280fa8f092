//! The boards: one board, one file. To add one, see `docs/boards.md`.
//!
//! A [`Board`] is data: pins, polarities, dead time, sensors, scales and limits. Each number of the power stage is
//! [`Stated`]: read in a source, or assumed. A board with an assumed polarity, dead time or scale refuses to start until
//! the bench steps for them were done and confirmed at the console.

mod confirm;
pub mod converter;
mod morpho;
pub mod pin;
#[cfg(test)]
mod tests;

mod nucleo_g474re_ihm023v3;
mod nucleo_g474re_ihm08m1;
mod reference;

use drive_core::settings::{Flux, Line, Ntc};

use pin::Pin;

/// All boards.
pub const ALL: [&Board; 3] =
    [&reference::BOARD, &nucleo_g474re_ihm08m1::BOARD, &nucleo_g474re_ihm023v3::BOARD];

/// Their names.
pub const NAMES: [&str; ALL.len()] = [ALL[0].name, ALL[1].name, ALL[2].name];
/// Their names in a line.
pub const ALL_NAMES: &str = "reference nucleo-g474re-ihm08m1 nucleo-g474re-ihm023v3";

/// The board that this firmware is built for: `cargo firmware --board NAME`, by default the reference.
pub const SELECTED: &Board = match option_env!("INDUCTION_DRIVE_BOARD") {
    Some(name) => match find(name) {
        Some(board) => board,
        None => panic!("INDUCTION_DRIVE_BOARD: no such board; src/boards.rs lists them"),
    },
    None => &reference::BOARD,
};

/// The board with this name.
pub const fn find(name: &str) -> Option<&'static Board> {
    let mut i = 0;
    while i < ALL.len() {
        if same(ALL[i].name.as_bytes(), name.as_bytes()) {
            return Some(ALL[i]);
        }
        i += 1;
    }
    None
}

/// Equality of two texts when compiling, where `==` is not available.
const fn same(a: &[u8], b: &[u8]) -> bool {
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
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
pub enum Currents {
    /// Sensors in the lines a and b: they measure at any time.
    InLine([Analog; 2]),
    /// Shunts below the low sides of a, b and c: each sees its current only while its low side is on.
    LowSide {
        /// The shunts.
        shunts: [Analog; 3],
        /// Time from the turn-on of a low side until its amplifier has settled, s, without the dead time.
        settle_s: Stated<f32>,
    },
}

impl Currents {
    /// Sensors of a and b.
    pub const fn a_and_b(&self) -> [Analog; 2] {
        match self {
            Self::InLine(sensors) => *sensors,
            Self::LowSide { shunts: [a, b, _], .. } => [*a, *b],
        }
    }

    /// Sensor of c, if there is one.
    pub const fn c(&self) -> Option<Analog> {
        match self {
            Self::InLine(_) => None,
            Self::LowSide { shunts: [_, _, c], .. } => Some(*c),
        }
    }
}

/// A board: a NUCLEO-G474RE with its power stage.
#[derive(Clone, Copy)]
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
    /// Dead time that the timer makes, s: the default of `inverter.dead_time_s`. Dead time of the drivers comes on top.
    pub dead_time_s: Stated<f32>,
    /// Range of that setting, s.
    pub dead_time_range_s: (f32, f32),
    /// Phase currents.
    pub currents: Currents,
    /// Delay of the analog filters of the currents, s.
    pub current_delay_s: Stated<f32>,
    /// Dc link. Its pin is the one that comparator 1 reaches.
    pub dc_link: Analog,
    /// Thermistor of the heat sink: its pin.
    pub heat_sink: Pin,
    /// The thermistor.
    pub ntc: Stated<Ntc>,
    /// Nominal voltage of the dc link, V: the default of `inverter.dc_link_v`.
    pub dc_link_v: f32,
    /// Flux of the motor: the default of `sequence.flux`.
    pub flux: Flux,
    /// Highest voltage that the power stage stands, V.
    pub highest_dc_link_v: Stated<f32>,
    /// The port of the field bus, on pins that the power stage leaves free; `None` is a board without a bus.
    pub bus: Option<Rs485>,
    /// Advice on resistors at the driver inputs, one sentence: the pins float while the chip is in reset or flashed.
    pub pulls: &'static str,
}

/// The port of the field bus: USART3 and the pin that switches the RS-485 driver on, at a high level.
#[derive(Clone, Copy, Debug)]
pub struct Rs485 {
    /// Data to the transceiver (DI).
    pub transmit: Pin,
    /// Data from it (RO).
    pub receive: Pin,
    /// Driver enable (DE, with its inverse at /RE: one wire to both).
    pub driver: Pin,
}

impl core::fmt::Debug for Board {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Board {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// Checks a board when compiling.
const fn check(board: &Board) {
    let [(high_1, high_2, high_3), (low_1, low_2, low_3)] = [
        (board.high.pins[0], board.high.pins[1], board.high.pins[2]),
        (board.low.pins[0], board.low.pins[1], board.low.pins[2]),
    ];
    assert!(
        high_1.is(&pin::TIM1_CH1) && high_2.is(&pin::TIM1_CH2) && high_3.is(&pin::TIM1_CH3),
        "a high side is not on the channel of its leg"
    );
    assert!(
        low_1.is(&pin::TIM1_CH1N) && low_2.is(&pin::TIM1_CH2N) && low_3.is(&pin::TIM1_CH3N),
        "a low side is not on the complementary channel of its leg"
    );
    assert!(board.fault.pin.is(&pin::TIM1_BKIN), "the fault input is not a break input");
    let [a, b] = board.currents.a_and_b();
    assert!(a.pin.adc1().is_some() && b.pin.adc2().is_some(), "a current has no converter");
    if let Some(c) = board.currents.c() {
        assert!(c.pin.adc1().is_some(), "current c has no converter");
        assert!(!c.pin.equals(a.pin) && !c.pin.equals(b.pin), "two currents on one pin");
    }
    assert!(board.dc_link.pin.equals(pin::COMP1_INPUT), "comparator 1 does not reach the dc link");
    assert!(board.dc_link.pin.adc1().is_some() && board.heat_sink.adc2().is_some());
    let (shortest, longest) = board.dead_time_range_s;
    assert!(
        shortest > 0.0
            && board.dead_time_s.value >= shortest
            && board.dead_time_s.value <= longest
            && longest <= 6e-6,
        "dead time"
    );
    if let Some(Rs485 { transmit, receive, driver }) = board.bus {
        assert!(
            transmit.is(&pin::USART3_TX) && receive.is(&pin::USART3_RX),
            "a pin of the bus is not one of USART3"
        );
        assert!(
            !driver.equals(transmit) && !driver.equals(receive),
            "two wires of the bus on one pin"
        );
    }
    let range_v = board.dc_link.line.value.gain * 4095.0 + board.dc_link.line.value.offset;
    assert!(board.dc_link_v > 0.0 && board.dc_link_v < board.highest_dc_link_v.value);
    assert!(
        board.highest_dc_link_v.value <= range_v,
        "the converter does not reach the highest dc link"
    );
}
const _: () = {
    let mut i = 0;
    while i < ALL.len() {
        check(ALL[i]);
        i += 1;
    }
};
