//! The pins against their use (datasheet, tables of pins and alternate functions).

use super::Chip;
use crate::periph::gpio::Pad;
use crate::rules::Rule;

/// A pin: its port, A is 0, and its number.
pub type Pin = (usize, u32);
/// A signal: its name, and the pins that it reaches with the alternate function of each.
pub type Signal = (&'static str, &'static [(Pin, u32)]);

const A: usize = 0;
const B: usize = 1;
const C: usize = 2;
const F: usize = 5;

/// The outputs of TIM1 in the order of `TIM1_CCER`.
pub const OUTPUTS: [Signal; 6] = [
    ("TIM1_CH1", &[((A, 8), 6), ((C, 0), 2)]),
    ("TIM1_CH1N", &[((A, 7), 6), ((A, 11), 6), ((B, 13), 6), ((C, 13), 4)]),
    ("TIM1_CH2", &[((A, 9), 6), ((C, 1), 2)]),
    ("TIM1_CH2N", &[((A, 12), 6), ((B, 0), 6), ((B, 14), 6)]),
    ("TIM1_CH3", &[((A, 10), 6), ((C, 2), 2)]),
    ("TIM1_CH3N", &[((B, 1), 6), ((B, 9), 12), ((B, 15), 4), ((F, 0), 6)]),
];
/// The break input.
pub const BREAK: Signal = (
    "TIM1_BKIN",
    &[
        ((A, 6), 6),
        ((A, 14), 6),
        ((A, 15), 9),
        ((B, 8), 12),
        ((B, 10), 12),
        ((B, 12), 6),
        ((C, 13), 2),
    ],
);
/// The encoder.
pub const ENCODER: [Signal; 2] = [
    ("TIM2_CH1", &[((A, 0), 1), ((A, 5), 1), ((A, 15), 1)]),
    ("TIM2_CH2", &[((A, 1), 1), ((B, 3), 1)]),
];
/// The console.
pub const SERIAL: [Signal; 2] = [
    ("LPUART1_TX", &[((A, 2), 12), ((B, 11), 8), ((C, 1), 8)]),
    ("LPUART1_RX", &[((A, 3), 12), ((B, 10), 8), ((C, 0), 8)]),
];

/// The pin of a channel of ADC1 or ADC2, counted from 0; `None` is inside the chip.
pub fn analog(converter: usize, channel: u32) -> Option<Pin> {
    let both = match channel {
        1 => (A, 0),
        2 => (A, 1),
        6 => (C, 0),
        7 => (C, 1),
        8 => (C, 2),
        9 => (C, 3),
        14 => (B, 11),
        _ if converter == 0 => {
            return Some(match channel {
                3 => (A, 2),
                4 => (A, 3),
                5 => (B, 14),
                10 => (F, 0),
                11 => (B, 12),
                12 => (B, 1),
                15 => (B, 0),
                _ => return None,
            });
        }
        _ => {
            return Some(match channel {
                3 => (A, 6),
                4 => (A, 7),
                5 => (C, 4),
                10 => (F, 1),
                11 => (C, 5),
                12 => (B, 2),
                13 => (A, 5),
                15 => (B, 15),
                17 => (A, 4),
                _ => return None,
            });
        }
    };
    Some(both)
}

fn name((port, pin): Pin) -> String {
    format!("P{}{pin}", char::from(b'A' + port as u8))
}

impl Chip {
    fn reaches(&self, signal: Signal) -> bool {
        signal.1.iter().any(|((port, pin), af)| self.gpio[*port].pad(*pin) == Pad::Alternate(*af))
    }

    fn require_pin(&mut self, signal: Signal, use_: &str) {
        let reaches = self.reaches(signal);
        self.rules.require(reaches, Rule::PinMode, || {
            format!("{use_}, but no pin is at the alternate function of {}", signal.0)
        });
    }

    /// The outputs of TIM1 were switched on.
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

    /// The encoder counts.
    pub(super) fn check_encoder_pins(&mut self) {
        if self.tim2.counting() {
            for signal in ENCODER {
                self.require_pin(signal, "TIM2 counts in encoder mode");
            }
        }
    }

    /// A byte was given to the port.
    pub(super) fn check_serial_pin(&mut self) {
        self.require_pin(SERIAL[0], "LPUART1_TDR is written");
    }

    /// Channels were converted.
    pub(super) fn check_analog_pins(&mut self) {
        for (n, channels) in self.adc.take_converted().into_iter().enumerate() {
            for channel in (0..19).filter(|channel| channels >> channel & 1 != 0) {
                let Some(pin) = analog(n, channel) else { continue };
                let is_analog = self.gpio[pin.0].pad(pin.1) == Pad::Analog;
                self.rules.require(is_analog, Rule::PinMode, || {
                    format!(
                        "ADC{} converts channel {channel}, but {} is not analog",
                        n + 1,
                        name(pin)
                    )
                });
            }
        }
    }
}
