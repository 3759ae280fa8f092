//! The number that confirms a board.

use super::{Board, Currents};
use crate::hash;

impl Board {
    /// The number that a confirmation saves. It covers the board's name, its values, and the words of the settings that are `in_force`
    /// beside them, so that it does not hold for other values. Never 0.
    pub fn confirmation(&self, in_force: impl Iterator<Item = u32>) -> u32 {
        let Currents { a, b, shunts } = &self.currents;
        let line = |sensor: &super::Analog| [sensor.line.value.gain, sensor.line.value.offset];
        let c = shunts.map_or([0.0; 2], |shunts| line(&shunts.c));
        let levels = [self.high.on_at, self.low.on_at, self.fault.trips_at];
        let limits = &self.dc_link_limits;
        let numbers = [
            [self.dead_time_s.value, self.fault.pull_ohm.value],
            [limits.operation.value, limits.comparator_v()],
            line(a),
            line(b),
            c,
            line(&self.dc_link),
        ];
        let words = numbers.as_flattened().iter().map(|number| number.to_bits()).chain(in_force);
        let levels = levels.iter().map(|level| level.value as u8);
        let bytes = self.name.bytes().chain(levels).chain(words.flat_map(u32::to_le_bytes));
        // A number of the console has 24 bits.
        (hash::of(bytes) >> 8).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::ALL;

    #[test]
    fn the_names_are_those_of_the_boards() {
        assert_eq!(super::super::ALL_NAMES, super::super::NAMES.join(" "));
    }

    #[test]
    fn every_board_with_assumptions_names_the_bench_step() {
        for board in ALL {
            assert!(board.assumptions().count() > 0, "{}", board.name);
            for (item, step) in board.assumptions() {
                assert!(step.len() > 20, "{} {item}: {step}", board.name);
            }
        }
    }

    #[test]
    fn a_confirmation_holds_for_one_board_with_its_values_only() {
        let number = |board: &super::Board| board.confirmation(core::iter::empty());
        let numbers = ALL.map(number);
        assert!(numbers.iter().all(|n| (1..1 << 24).contains(n)));
        assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2] && numbers[0] != numbers[2]);
        let mut other = *ALL[1];
        other.dead_time_s.value *= 1.1;
        assert_ne!(number(&other), numbers[1]);
        let mut other = *ALL[1];
        other.low.on_at.value = super::super::Level::High;
        assert_ne!(number(&other), numbers[1]);
        assert_ne!(ALL[1].confirmation([0].into_iter()), ALL[1].confirmation([1].into_iter()));
    }
}
