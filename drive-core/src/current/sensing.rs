//! Conversion of ADC codes to amperes and volts (section 3.2, Eq. 3.5), and offset calibration.

use super::shunts::{ShuntState, Shunts};
use crate::protect::HeatSink;
use crate::{Abc, AlphaBeta, Compare, Fault, Line, Sample};

/// Samples of the second calibration: the time with the low sides on holds them.
const SAMPLES_AGAIN: u16 = 32;

/// Coefficients of the sensing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensing {
    /// Calibration of current a, A.
    pub current_a: Line,
    /// Calibration of current b, A.
    pub current_b: Line,
    /// The third current, with three shunts below the low sides.
    pub shunts: Option<Shunts>,
    /// Calibration of the dc-link voltage, V.
    pub dc_link: Line,
    /// Largest code of a current channel. At this code, or at 0, the channel is saturated.
    pub full_scale: u16,
    /// Checks of the heat sink.
    pub heat_sink: HeatSink,
    /// Number of samples averaged for the offsets.
    pub calibration_samples: u16,
    /// Largest accepted offset, A.
    pub largest_offset: f32,
}

/// State of the sensing: the offsets measured at start.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensingState {
    /// Offset-corrected value at code 0, channels a, b and c, A.
    zeros: [f32; 3],
    sum: [f32; 3],
    count: u16,
    shunts: ShuntState,
}

/// One sample in SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Phase currents into the motor, A; c is -(a + b).
    pub phases: Abc,
    /// The current in the stator frame, A peak.
    pub current: AlphaBeta,
    /// Dc-link voltage, V.
    pub dc_link: f32,
}

impl Sensing {
    /// Corrects a gain `mismatch` = (gain of a) / (gain of b) - 1, half on each channel.
    pub fn correct_mismatch(&mut self, mismatch: f32) {
        self.current_a = self.current_a.scaled(1.0 - 0.5 * mismatch);
        self.current_b = self.current_b.scaled(1.0 + 0.5 * mismatch);
    }

    /// Converts codes to SI units and subtracts the offsets.
    pub fn step(&self, state: &mut SensingState, sample: &Sample) -> Measured {
        let mut a = self.current_a.gain * f32::from(sample.current_a) + state.zeros[0];
        let mut b = self.current_b.gain * f32::from(sample.current_b) + state.zeros[1];
        if let Some(shunts) = &self.shunts {
            let c = shunts.current_c.gain * f32::from(sample.current_c) + state.zeros[2];
            (a, b) = shunts.choose(&mut state.shunts, [a, b, c]);
        }
        Measured {
            phases: Abc::new(a, b, -(a + b)),
            current: AlphaBeta::from_two_phases(a, b),
            dc_link: self.dc_link.at(sample.dc_link),
        }
    }

    /// Notes the output of a step; see `ShuntState::applied`.
    pub fn applied(&self, state: &mut SensingState, compare: &Compare) {
        if self.shunts.is_some() {
            state.shunts.applied(compare);
        }
    }

    /// Checks the codes against their limits, and with three shunts the sum of the currents.
    ///
    /// # Errors
    /// [`Fault::SensorSaturatedA`], [`Fault::SensorSaturatedB`], [`Fault::SensorSaturatedC`], [`Fault::CurrentSum`] or
    /// that of the heat sink.
    pub fn check(&self, state: &SensingState, sample: &Sample) -> Result<(), Fault> {
        let saturated = |code: u16| code == 0 || code >= self.full_scale;
        let (least, most) = self.heat_sink.window;
        match &self.shunts {
            _ if saturated(sample.current_a) => Err(Fault::SensorSaturatedA),
            _ if saturated(sample.current_b) => Err(Fault::SensorSaturatedB),
            _ if sample.heat_sink < least || sample.heat_sink > most => {
                Err(self.heat_sink.fault(sample.heat_sink))
            }
            Some(_) if saturated(sample.current_c) => Err(Fault::SensorSaturatedC),
            Some(shunts) if !shunts.sums_to_zero(&state.shunts) => Err(Fault::CurrentSum),
            _ => Ok(()),
        }
    }

    /// Resets `state` to the calibration lines of the settings, without offset correction.
    pub fn start(&self, state: &mut SensingState) {
        let zeros = self.lines().map(|line| line.offset);
        *state = SensingState { zeros, ..SensingState::default() };
    }

    /// Calibration of a, b and c; of c that of b if there is no sensor c.
    fn lines(&self) -> [Line; 3] {
        let c = self.shunts.as_ref().map_or(self.current_b, |shunts| shunts.current_c);
        [self.current_a, self.current_b, c]
    }

    /// Offsets of a and b that were measured, A.
    pub fn offsets(&self, state: &SensingState) -> [f32; 2] {
        let [a, b, _] = state.zeros;
        [self.current_a.offset - a, self.current_b.offset - b]
    }

    /// Averages one sample with the outputs off; `Some` when the offsets are measured.
    ///
    /// # Errors
    /// [`Fault::OffsetA`], [`Fault::OffsetB`] or [`Fault::OffsetC`] when an offset is above the limit; the offsets in use
    /// stay unchanged.
    #[cold]
    pub fn calibrate(
        &self,
        state: &mut SensingState,
        sample: &Sample,
    ) -> Result<Option<()>, Fault> {
        let offsets = self.lines().map(|line| line.offset);
        let limits = (self.calibration_samples, self.largest_offset);
        let Some(mean) = self.mean(state, sample, offsets, limits)? else {
            return Ok(None);
        };
        for ((zero, offset), mean) in state.zeros.iter_mut().zip(offsets).zip(mean) {
            *zero = offset - mean;
        }
        Ok(Some(()))
    }

    /// Averages one sample with all low sides on, where the currents are zero as well but the shunts are connected as they
    /// are while the drive runs. Only with shunts.
    ///
    /// # Errors
    /// As [`calibrate`](Self::calibrate), at half its limit: the offsets change when the bridge switches.
    #[cold]
    pub fn calibrate_again(&self, state: &mut SensingState, sample: &Sample) -> Result<(), Fault> {
        if self.shunts.is_some() {
            self.mean(state, sample, state.zeros, (SAMPLES_AGAIN, 0.5 * self.largest_offset))?;
        }
        Ok(())
    }

    /// Adds a sample to the mean currents, A, with these values at code 0; `Some` when there are `samples` of them. None may
    /// be above `largest`, A.
    fn mean(
        &self,
        state: &mut SensingState,
        sample: &Sample,
        zeros: [f32; 3],
        (samples, largest): (u16, f32),
    ) -> Result<Option<[f32; 3]>, Fault> {
        let codes = [sample.current_a, sample.current_b, sample.current_c];
        let lines = self.lines();
        for (((sum, line), zero), code) in state.sum.iter_mut().zip(lines).zip(zeros).zip(codes) {
            *sum += line.gain * f32::from(code) + zero;
        }
        state.count = state.count.saturating_add(1);
        if state.count < samples {
            return Ok(None);
        }
        let share = 1.0 / f32::from(state.count);
        let mean = state.sum.map(|sum| sum * share);
        state.sum = [0.0; 3];
        state.count = 0;
        // NaN fails the comparison.
        match mean.map(|x| x.abs() <= largest) {
            [false, ..] => Err(Fault::OffsetA),
            [_, false, _] => Err(Fault::OffsetB),
            [_, _, false] if self.shunts.is_some() => Err(Fault::OffsetC),
            _ => Ok(Some(mean)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Ntc;

    fn sensing() -> Sensing {
        Sensing {
            current_a: Line::CHANNEL_A,
            current_b: Line::CHANNEL_B,
            shunts: None,
            dc_link: Line { gain: 0.11, offset: 0.0 },
            full_scale: 4095,
            heat_sink: Ntc::default().checks(70.0, 85.0),
            calibration_samples: 64,
            largest_offset: 0.2,
        }
    }

    #[test]
    fn table_4_gives_the_currents_that_were_set() {
        // Codes of Table 4; Eq. 3.5 leaves residuals up to 8.7 mA (A) and 10.2 mA (B).
        let table = [
            (-3.0, 666, 671),
            (-2.0, 1117, 1118),
            (-1.0, 1567, 1566),
            (0.0, 2024, 2016),
            (1.0, 2478, 2463),
            (2.0, 2927, 2916),
            (3.0, 3375, 3356),
        ];
        for (amperes, current_a, current_b) in table {
            let sample = Sample { current_a, current_b, ..Sample::default() };
            let mut state = SensingState::default();
            sensing().start(&mut state);
            let m = sensing().step(&mut state, &sample);
            assert!((m.phases.a - amperes).abs() < 0.0088, "{}", m.phases.a);
            assert!((m.phases.b - amperes).abs() < 0.0103, "{}", m.phases.b);
            assert_eq!(m.phases.c, -(m.phases.a + m.phases.b));
        }
    }

    #[test]
    fn offsets_are_averaged_and_taken_off() {
        let (sensing, mut state) = (sensing(), SensingState::default());
        sensing.start(&mut state);
        let sample = Sample { current_a: 2060, current_b: 1990, ..Sample::default() };
        let before = sensing.step(&mut state, &sample);
        assert!(before.phases.a.abs() > 0.05);
        while sensing.calibrate(&mut state, &sample).unwrap().is_none() {}
        let after = sensing.step(&mut state, &sample);
        assert!(after.phases.a.abs() < 1e-4 && after.phases.b.abs() < 1e-4);
    }

    #[test]
    fn an_offset_out_of_range_is_refused_by_name() {
        let (sensing, mut state) = (sensing(), SensingState::default());
        let sample = Sample { current_a: 2022, current_b: 2400, ..Sample::default() };
        let fault = loop {
            match sensing.calibrate(&mut state, &sample) {
                Ok(None) => {}
                other => break other,
            }
        };
        assert_eq!(fault, Err(Fault::OffsetB));
    }

    #[test]
    fn both_ends_of_the_range_are_saturated() {
        let sample =
            Sample { current_a: 2000, current_b: 2000, heat_sink: 1309, ..Sample::default() };
        let state = SensingState::default();
        assert_eq!(sensing().check(&state, &sample), Ok(()));
        let (cold, hot) = sensing().heat_sink.window;
        let cases = [
            (Sample { current_a: 0, ..sample }, Err(Fault::SensorSaturatedA)),
            (Sample { current_a: 1, ..sample }, Ok(())),
            (Sample { current_b: 4095, ..sample }, Err(Fault::SensorSaturatedB)),
            (Sample { current_b: 4094, ..sample }, Ok(())),
            (Sample { heat_sink: cold - 1, ..sample }, Err(Fault::ThermistorOpen)),
            (Sample { heat_sink: cold, ..sample }, Ok(())),
            (Sample { heat_sink: hot + 1, ..sample }, Err(Fault::OverTemperature)),
            (Sample { heat_sink: hot, ..sample }, Ok(())),
            (Sample { heat_sink: 4095, ..sample }, Err(Fault::ThermistorShorted)),
        ];
        for (sample, found) in cases {
            assert_eq!(sensing().check(&state, &sample), found, "{sample:?}");
        }
    }
}
