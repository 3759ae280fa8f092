//! Pins of the STM32G474RE, and the peripheral signals that each pin can carry.
//!
//! After a reset some pins have a resistor of the chip until the firmware sets them up, which a circuit there has to withstand: PB4 and
//! PB6 a pull-down of 5.1 kOhm (dead battery, USB-C), PA15 and PB4 a pull-up of about 40 kOhm (debug port).

/// A port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// GPIOA.
    A,
    /// GPIOB.
    B,
    /// GPIOC.
    C,
}

/// A pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Its port.
    pub port: Port,
    /// Its number in the port.
    pub number: u8,
}

/// Pin `number` of port A.
pub const fn pa(number: u8) -> Pin {
    Pin { port: Port::A, number }
}

/// Pin `number` of port B.
pub const fn pb(number: u8) -> Pin {
    Pin { port: Port::B, number }
}

/// Pin `number` of port C.
pub const fn pc(number: u8) -> Pin {
    Pin { port: Port::C, number }
}

/// A pin and the number by which a peripheral selects it: the alternate function, the channel of an ADC, or the input of a comparator.
pub type Reach = (Pin, u8);
/// A pin, which of two peripherals reaches it (0 or 1), and its number there.
pub type ReachOfTwo = (Pin, (u8, u8));

include!("reach.in");

/// Outputs of channels 1 to 3 of TIM1, each with its complementary output.
pub const TIM1_LEGS: [(&[Reach], &[Reach]); 3] =
    [(TIM1_CH1, TIM1_CH1N), (TIM1_CH2, TIM1_CH2N), (TIM1_CH3, TIM1_CH3N)];

const fn look_up<T: Copy>(table: &[(Pin, T)], pin: Pin) -> Option<T> {
    let mut i = 0;
    while i < table.len() {
        if table[i].0.equals(pin) {
            return Some(table[i].1);
        }
        i += 1;
    }
    None
}

impl Pin {
    /// Equality, when compiling.
    pub const fn equals(self, other: Self) -> bool {
        self.port as u8 == other.port as u8 && self.number == other.number
    }

    /// How many of these pins it is.
    pub const fn times(self, pins: &[Self]) -> usize {
        match pins {
            [] => 0,
            [first, others @ ..] => first.equals(self) as usize + self.times(others),
        }
    }

    /// How many of these pins it is, some of which may be `None`.
    pub const fn times_of_some(self, pins: &[Option<Self>]) -> usize {
        match pins {
            [] => 0,
            [Some(first), others @ ..] => first.equals(self) as usize + self.times_of_some(others),
            [None, others @ ..] => self.times_of_some(others),
        }
    }

    /// Whether the peripheral signal reaches this pin.
    pub const fn is(self, signal: &[Reach]) -> bool {
        look_up(signal, self).is_some()
    }

    /// The alternate function that connects this pin with the signal; 0 if none does.
    pub const fn function(self, signal: &[Reach]) -> u8 {
        match look_up(signal, self) {
            Some(function) => function,
            None => 0,
        }
    }

    /// Channel of the pin at ADC1.
    pub const fn adc1(self) -> Option<u8> {
        look_up(ADC1, self)
    }

    /// Channel of the pin at ADC2.
    pub const fn adc2(self) -> Option<u8> {
        look_up(ADC2, self)
    }

    /// ADC of the pin, ADC3 (0) or ADC4 (1), and its channel there.
    pub const fn adc34(self) -> Option<(u8, u8)> {
        look_up(ADC34, self)
    }

    /// Comparator of the pin, COMP1 (0) or COMP3 (1), and its input there. Both can be compared with channel 1 of DAC3.
    pub const fn comparator(self) -> Option<(u8, u8)> {
        look_up(COMP13, self)
    }
}

impl core::fmt::Display for Pin {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "P{:?}{}", self.port, self.number)
    }
}
