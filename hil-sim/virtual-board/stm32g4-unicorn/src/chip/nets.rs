//! The nets at two pins of the chip, and their observers: a pin with a comparator, and a pin with the break of TIM1.

use super::pins::Pin;
use super::{CODES, Chip, Circuit, Damage, TICKS_PER_S};
use crate::circuit::{PULL_OHM, Pull, SUPPLY_V, Source, level};
use crate::periph::{NEVER, dac::Dac};
use crate::rules::Rule;

/// The strongest of the chip's own pull resistors, ohm (datasheet, RPU and RPD: 25 to 55 kOhm).
const STRONGEST_PULL_OHM: f64 = 25e3;
/// Largest ADC counts of the analog signals.
const FULL_SCALE: f64 = CODES - 1.0;
/// Number of checks of a moving pin per time constant.
const LOOKS: f64 = 50.0;
/// The pins of comparators 1 and 3, PA0, PC1 and PA1: their channel of ADC1 and ADC2 (datasheet), and the comparator, counted from 0.
const COMPARED: [(Pin, usize, usize); 3] = [((0, 0), 1, 2), ((2, 1), 7, 2), ((0, 1), 2, 0)];

/// The net at an analog pin; by default something drives it.
#[derive(Clone, Debug, Default)]
pub struct AnalogNet {
    /// The circuit at the pin.
    pub source: Source,
    /// Voltage at the pin, ADC counts, and its time, ticks.
    code: f64,
    at: u64,
    /// Final value, ADC counts, and time constant, ticks.
    towards: (f64, f64),
}

impl AnalogNet {
    /// Returns the present counts at the pin, if the circuit alone would give `open` and the port pulls.
    fn follow(&mut self, open: u16, pull: Option<bool>, now: u64) -> u16 {
        let (end, tau) = self.towards;
        let left = if tau > 0.0 { (-((now - self.at) as f64) / tau).exp() } else { 0.0 };
        self.code = end + (self.code - end) * left;
        self.at = now;
        let open = f64::from(open);
        self.towards = match self.source {
            Source::Driven => (open, 0.0),
            Source::Divider { ohm, farad } => {
                let share = pull.map_or(0.0, |_| ohm / (ohm + PULL_OHM));
                let pulled = if pull == Some(true) { FULL_SCALE } else { 0.0 };
                let tau = ohm * (1.0 - share) * farad * TICKS_PER_S as f64;
                (open + share * (pulled - open), tau)
            }
        };
        // The capacitor was charged before power-up.
        if self.towards.1 == 0.0 || now == 0 {
            self.code = self.towards.0;
        }
        self.code.round() as u16
    }

    /// Returns the time of its next check.
    pub fn next_event(&self) -> u64 {
        let (end, tau) = self.towards;
        let moves = tau > 0.0 && (self.code - end).abs() > 0.5;
        if moves { self.at + (tau / LOOKS).max(1.0) as u64 } else { NEVER }
    }
}

impl<C: Circuit> Chip<C> {
    /// Applies voltages, ADC counts, to the pins of the comparators: comparator 1 has PA1 at its positive input,
    /// comparator 3 has PA0 or PC1.
    pub fn compare(&mut self, pa0: u16, pc1: u16, pa1: u16) {
        self.analog = [pa0, pc1, pa1];
        self.compare_now();
    }

    /// Returns the DAC whose channel 1 gives the level of comparator 1 or 3, counted from 0.
    fn level_of(&self, n: usize) -> Option<&Dac> {
        // INMSEL 4 is DAC3, 5 is DAC1, channel 1 of either; the others are not modelled.
        match self.comp[n].reference_source() {
            4 => Some(&self.dac[1]),
            5 => Some(&self.dac[0]),
            _ => None,
        }
    }

    /// Passes the present levels of the pins to the ADCs and the comparators.
    pub(super) fn compare_now(&mut self) {
        let ((port, pin), channel, watched) = COMPARED[self.net_at];
        let (mut codes, pull) = (self.analog, self.gpio[port].pull(pin));
        codes[self.net_at] = self.net.follow(codes[self.net_at], pull, self.now);
        for inputs in &mut self.adc.inputs {
            inputs[channel] = codes[self.net_at];
        }
        let [pa0, pc1, pa1] = codes;
        self.comp[0].input = pa1;
        self.comp[2].input = if self.comp[2].input_pin() == 0 { pa0 } else { pc1 };
        for n in [0, 2] {
            let code = self.level_of(n).map(|dac| dac.code(self.now));
            self.comp[n].reference = code.map_or(u16::MAX, |code| code + self.comparator_offset);
        }
        match self.damage {
            Some(Damage::Level(code)) => self.comp[watched].reference = code,
            Some(Damage::Input) => self.comp[watched].input = 0,
            Some(Damage::Comparator | Damage::Break) | None => {}
        }
        self.comp[watched].stuck_low = self.damage == Some(Damage::Comparator);
        self.comp.iter_mut().for_each(|comparator| comparator.look(self.now));
        let reaches = self.damage != Some(Damage::Break);
        self.tim1.set_comparators(std::array::from_fn(|n| reaches && self.comp[n].output()));
    }

    /// Checks, after a write to a comparator, that the level it uses must have been seen ready.
    pub(super) fn check_reference(&mut self, offset: u32) {
        let n = ((offset - 0x200) / 4) as usize;
        let Some(dac) = self.level_of(n).filter(|_| self.comp[n].is_on()) else { return };
        let (ready, number, comp) = (dac.seen_ready(), dac.number, n + 1);
        self.rules.require(ready, Rule::DacReady, || {
            format!("COMP{comp} is on, but DAC{number}_SR.DAC1RDY was never read as set")
        });
    }

    /// Lets the outside pull the break input low, or release it.
    pub fn pull_break_pin(&mut self, low: bool) {
        self.break_low = low;
        self.follow_break_pin();
    }

    /// Updates the level of the break input, which follows from the resistors outside and in the port. It is
    /// certain below 0.3 and above 0.7 of the supply (datasheet, VIL and VIH).
    pub(super) fn follow_break_pin(&mut self) {
        let (port, pin) = self.break_pin;
        let port = self.gpio[port].pull(pin).map(|up| (up, STRONGEST_PULL_OHM));
        let pulls = [(true, self.break_pull_ohm)].into_iter().chain(port);
        let pulls = pulls.map(|(up, ohm)| Pull { volts: if up { SUPPLY_V } else { 0.0 }, ohm });
        let released = level(pulls, (0.3 * SUPPLY_V, 0.7 * SUPPLY_V));
        self.tim1.set_break_pin(if self.break_low { Some(false) } else { released });
    }
}
