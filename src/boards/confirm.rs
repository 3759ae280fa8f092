//! Assumptions of a board, and the number that confirms them.

use super::{Board, Source};
use crate::hash;

impl Board {
    /// What is assumed, with the bench step for it.
    pub fn assumptions(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let step = |source: Source| match source {
            Source::Assumed(step) => Some(step),
            Source::Read(_) => None,
        };
        self.sources().into_iter().filter_map(move |(item, source)| Some((item, step(source?)?)))
    }

    /// The items of the power stage with their sources; none for an item that the board does not have.
    pub fn sources(&self) -> [(&'static str, Option<Source>); 11] {
        let [a, b] = self.currents.a_and_b();
        let settle = match &self.currents {
            super::Currents::LowSide { settle_s, .. } => Some(settle_s.source),
            super::Currents::InLine(_) => None,
        };
        [
            ("high sides: level that switches on", Some(self.high.on_at.source)),
            ("low sides: level that switches on", Some(self.low.on_at.source)),
            ("fault input: level that trips", Some(self.fault.trips_at.source)),
            ("dead time", Some(self.dead_time_s.source)),
            ("scale of current a", Some(a.line.source)),
            ("scale of current b", Some(b.line.source)),
            ("scale of current c", self.currents.c().map(|c| c.line.source)),
            ("settling of the shunts", settle),
            ("scale of the dc link", Some(self.dc_link.line.source)),
            ("highest dc link", Some(self.highest_dc_link_v.source)),
            ("thermistor", Some(self.ntc.source)),
        ]
    }

    /// The number that a confirmation saves: of the board's name and its assumed values, so that it does not hold for
    /// other values. Never 0.
    pub fn confirmation(&self) -> u32 {
        let [a, b] = self.currents.a_and_b();
        let line = |sensor: &super::Analog| [sensor.line.value.gain, sensor.line.value.offset];
        let c = self.currents.c().map_or([0.0; 2], |c| line(&c));
        let levels = [self.high.on_at, self.low.on_at, self.fault.trips_at];
        let numbers = [
            [self.dead_time_s.value, self.highest_dc_link_v.value],
            line(&a),
            line(&b),
            c,
            line(&self.dc_link),
        ];
        let bytes =
            self.name.bytes().chain(levels.iter().map(|level| level.value as u8)).chain(
                numbers.as_flattened().iter().flat_map(|number| number.to_bits().to_le_bytes()),
            );
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
        let numbers = ALL.map(|board| board.confirmation());
        assert!(numbers.iter().all(|n| (1..1 << 24).contains(n)));
        assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2] && numbers[0] != numbers[2]);
        let mut other = *ALL[1];
        other.dead_time_s.value *= 1.1;
        assert_ne!(other.confirmation(), ALL[1].confirmation());
        let mut other = *ALL[1];
        other.low.on_at.value = super::super::Level::High;
        assert_ne!(other.confirmation(), ALL[1].confirmation());
    }
}
