//! The terminal strip from outside: contacts, an analog reference, outputs.

use anyhow::{Context, Result};
use induction_drive::boards::{ANALOG, TERMINALS};

use super::Board;
use crate::power_stage::{CODES, REFERENCE_V};
use stm32g4_unicorn::chip::pins::{self, Pin};

/// Voltage at the pins of the reference at 20 mA, across 150 ohm.
const FULL_V: f64 = 3.0;

impl Board {
    /// Returns the pins of contacts (0), outputs (1) or analog inputs (2).
    fn terminals(&self, kind: usize) -> impl Iterator<Item = Option<Pin>> + use<> {
        self.cpu.chip().circuit.stage.terminals[kind].split(' ').map(pins::pin)
    }

    /// Closes the contacts of these names and opens the others; a number is the current of the reference, mA.
    ///
    /// # Errors
    /// A word that is neither a name nor a number.
    pub fn set_wires(&mut self, wires: &str) -> Result<()> {
        self.chip().grounded = [0; 7];
        wires.split_whitespace().try_for_each(|word| match word.parse() {
            Ok(ma) => {
                self.set_reference([ma; 2]);
                Ok(())
            }
            Err(_) => self.set_contact(word, true),
        })
    }

    /// Closes or opens the contact at an input, by its name.
    ///
    /// # Errors
    /// The strip has no such input.
    pub fn set_contact(&mut self, name: &str, closed: bool) -> Result<()> {
        let mut contacts = TERMINALS.iter().skip(ANALOG).zip(self.terminals(0));
        let pin = contacts.find(|(terminal, _)| terminal.eq_ignore_ascii_case(name));
        let pin = pin.and_then(|(_, pin)| pin);
        let (port, pin) = pin.with_context(|| format!("{name}: no such contact"))?;
        let grounded = &mut self.chip().grounded[port];
        *grounded = *grounded & !(1 << pin) | u32::from(closed) << pin;
        Ok(())
    }

    /// Applies a current, mA, to the reference, and to the second reference if there is one; instead of a current, a
    /// tenth of a volt corresponds to 0.2 mA.
    pub fn set_reference(&mut self, ma: [f64; 2]) {
        ma.into_iter()
            .enumerate()
            .for_each(|(n, ma)| self.set_analog(n, ma / 20.0 * FULL_V / REFERENCE_V));
    }

    /// Applies a voltage to an analog input, as a share of the ADC's reference: first and second reference, sensor of the motor.
    pub fn set_analog(&mut self, input: usize, share: f64) {
        let code = (share * CODES).clamp(0.0, CODES - 1.0) as u16;
        let Some(pin) = self.terminals(2).nth(input).flatten() else { return };
        for (converter, channel) in (0..2).flat_map(|n| (1..19).map(move |c| (n, c))) {
            if pins::analog(2 + converter, channel) == Some(pin) {
                self.chip().slow_adc.inputs[converter][channel as usize] = code;
            }
        }
    }

    /// Returns whether RUN, FAULT and BRAKE are active.
    pub fn terminal_outputs(&self) -> [bool; 3] {
        let chip = self.cpu.chip();
        let mut outputs = self.terminals(1).map(|pin| pin.is_some_and(|pin| chip.drives_high(pin)));
        std::array::from_fn(|_| outputs.next().unwrap_or(false))
    }
}
