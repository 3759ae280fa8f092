//! Front end of the drive: converts ADC counts to SI units (section 3.2, Eq. 3.5), and duties to timer counts.
//!
//! ```text
//! Sample -> FrontEnd::measure -> Measured -> Drive::step -> Output -> FrontEnd::put_out -> Compare
//! ```
//!
//! [`Drive::period`](crate::Drive::period) runs all three. The coefficients of the front end are part of the coefficients of the
//! drive ([`Drive::front_end`](crate::Drive::front_end)), which also has the offsets. The state of the front end is kept beside
//! the drive.

pub(crate) mod shunts;

use crate::fault::Fault;
use crate::io::{Compare, Measured, Output, Sample};
use crate::line::Line;
use crate::math::frames::Abc;
use crate::protect::HeatSink;
use shunts::{ShuntState, Shunts};

/// Coefficients of the front end.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FrontEnd {
    /// Calibration of current a, A, from the ADC counts of a [`Sample`].
    pub current_a: Line,
    /// Calibration of current b, A.
    pub current_b: Line,
    /// The third current, with three shunts below the low sides.
    pub shunts: Option<Shunts>,
    /// Calibration of the dc-link voltage, V.
    pub dc_link: Line,
    /// Whether the ADC counts of a current are the sum of two conversions, one in each zero vector.
    pub both_zero_vectors: bool,
    /// Largest ADC counts of a current. At this value, or at 0, its channel is saturated.
    pub full_scale: u16,
    /// Compare value at which a high side is on all the time.
    pub top: f32,
    /// Checks of the heat sink.
    pub heat_sink: HeatSink,
}

/// State of the front end. The default is the state with the outputs off.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrontEndState {
    shunts: ShuntState,
}

impl FrontEnd {
    /// Corrects a gain `mismatch` = (gain of a) / (gain of b) - 1, half on each channel.
    pub(crate) fn correct_mismatch(&mut self, mismatch: f32) {
        self.current_a = self.current_a.scaled(1.0 - 0.5 * mismatch);
        self.current_b = self.current_b.scaled(1.0 + 0.5 * mismatch);
    }

    /// Converts ADC counts to SI units and subtracts the `offsets` of the current sensors a, b and c, A. It also checks the counts against
    /// their limits and, with three shunts, the sum of the currents.
    pub fn measure(
        &self,
        state: &mut FrontEndState,
        sample: &Sample,
        [offset_a, offset_b, offset_c]: [f32; 3],
    ) -> Measured {
        let mut a = self.current_a.without(offset_a, sample.current_a);
        let mut b = self.current_b.without(offset_b, sample.current_b);
        let mut third = None;
        if let Some(shunts) = &self.shunts {
            let c = shunts.current_c.without(offset_c, sample.current_c);
            third = Some(c);
            (a, b) = shunts.choose(&mut state.shunts, [a, b, c]);
        }
        let c = -(a + b);
        Measured {
            phases: Abc { a, b, c },
            third: third.unwrap_or(c),
            dc_link: self.dc_link.at(sample.dc_link),
            heat_sink: self.heat_sink.share(sample.heat_sink),
            encoder: sample.encoder,
            hardware: sample.hardware,
            fault: self.check(state, sample),
        }
    }

    /// Converts the output of a step to timer counts.
    pub fn put_out(&self, state: &mut FrontEndState, output: &Output) -> Compare {
        let Some(duties) = output.duties else {
            *state = FrontEndState::default();
            return Compare::OFF;
        };
        if self.shunts.is_some() {
            state.shunts.applied(duties);
        }
        self.compare(duties)
    }

    /// Returns the timer counts of duties.
    pub(crate) fn compare(&self, duties: [f32; 3]) -> Compare {
        // The result is rounded to the nearest integer, 0 for NaN. The cast to u32 is one instruction of the core; a saturating
        // cast to u16 would be twelve.
        let [a, b, c] = duties.map(|duty| (duty * self.top + 0.5) as u32 as u16);
        Compare { a, b, c, enabled: true }
    }

    /// Returns the fault of a sensor that cannot be trusted.
    fn check(&self, state: &FrontEndState, sample: &Sample) -> Option<Fault> {
        let saturated = |code: u16| code == 0 || code >= self.full_scale;
        let (least, most) = self.heat_sink.window;
        match &self.shunts {
            _ if saturated(sample.current_a) => Some(Fault::SensorSaturatedA),
            _ if saturated(sample.current_b) => Some(Fault::SensorSaturatedB),
            _ if sample.heat_sink < least || sample.heat_sink > most => {
                Some(self.heat_sink.fault(sample.heat_sink))
            }
            Some(_) if saturated(sample.current_c) => Some(Fault::SensorSaturatedC),
            Some(shunts) if !shunts.sums_to_zero(&state.shunts) => Some(Fault::CurrentSum),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Ntc;

    fn front_end() -> FrontEnd {
        FrontEnd {
            current_a: Line::CHANNEL_A,
            current_b: Line::CHANNEL_B,
            shunts: None,
            dc_link: Line { gain: 0.11, offset: 0.0 },
            both_zero_vectors: false,
            full_scale: 4095,
            top: 14_167.0,
            heat_sink: Ntc::default().checks(70.0, 85.0),
        }
    }

    fn measured(sample: &Sample, offsets: [f32; 3]) -> Measured {
        front_end().measure(&mut FrontEndState::default(), sample, offsets)
    }

    #[test]
    fn table_4_gives_the_currents_that_were_set() {
        // These are ADC counts of Table 4; Eq. 3.5 leaves residuals up to 8.7 mA (A) and 10.2 mA (B).
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
            let m = measured(&sample, [0.0; 3]);
            assert!((m.phases.a - amperes).abs() < 0.0088, "{}", m.phases.a);
            assert!((m.phases.b - amperes).abs() < 0.0103, "{}", m.phases.b);
            assert_eq!(m.phases.c, -(m.phases.a + m.phases.b));
        }
    }

    #[test]
    fn offsets_are_taken_off() {
        let sample = Sample { current_a: 2060, current_b: 1990, ..Sample::default() };
        let at_rest = measured(&sample, [0.0; 3]).phases;
        assert!(at_rest.a.abs() > 0.05);
        let phases = measured(&sample, [at_rest.a, at_rest.b, 0.0]).phases;
        assert!(phases.a.abs() < 1e-6 && phases.b.abs() < 1e-6);
    }

    #[test]
    fn both_ends_of_the_range_are_saturated() {
        let sample =
            Sample { current_a: 2000, current_b: 2000, heat_sink: 1309, ..Sample::default() };
        let found = |sample: &Sample| measured(sample, [0.0; 3]).fault;
        let (cold, hot) = front_end().heat_sink.window;
        let cases = [
            (Sample { current_a: 0, ..sample }, Some(Fault::SensorSaturatedA)),
            (Sample { current_a: 1, ..sample }, None),
            (Sample { current_b: 4095, ..sample }, Some(Fault::SensorSaturatedB)),
            (Sample { current_b: 4094, ..sample }, None),
            (Sample { heat_sink: cold - 1, ..sample }, Some(Fault::ThermistorOpen)),
            (Sample { heat_sink: cold, ..sample }, None),
            (Sample { heat_sink: hot + 1, ..sample }, Some(Fault::OverTemperature)),
            (Sample { heat_sink: hot, ..sample }, None),
            (sample, None),
            (Sample { heat_sink: 4095, ..sample }, Some(Fault::ThermistorShorted)),
        ];
        for (sample, fault) in cases {
            assert_eq!(found(&sample), fault, "{sample:?}");
        }
    }

    #[test]
    fn the_third_shunt_is_checked_where_there_is_one() {
        let shunts = Shunts::new(Line { gain: 0.01, offset: -20.0 }, 5e-6, 0.5);
        let front_end = FrontEnd { shunts: Some(shunts), ..front_end() };
        let sample = |current_c| Sample {
            current_a: 2024,
            current_b: 2016,
            current_c,
            heat_sink: 1309,
            ..Sample::default()
        };
        // This returns the fault after so many samples.
        let after = |current_c, samples| {
            let mut state = FrontEndState::default();
            (0..samples)
                .map(|_| front_end.measure(&mut state, &sample(current_c), [0.0; 3]).fault)
                .last()
                .unwrap()
        };
        let cases = [
            (2000, 100, None),
            (0, 1, Some(Fault::SensorSaturatedC)),
            (4095, 1, Some(Fault::SensorSaturatedC)),
            (1, 1, Some(Fault::CurrentSum)),
            // 0.6 A too much are above the limit of the mean after two time constants.
            (2060, 1, None),
            (2060, 100, Some(Fault::CurrentSum)),
            (1940, 100, Some(Fault::CurrentSum)),
            (2040, 1000, None),
        ];
        for (current_c, samples, fault) in cases {
            assert_eq!(after(current_c, samples), fault, "{current_c}, {samples} samples");
        }
        // Without shunts the third reading has no meaning.
        assert_eq!(measured(&sample(0), [0.0; 3]).fault, None);
    }
}
