//! Measurement of the offsets of the current sensors while no current flows.

use crate::fault::Fault;
use crate::io::Measured;

/// Samples of the second measurement, which fit into the time with the low sides on.
const SAMPLES_AGAIN: u16 = 32;

/// Coefficients of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct OffsetCheck {
    /// Number of samples averaged.
    pub samples: u16,
    /// Largest accepted offset, A.
    pub largest: f32,
    /// Whether there is a third sensor and all three are shunts below the low sides.
    pub shunts: bool,
}

/// State of the measurement.
#[derive(Clone, Copy, Debug, Default)]
pub struct OffsetCheckState {
    sum: [f32; 3],
    count: u16,
}

impl OffsetCheck {
    /// Averages one sample with the outputs off. Returns `Some` with the offsets of a, b and c, A, when they are measured.
    ///
    /// # Errors
    /// [`Fault::OffsetA`], [`Fault::OffsetB`] or [`Fault::OffsetC`] when an offset is above the limit.
    pub fn step(
        &self,
        state: &mut OffsetCheckState,
        measured: &Measured,
    ) -> Result<Option<[f32; 3]>, Fault> {
        self.mean(state, measured, (self.samples, self.largest))
    }

    /// Averages one sample with all low sides on. The currents are zero too, but the shunts are connected as while the
    /// drive runs. This is done with shunts only.
    ///
    /// # Errors
    /// The faults of [`step`](Self::step), at half its limit, because the offsets change when the bridge switches.
    pub fn step_again(
        &self,
        state: &mut OffsetCheckState,
        measured: &Measured,
    ) -> Result<(), Fault> {
        if self.shunts {
            self.mean(state, measured, (SAMPLES_AGAIN, 0.5 * self.largest))?;
        }
        Ok(())
    }

    #[cold]
    fn mean(
        &self,
        state: &mut OffsetCheckState,
        measured: &Measured,
        (samples, largest): (u16, f32),
    ) -> Result<Option<[f32; 3]>, Fault> {
        let currents = [measured.phases.a, measured.phases.b, measured.third];
        state.sum.iter_mut().zip(currents).for_each(|(sum, current)| *sum += current);
        state.count = state.count.saturating_add(1);
        if state.count < samples {
            return Ok(None);
        }
        let share = 1.0 / f32::from(state.count);
        let mean = state.sum.map(|sum| sum * share);
        *state = OffsetCheckState::default();
        // NaN fails the comparison.
        match mean.map(|x| x.abs() <= largest) {
            [false, ..] => Err(Fault::OffsetA),
            [_, false, _] => Err(Fault::OffsetB),
            [_, _, false] if self.shunts => Err(Fault::OffsetC),
            _ => Ok(Some(mean)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frames::Abc;

    /// Returns the first result with these constant currents, A.
    fn found(shunts: bool, [a, b, third]: [f32; 3]) -> Result<[f32; 3], Fault> {
        let check = OffsetCheck { samples: 64, largest: 0.2, shunts };
        let (phases, mut state) = (Abc::new(a, b, -(a + b)), OffsetCheckState::default());
        let measured = Measured { phases, third, ..Measured::default() };
        let mut periods = 0;
        loop {
            periods += 1;
            if let Some(result) = check.step(&mut state, &measured).transpose() {
                assert_eq!(periods, 64);
                return result;
            }
        }
    }

    #[test]
    fn an_offset_out_of_range_is_refused_by_name() {
        let nan = f32::NAN;
        assert!(found(true, [0.1, -0.1, 0.0]).unwrap()[0] - 0.1 < 1e-6);
        for shunts in [false, true] {
            assert_eq!(found(shunts, [0.3, 0.3, 0.3]), Err(Fault::OffsetA));
            assert_eq!(found(shunts, [0.1, -0.3, 0.0]), Err(Fault::OffsetB));
            assert_eq!(found(shunts, [0.1, nan, 0.0]), Err(Fault::OffsetB));
        }
        assert_eq!(found(true, [0.1, 0.1, -0.3]), Err(Fault::OffsetC));
        assert!(found(false, [0.1, 0.1, -0.3]).is_ok());
    }

    #[test]
    fn behind_shunts_the_offsets_are_measured_again_at_half_the_limit() {
        let phases = Abc::new(0.15, 0.0, -0.15);
        let measured = Measured { phases, ..Measured::default() };
        for (shunts, expected) in [(false, Ok(())), (true, Err(Fault::OffsetA))] {
            let check = OffsetCheck { samples: 64, largest: 0.2, shunts };
            let mut state = OffsetCheckState::default();
            let again = (0..32).try_for_each(|_| check.step_again(&mut state, &measured));
            assert_eq!(again, expected);
        }
    }
}
