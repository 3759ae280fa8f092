//! From converter codes to amperes and volts (section 3.2, Eq. 3.5), and the offset calibration.

use crate::fault::Fault;
use crate::io::Sample;
use crate::math::frames::{Abc, AlphaBeta};

/// Calibration line of one channel: `value = gain * code + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Units per code.
    pub gain: f32,
    /// Value at code 0.
    pub offset: f32,
}

impl Line {
    /// Channel A of the dissertation's board, Eq. 3.5.
    pub const CHANNEL_A: Self = Self { gain: 0.002_212_0, offset: -4.472_713_4 };
    /// Channel B, Eq. 3.5, with all printed digits.
    #[allow(clippy::excessive_precision)]
    pub const CHANNEL_B: Self = Self { gain: 0.002_231_4, offset: -4.496_623_8 };

    /// The line times a factor.
    pub fn scaled(self, factor: f32) -> Self {
        Self { gain: factor * self.gain, offset: factor * self.offset }
    }

    /// Value at a code.
    pub fn at(self, code: u16) -> f32 {
        self.gain * f32::from(code) + self.offset
    }
}

/// Codes between which nothing is wrong: one subtraction and one comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    lowest: u16,
    span: u16,
}

impl Window {
    /// No code of a converter.
    pub const NONE: Self = Self { lowest: u16::MAX, span: 0 };

    /// The codes whose values lie between two, at or inside them, and within the range of a converter
    /// without its two ends; `full_scale` is its largest code.
    // Not inlined: it stands once, and there is time when it is called.
    #[inline(never)]
    pub fn new(line: Line, values: [f32; 2], full_scale: u16) -> Self {
        // A code further in: what is computed here is rounded.
        let [from, to] = values.map(|x| (x - line.offset) / line.gain);
        let (from, to) = ((from + 2.0) as u16, (to - 1.0) as u16);
        let lowest = if from > 1 { from } else { 1 };
        let below = full_scale.saturating_sub(1);
        let highest = if to < below { to } else { below };
        match highest.checked_sub(lowest) {
            Some(span) => Self { lowest, span },
            None => Self::NONE,
        }
    }

    /// Whether a code is among them.
    #[inline]
    pub fn has(self, code: u16) -> bool {
        // (In the width of the core: a subtraction of 16 bits is two instructions.)
        u32::from(code).wrapping_sub(u32::from(self.lowest)) <= u32::from(self.span)
    }
}

/// Coefficients of the sensing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensing {
    /// Current a, A.
    pub current_a: Line,
    /// Current b, A.
    pub current_b: Line,
    /// Dc-link voltage, V.
    pub dc_link: Line,
    /// Largest code a current channel can give. At it, or at 0, the channel is saturated.
    pub full_scale: u16,
    /// Heat-sink codes above this are too hot.
    pub heat_sink_trip: u16,
    /// Samples to average for the offsets.
    pub calibration_samples: u16,
    /// Largest offset that is believed, A.
    pub largest_offset: f32,
    /// Largest phase current, A.
    pub trip_a: f32,
    /// Codes of a dc link that is neither too high nor too low.
    pub dc_window: Window,
}

/// State of the sensing: what was found at start.
#[derive(Clone, Copy, Debug)]
pub struct SensingState {
    /// Value at code 0 with that of no current taken off, channels a and b, A.
    zeros: [f32; 2],
    /// Codes of currents that are neither too large nor at an end of the range; none before the offsets
    /// are known.
    windows: [Window; 2],
    sum: [f32; 2],
    count: u16,
}

impl Default for SensingState {
    /// Nothing known; see [`Sensing::start`].
    fn default() -> Self {
        Self { zeros: [0.0; 2], windows: [Window::NONE; 2], sum: [0.0; 2], count: 0 }
    }
}

/// One sample in SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Phase currents, A; c is -(a + b).
    pub phases: Abc,
    /// The same in the stator frame, A peak.
    pub current: AlphaBeta,
    /// Dc-link voltage, V.
    pub dc_link: f32,
}

impl Sensing {
    /// Takes out that the gain of channel a is too large by this share of that of b, half on each.
    pub fn take_mismatch(&mut self, mismatch: f32) {
        self.current_a = self.current_a.scaled(1.0 - 0.5 * mismatch);
        self.current_b = self.current_b.scaled(1.0 + 0.5 * mismatch);
    }

    /// Codes to SI units, offsets taken off.
    pub fn step(&self, state: &SensingState, sample: &Sample) -> Measured {
        let a = self.current_a.gain * f32::from(sample.current_a) + state.zeros[0];
        let b = self.current_b.gain * f32::from(sample.current_b) + state.zeros[1];
        Measured {
            phases: Abc::new(a, b, -(a + b)),
            current: AlphaBeta::from_two_phases(a, b),
            dc_link: self.dc_link.at(sample.dc_link),
        }
    }

    /// Whether all codes are well inside their limits, and the third current, A, too. If not, something may be
    /// wrong; what it is takes longer to say.
    #[inline]
    pub fn is_well_inside(&self, state: &SensingState, sample: &Sample, current_c: f32) -> bool {
        state.windows[0].has(sample.current_a)
            & state.windows[1].has(sample.current_b)
            & self.dc_window.has(sample.dc_link)
            & (sample.heat_sink <= self.heat_sink_trip)
            & (current_c.abs() <= self.trip_a)
    }

    /// The fault of a saturated channel or a hot heat sink, if any.
    pub fn check(&self, sample: &Sample) -> Option<Fault> {
        if self.saturated(sample.current_a) {
            Some(Fault::SensorSaturatedA)
        } else if self.saturated(sample.current_b) {
            Some(Fault::SensorSaturatedB)
        } else if sample.heat_sink > self.heat_sink_trip {
            Some(Fault::OverTemperature)
        } else {
            None
        }
    }

    fn saturated(&self, code: u16) -> bool {
        code == 0 || code >= self.full_scale
    }

    /// Begins with the lines as they are set, and no offsets known.
    #[inline]
    pub fn start(&self, state: &mut SensingState) {
        *state = SensingState {
            zeros: [self.current_a.offset, self.current_b.offset],
            ..SensingState::default()
        };
    }

    /// Averages one sample with the outputs off. `Some` once enough were averaged.
    ///
    /// # Errors
    /// The fault when an offset is beyond the largest that is believed; no offset is changed then.
    pub fn calibrate(
        &self,
        state: &mut SensingState,
        sample: &Sample,
    ) -> Result<Option<()>, Fault> {
        state.sum[0] += self.current_a.at(sample.current_a);
        state.sum[1] += self.current_b.at(sample.current_b);
        state.count = state.count.saturating_add(1);
        if state.count < self.calibration_samples {
            return Ok(None);
        }
        let mean = 1.0 / f32::from(state.count);
        let (a, b) = (state.sum[0] * mean, state.sum[1] * mean);
        state.sum = [0.0; 2];
        state.count = 0;
        // Written so that not-a-number fails the test.
        let within = |x: f32| x.abs() <= self.largest_offset;
        match (within(a), within(b)) {
            (false, _) => Err(Fault::OffsetA),
            (_, false) => Err(Fault::OffsetB),
            _ => {
                state.zeros = [self.current_a.offset - a, self.current_b.offset - b];
                let window = |line: Line, offset: f32| {
                    let values = [offset - self.trip_a, offset + self.trip_a];
                    Window::new(line, values, self.full_scale)
                };
                state.windows = [window(self.current_a, a), window(self.current_b, b)];
                Ok(Some(()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensing() -> Sensing {
        Sensing {
            current_a: Line::CHANNEL_A,
            current_b: Line::CHANNEL_B,
            dc_link: Line { gain: 0.11, offset: 0.0 },
            full_scale: 4095,
            heat_sink_trip: 4000,
            calibration_samples: 64,
            largest_offset: 0.2,
            trip_a: 4.0,
            dc_window: Window::new(Line { gain: 0.11, offset: 0.0 }, [200.0, 410.0], 4095),
        }
    }

    /// What is well inside is inside; and only some codes at the limits are not well inside.
    #[test]
    fn windows_lie_inside_their_limits() {
        let s = sensing();
        let mut state = SensingState::default();
        let rest = Sample { current_a: 2040, current_b: 1990, dc_link: 2827, ..Sample::default() };
        assert!(!s.is_well_inside(&state, &rest, 0.0), "not calibrated");
        while s.calibrate(&mut state, &rest).unwrap().is_none() {}
        for code in 0..=4095 {
            let limits = |value: f32, low: f32, high: f32| (low..=high).contains(&value);
            let (a, b) = (Sample { current_a: code, ..rest }, Sample { current_b: code, ..rest });
            let dc = Sample { dc_link: code, ..rest };
            let inside = |x: &Sample, value: f32, low: f32, high: f32, lsb: f32| {
                let fine = limits(value, low, high) && s.check(x).is_none();
                let well =
                    limits(value, low + 3.0 * lsb, high - 3.0 * lsb) && (4..4092).contains(&code);
                let said = s.is_well_inside(&state, x, 0.0);
                assert!(fine || !said, "{code}: not fine, but said to be well inside");
                assert!(said || !well, "{code}: well inside, but not said to be");
            };
            inside(&a, s.step(&state, &a).phases.a, -4.0, 4.0, 0.0023);
            inside(&b, s.step(&state, &b).phases.b, -4.0, 4.0, 0.0023);
            inside(&dc, s.step(&state, &dc).dc_link, 200.0, 410.0, 0.11);
        }
        assert!(!s.is_well_inside(&state, &Sample { heat_sink: 4001, ..rest }, 0.0));
        assert!(!s.is_well_inside(&state, &rest, -4.01));
        assert!(!s.is_well_inside(&state, &rest, f32::NAN));
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
            let m = sensing().step(&state, &sample);
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
        let before = sensing.step(&state, &sample);
        assert!(before.phases.a.abs() > 0.05);
        while sensing.calibrate(&mut state, &sample).unwrap().is_none() {}
        let after = sensing.step(&state, &sample);
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
        let sample = Sample { current_a: 2000, current_b: 2000, ..Sample::default() };
        assert_eq!(sensing().check(&sample), None);
        assert_eq!(
            sensing().check(&Sample { current_a: 0, ..sample }),
            Some(Fault::SensorSaturatedA)
        );
        assert_eq!(
            sensing().check(&Sample { current_b: 4095, ..sample }),
            Some(Fault::SensorSaturatedB)
        );
        assert_eq!(
            sensing().check(&Sample { heat_sink: 4001, ..sample }),
            Some(Fault::OverTemperature)
        );
    }
}
