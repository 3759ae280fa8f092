//! The outputs of the three legs at the pins: OCx and OCxN (RM0440, section 28.6.11, output control bits for
//! complementary channels with break feature).

use super::{BDTR, CCER, CCMR1, CCMR2, CR1, CR2, OSSI, OSSR, Tim1};

/// A level over a PWM period, which begins at the top of the counter: one of the two levels for a while, otherwise the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wave {
    /// Duration of the period, ticks.
    pub period: u32,
    /// Time of the change to `inside`, ticks.
    pub from: u32,
    /// Duration of `inside`, ticks; 0 for a constant level.
    pub ticks: u32,
    /// The level during that time.
    pub inside: bool,
}

/// An output of the timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The timer does not drive the pin.
    Released,
    /// The level to which the timer drives the pin.
    Driven(Wave),
    /// The mode of the channel is not modelled.
    Unknown,
}

impl Wave {
    /// Makes a constant level.
    pub fn constant(period: u32, level: bool) -> Self {
        Self { period, from: 0, ticks: 0, inside: !level }
    }

    /// Makes a level that is high in a window in the middle of the period, in which the counter is below `compare`.
    fn below(compare: u32, top: u32) -> Self {
        match compare {
            0 => Self::constant(2 * top, false),
            _ if compare >= top => Self::constant(2 * top, true),
            _ => Self { period: 2 * top, from: top - compare, ticks: 2 * compare, inside: true },
        }
    }

    /// Returns the level some ticks after the top of the counter.
    pub fn at(&self, ticks: u32) -> bool {
        let since = (ticks % self.period + self.period - self.from) % self.period;
        (since < self.ticks) == self.inside
    }

    /// Returns the inverse level.
    pub fn inverted(self) -> Self {
        Self { inside: !self.inside, ..self }
    }

    /// Inverts the level if `invert` is set.
    fn inverted_if(self, invert: bool) -> Self {
        if invert { self.inverted() } else { self }
    }

    /// Returns the instants of its changes, ticks.
    pub fn edges(&self) -> impl Iterator<Item = u32> {
        let [first, second] = [self.from, (self.from + self.ticks) % self.period];
        let count = if self.ticks == 0 { 0 } else { 2 };
        [first, second].into_iter().take(count)
    }

    /// Returns the time for which it is high in a period, ticks.
    pub fn high(&self) -> u32 {
        if self.inside { self.ticks } else { self.period - self.ticks }
    }

    /// Delays the rising edge.
    fn rising_later(self, by: u32) -> Self {
        if self.ticks == 0 {
            self
        } else if self.high() <= by {
            Self::constant(self.period, false)
        } else if self.inside {
            Self { from: self.from + by, ticks: self.ticks - by, ..self }
        } else {
            Self { ticks: self.ticks + by, ..self }
        }
    }
}

impl Tim1 {
    /// Returns the duration of a period, ticks.
    pub fn period(&self) -> u32 {
        2 * self.top
    }

    /// Returns the dead time, ticks.
    pub fn dead_time(&self) -> u32 {
        let code = self.store.get(BDTR) & 0xff;
        // CKD: the dead time counts every clock, every second or every fourth.
        let clocks = [1, 2, 4, 4][(self.store.get(CR1) >> 8 & 3) as usize];
        clocks
            * match code >> 5 {
                0..=3 => code,
                4 | 5 => 2 * (64 + (code & 0x3f)),
                6 => 8 * (32 + (code & 0x1f)),
                _ => 16 * (32 + (code & 0x1f)),
            }
    }

    /// Returns OCx and OCxN of leg `leg` with the compare value in force, with or without dead time.
    pub fn outputs(&self, leg: usize, dead_time: bool) -> [Output; 2] {
        let bdtr = self.store.get(BDTR);
        let bits = self.store.get(CCER) >> (4 * leg);
        let [on, inverted, on_n, inverted_n] = [0, 1, 2, 3].map(|n| bits >> n & 1 != 0);
        if !(on || on_n) {
            return [Output::Released; 2];
        }
        let level = |level| Output::Driven(Wave::constant(self.period(), level));
        if !self.outputs_on() {
            let idle = self.store.get(CR2) >> (8 + 2 * leg);
            let levels = [idle & 1 != 0, idle & 2 != 0];
            return if bdtr & OSSI != 0 { levels.map(level) } else { [Output::Released; 2] };
        }
        let Some(reference) = self.reference(leg) else { return [Output::Unknown; 2] };
        let inactive = |inverted| if bdtr & OSSR != 0 { level(inverted) } else { Output::Released };
        match (on, on_n) {
            (true, false) => {
                [Output::Driven(reference.inverted_if(inverted)), inactive(inverted_n)]
            }
            (false, _) => [inactive(inverted), Output::Driven(reference.inverted_if(inverted_n))],
            (true, true) => {
                let dead_time = if dead_time { self.dead_time() } else { 0 };
                let both = [reference, reference.inverted()].map(|w| w.rising_later(dead_time));
                [both[0].inverted_if(inverted), both[1].inverted_if(inverted_n)].map(Output::Driven)
            }
        }
    }

    /// Returns OCxREF; none in a mode that is not modelled.
    fn reference(&self, leg: usize) -> Option<Wave> {
        let register = self.store.get([CCMR1, CCMR2][leg / 2]) >> (8 * (leg % 2));
        let below = if self.counting() {
            Wave::below(self.active[leg], self.top)
        } else {
            Wave::constant(self.period(), self.held < self.active[leg])
        };
        // OCxM has its highest bit apart from the others.
        match register >> 4 & 7 | (register >> 16 & 1) << 3 {
            // Frozen since reset, forced inactive, forced active.
            0 | 4 => Some(Wave::constant(self.period(), false)),
            5 => Some(Wave::constant(self.period(), true)),
            6 => Some(below),
            7 => Some(below.inverted()),
            _ => None,
        }
    }

    /// Returns the time after a top of the counter, ticks, at which the compare value of channel 4 triggers; none if it
    /// does not.
    pub fn trigger_after_top(&self) -> Option<u64> {
        let after = self.rises_after(0, self.active[3]).filter(|_| self.counting());
        after.map(|ticks| u64::from(self.top) + ticks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_what_the_comparison_of_the_counter_says() {
        for compare in 0..=12 {
            let wave = Wave::below(compare, 10);
            assert_eq!(wave.high(), 2 * compare.min(10));
            for tick in 0..20_u32 {
                // Down from the top, and up again; evaluated at the tick between two counts.
                let below =
                    (2 * tick.abs_diff(10)).saturating_sub(u32::from(tick >= 10)) < 2 * compare;
                let edge = tick.abs_diff(10) == compare;
                assert!(edge || wave.at(tick) == below, "{compare} {tick}");
                assert_eq!(wave.inverted().at(tick), !wave.at(tick));
            }
        }
    }

    #[test]
    fn the_dead_time_shortens_what_is_on_at_its_beginning() {
        let wave = Wave::below(3, 10).rising_later(2);
        let on: Vec<_> = (0..20).filter(|t| wave.at(*t)).collect();
        assert_eq!(on, [9, 10, 11, 12]);
        let low = Wave::below(3, 10).inverted().rising_later(2);
        let on: Vec<_> = (0..20).filter(|t| low.at(*t)).collect();
        assert_eq!(on, [0, 1, 2, 3, 4, 5, 6, 15, 16, 17, 18, 19]);
        // A pulse that is not longer than the dead time vanishes; a constant level has no edge.
        assert_eq!(Wave::below(1, 10).rising_later(2), Wave::constant(20, false));
        assert_eq!(Wave::below(0, 10).inverted().rising_later(2), Wave::constant(20, true));
    }
}
