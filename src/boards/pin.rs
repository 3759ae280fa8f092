//! Pins of the STM32G474RE, and the peripheral signals that each pin can carry (datasheet, alternate functions and pin description; the
//! same as in the tables of `stm32g4xx-hal` 0.1.0).

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

/// A pin and the number of the alternate function that connects it.
pub type Reach = (Pin, u8);

/// Outputs of channels 1 to 3 of TIM1, each with its complementary output.
pub const TIM1_LEGS: [(&[Reach], &[Reach]); 3] = [
    (&[(pa(8), 6), (pc(0), 2)], &[(pa(7), 6), (pa(11), 6), (pb(13), 6), (pc(13), 4)]),
    (&[(pa(9), 6), (pc(1), 2)], &[(pa(12), 6), (pb(0), 6), (pb(14), 6)]),
    (&[(pa(10), 6), (pc(2), 2)], &[(pb(1), 6), (pb(9), 12), (pb(15), 4)]),
];
/// Break input of TIM1.
pub const TIM1_BKIN: [Reach; 6] =
    [(pa(6), 6), (pa(14), 6), (pb(8), 12), (pb(10), 12), (pb(12), 6), (pc(13), 2)];
/// Output of USART3.
pub const USART3_TX: [Reach; 3] = [(pb(9), 7), (pb(10), 7), (pc(10), 7)];
/// Input of USART3.
pub const USART3_RX: [Reach; 3] = [(pb(8), 7), (pb(11), 7), (pc(11), 7)];
/// Output of channel 1 of TIM8.
pub const TIM8_CH1: [Reach; 3] = [(pa(15), 2), (pb(6), 5), (pc(6), 4)];
/// Pins of every board: encoder, console, brake chopper, precharge relay, debug port.
pub const FIXED: [Pin; 8] = [pa(15), pb(3), pa(2), pa(3), pc(6), pc(8), pa(13), pa(14)];
/// Positive input of comparator 1.
pub const COMP1_INPUT: Pin = pa(1);

/// Channels of ADC1 and ADC2 that reach the same pin: `(pin, channel)`. All are among channels 1 to 9.
const ADC12: [(Pin, u8); 6] =
    [(pa(0), 1), (pa(1), 2), (pc(0), 6), (pc(1), 7), (pc(2), 8), (pc(3), 9)];
/// Channels of ADC1 only.
const ADC1: [(Pin, u8); 2] = [(pa(2), 3), (pa(3), 4)];
/// Channels of ADC2 only.
const ADC2: [(Pin, u8); 3] = [(pa(6), 3), (pa(7), 4), (pa(5), 13)];

/// Channels of ADC3 (0) and ADC4 (1): `(pin, (ADC, channel))`.
const ADC34: [(Pin, (u8, u8)); 4] =
    [(pb(13), (0, 5)), (pb(12), (1, 3)), (pb(14), (1, 4)), (pb(15), (1, 5))];

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

    /// Whether the pin is one of these, some of which may be `None`.
    pub const fn is_one_of(self, pins: &[Option<Self>]) -> bool {
        match pins {
            [] => false,
            [Some(first), ..] if first.equals(self) => true,
            [_, others @ ..] => self.is_one_of(others),
        }
    }

    /// Whether the pin is one of these.
    pub const fn is_among(self, pins: &[Self]) -> bool {
        match pins {
            [] => false,
            [first, others @ ..] => first.equals(self) || self.is_among(others),
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
        match look_up(&ADC12, self) {
            Some(channel) => Some(channel),
            None => look_up(&ADC1, self),
        }
    }

    /// ADC of the pin, ADC3 (0) or ADC4 (1), and its channel there.
    pub const fn adc34(self) -> Option<(u8, u8)> {
        look_up(&ADC34, self)
    }

    /// Channel of the pin at ADC2.
    pub const fn adc2(self) -> Option<u8> {
        match look_up(&ADC12, self) {
            Some(channel) => Some(channel),
            None => look_up(&ADC2, self),
        }
    }
}

impl core::fmt::Display for Pin {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "P{:?}{}", self.port, self.number)
    }
}
