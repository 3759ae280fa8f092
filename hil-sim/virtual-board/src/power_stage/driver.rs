//! The gate drivers: levels at their inputs, and whether these request on.

use super::TimerPin;
use stm32g4_unicorn::circuit::{PULL_OHM, Pull, SUPPLY_V, level};
use stm32g4_unicorn::periph::gpio::{Gpio, Pad};
use stm32g4_unicorn::periph::tim1::{Output, Tim1, Wave};

/// An input of a driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Whether the switch is on at a high level; otherwise at a low level.
    pub on_at_high: bool,
    /// Pull resistor of the input, inside the driver or on the board; if none, the input floats.
    pub pull: Option<Pull>,
    /// Thresholds, V: a level below the first is low, above the second it is high.
    pub thresholds: (f64, f64),
}

/// A half-bridge driver: one for each leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driver {
    /// Input of the high side.
    pub high: Input,
    /// Input of the low side.
    pub low: Input,
    /// Whether both switches are off if both inputs request on.
    pub interlock: bool,
    /// Time for which it keeps a switch off after the other one went off, s.
    pub dead_time_s: f64,
}

/// The request of an input over a PWM period: whether the switch is requested on, at each time. With none, the level is
/// not defined: on or off.
pub type Request = Option<Wave>;

impl Input {
    /// Returns the level of a pin that nothing drives except the chip's own resistor.
    pub fn level(&self, chip_pull: Option<bool>) -> Option<bool> {
        let chip =
            chip_pull.map(|up| Pull { volts: if up { SUPPLY_V } else { 0.0 }, ohm: PULL_OHM });
        level(self.pull.into_iter().chain(chip), self.thresholds)
    }

    fn request(&self, pin: TimerPin, output: Output, gpio: &[Gpio], period: u32) -> Request {
        let ((port, number), function) = pin;
        let port = &gpio[port];
        let asks = |wave: Wave| if self.on_at_high { wave } else { wave.inverted() };
        let driven = match port.pad(number) {
            Pad::Output(level) => Output::Driven(Wave::constant(period, level)),
            Pad::Alternate(alternate) if alternate == function => output,
            // The pin belongs to another peripheral, so its level is unknown.
            Pad::Alternate(_) => Output::Unknown,
            Pad::Input | Pad::Analog => Output::Released,
        };
        let level = self.level(port.pull(number));
        let constant = |level| Wave::constant(period, level);
        let wave = match driven {
            // The high level is not driven: the resistors set it, or nothing does.
            Output::Driven(wave) if port.open_drain(number) => {
                level.map(|high| if high { wave } else { constant(false) })
            }
            Output::Driven(wave) => Some(wave),
            Output::Unknown => None,
            Output::Released => level.map(constant),
        };
        wave.map(asks)
    }
}

impl Driver {
    /// Returns the requests of high and low side of a leg, with the timer's dead time or as if it inserted none.
    pub fn requests(
        &self,
        [high, low]: [TimerPin; 2],
        leg: usize,
        gpio: &[Gpio],
        tim1: &Tim1,
        dead_time: bool,
    ) -> [Request; 2] {
        let outputs = tim1.outputs(leg, dead_time);
        [
            self.high.request(high, outputs[0], gpio, tim1.period()),
            self.low.request(low, outputs[1], gpio, tim1.period()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ALL, REFERENCE};
    use super::*;

    #[test]
    fn a_released_pin_is_off_on_every_board_and_a_pull_against_it_is_not() {
        for stage in ALL {
            for input in [stage.driver.high, stage.driver.low] {
                assert_eq!(input.level(None), Some(!input.on_at_high), "{}", stage.name);
                // A resistor of the chip in the same direction changes nothing.
                assert_eq!(input.level(Some(!input.on_at_high)), Some(!input.on_at_high));
            }
        }
        // The chip's resistor overrides the weak ones in the driver, but not 10 kOhm.
        let [_, ihm08m1, ..] = ALL;
        assert_eq!(ihm08m1.driver.low.level(Some(false)), Some(false));
        // 2.2 V: some parts regard it as high.
        assert_eq!(ihm08m1.driver.high.level(Some(true)), None);
        assert_eq!(REFERENCE.driver.high.level(Some(true)), Some(false));
        let floating = Input { pull: None, ..REFERENCE.driver.high };
        assert_eq!(floating.level(None), None);
    }
}
