//! Checks of the pins against their use (datasheet, tables of pins and alternate functions).

use std::sync::LazyLock;

use super::{Chip, Circuit};
use crate::{periph::gpio::Pad, rules::Rule};

/// A pin: its port (A is 0), and its number.
pub type Pin = (usize, u32);
/// A signal: its name, and the pins that it can use, each with its alternate function, as in "A8:6 C0:2".
pub type Signal = (&'static str, &'static str);

/// The outputs of TIM1 in the order of `TIM1_CCER`.
pub const OUTPUTS: [Signal; 6] = [
    ("TIM1_CH1", "A8:6 C0:2"),
    ("TIM1_CH1N", "A7:6 A11:6 B13:6 C13:4"),
    ("TIM1_CH2", "A9:6 C1:2"),
    ("TIM1_CH2N", "A12:6 B0:6 B14:6"),
    ("TIM1_CH3", "A10:6 C2:2"),
    ("TIM1_CH3N", "B1:6 B9:12 B15:4 F0:6"),
];
/// The break input.
pub const BREAK: Signal = ("TIM1_BKIN", "A6:6 A14:6 A15:9 B8:12 B10:12 B12:6 C13:2");
/// The first output of TIM8.
pub const TIM8_OUTPUT: Signal = ("TIM8_CH1", "A15:2 B6:5 C6:4");
/// The inputs of an encoder.
pub const ENCODER: [Signal; 2] = [("TIM2_CH1", "A0:1 A5:1 A15:1"), ("TIM2_CH2", "A1:1 B3:1")];
/// The low-power serial port.
pub const SERIAL: [Signal; 2] =
    [("LPUART1_TX", "A2:12 B11:8 C1:8"), ("LPUART1_RX", "A3:12 B10:8 C0:8")];
/// The serial port with an RS-485 driver.
pub const BUS: [Signal; 2] = [("USART3_TX", "B9:7 B10:7 C10:7"), ("USART3_RX", "B8:7 B11:7 C11:7")];
/// The pins of the channels of ADC1 to ADC4, starting with channel 1; `-` is inside the chip or at no pin of this package.
const ANALOG: [&str; 4] = [
    "A0 A1 A2 A3 B14 C0 C1 C2 C3 F0 B12 B1 - B11 B0",
    "A0 A1 A6 A7 C4 C0 C1 C2 C3 F1 C5 B2 A5 B11 B15 - A4",
    "B1 - - - B13 - - - - - - B0",
    "- - B12 B14 B15",
];

/// Returns the pin of this name, as "A8".
pub fn pin(name: &str) -> Option<Pin> {
    let (port, number) = name.split_at_checked(1)?;
    let number = number.parse().ok()?;
    Some((usize::from(port.as_bytes()[0] - b'A'), number))
}

/// Returns the pins that a signal can use, with the alternate function of each.
pub fn pins_of(signal: Signal) -> impl Iterator<Item = (Pin, u32)> {
    signal.1.split(' ').filter_map(|reach| {
        let (name, function) = reach.split_once(':')?;
        Some((pin(name)?, function.parse().ok()?))
    })
}

/// [`ANALOG`] as a table for the look-up at every conversion.
static ANALOG_PINS: LazyLock<[Vec<Option<Pin>>; 4]> =
    LazyLock::new(|| ANALOG.map(|names| names.split(' ').map(pin).collect()));

/// Returns the pin of a channel of ADC1 to ADC4, counted from 0; `None` if it is inside the chip.
pub fn analog(converter: usize, channel: u32) -> Option<Pin> {
    *ANALOG_PINS[converter].get(channel.checked_sub(1)? as usize)?
}

impl<C: Circuit> Chip<C> {
    pub(super) fn require_pin(&mut self, signal: Signal, use_: &str) {
        let reaches =
            pins_of(signal).any(|((port, pin), af)| self.gpio[port].pad(pin) == Pad::Alternate(af));
        self.rules.require(reaches, Rule::PinMode, || {
            format!("{use_}, but no pin is at the alternate function of {}", signal.0)
        });
    }

    /// Checks the pins when the outputs of TIM1 are switched on.
    pub(super) fn check_gate_pins(&mut self) {
        let (outputs, pin) = self.tim1.uses_pins();
        for (signal, used) in OUTPUTS.into_iter().zip(outputs) {
            if used {
                self.require_pin(signal, "TIM1_BDTR.MOE is set");
            }
        }
        if pin {
            self.require_pin(BREAK, "TIM1_AF1.BKINE is set");
        }
    }

    /// Returns the duty of TIM8_CH1 at a pin, which is pulled down while it is released.
    pub fn tim8_duty(&self, at: Pin) -> f64 {
        let (duty, pad) = (self.tim8.duty(), self.gpio[at.0].pad(at.1));
        let connects = |(place, af)| place == at && pad == Pad::Alternate(af);
        let works = duty > 0.0 && !self.stops_tim8() && pins_of(TIM8_OUTPUT).any(connects);
        if works { duty } else { 0.0 }
    }

    /// Whether a pin drives a high level; it is pulled down while it is released.
    pub fn drives_high(&self, (port, pin): Pin) -> bool {
        self.gpio[port].pad(pin) == Pad::Output(true)
    }

    /// Checks the pins when the encoder counts.
    pub(super) fn check_encoder_pins(&mut self) {
        if self.tim2.counting() {
            for signal in ENCODER {
                self.require_pin(signal, "TIM2 counts in encoder mode");
            }
        }
    }

    /// Whether the driver of USART3 drives its line.
    pub(super) fn drives_bus(&self) -> bool {
        self.bus_driver.is_none_or(|pin| self.drives_high(pin))
    }

    /// Checks the pins when a byte is given to USART3.
    pub(super) fn check_bus_pins(&mut self) {
        for signal in BUS {
            self.require_pin(signal, "USART3_TDR is written");
        }
        let drives = self.drives_bus();
        self.rules.require(drives, Rule::BusDriver, || {
            "USART3_TDR is written with the driver's pin not high".to_owned()
        });
    }

    /// Checks the pins when channels are converted.
    pub(super) fn check_analog_pins(&mut self) {
        let converted = [self.adc.take_converted(), self.slow_adc.take_converted()];
        for (n, channels) in converted.as_flattened().iter().copied().enumerate() {
            if n == 0 && channels >> 18 & 1 != 0 {
                let long = self.adc.own_reference_ticks() >= 4 * 170;
                self.rules.require(long, Rule::OwnReference, || "ADC1_SMPR2.SMP18".into());
            }
            for channel in (0..19).filter(|channel| channels >> channel & 1 != 0) {
                let Some((port, pin)) = analog(n, channel) else { continue };
                // Or the pin is an input on purpose, to measure the port's own resistor against the circuit.
                let (pad, pulled) = (self.gpio[port].pad(pin), self.gpio[port].pull(pin).is_some());
                let reads = pad == Pad::Analog || pad == Pad::Input && pulled;
                self.rules.require(reads, Rule::PinMode, || {
                    let (adc, port) = (n + 1, char::from(b'A' + port as u8));
                    format!("ADC{adc} converts channel {channel}, but P{port}{pin} is not analog")
                });
            }
        }
    }
}
