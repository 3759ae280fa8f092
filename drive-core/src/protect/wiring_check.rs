//! Wiring check: verifies assignment and polarity of the current sensors with short voltage pulses, once,
//! before the flux is built up.
//!
//! Each phase in turn gets a positive and a negative voltage pulse along its axis. In such a short time the
//! motor acts as its transient inductance. The current of that phase rises to a known peak, and the
//! currents of the two others to half of it with opposite sign. A correct sensor responds most to the pulse
//! of its own phase, with the sign of the pulse:
//!
//! | error | response |
//! |---|---|
//! | sensor or phase open | none to any pulse |
//! | sensor reversed | largest to its own phase, negative |
//! | sensors exchanged, or legs against sensors | largest to another phase |
//!
//! Two phases that are exchanged between sensors and motor are not detected: a motor at rest responds in
//! the same way, and only turns in the other direction.
//!
//! # Current bound
//! The pulses are designed for an expected current with the inductance of the settings. It is 0.2 A with the dissertation's
//! motor, in proportion to the rated current, and more if the pulse would not exceed the dead time (for a spindle 2 A, a
//! sixth of the rated peak). Every sample is checked against the current that half that inductance would give, plus a
//! margin for noise. A motor with at least half the inductance therefore stays below twice the expected current with any
//! sensor readings. With less inductance, a working sensor ends the pulse at the next sample, which keeps the current below
//! 2.5 times the expected one down to a fifth of the inductance.

use crate::{Abc, AlphaBeta, Fault, PERIOD_S};

/// Peak current with half the inductance, relative to the expected one.
const LARGEST: f32 = 2.0;
/// Threshold of a response relative to the expected one: half the response with twice the inductance.
const LEAST_SHARE: f32 = 0.25;
/// Shortest rise, periods: its first sample can still end the pulse if the current rises too fast.
const SHORTEST_RISE: u32 = 2;
/// Longest rise, periods, beyond which the resistance dominates the response.
const LONGEST_RISE: u32 = 60;
/// Pause after a pulse, periods.
const REST: u32 = 8;
/// Pulses per phase and sign.
const ROUNDS: u32 = 2;
/// Number of phases times signs.
const PULSES_PER_ROUND: u32 = 6;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WiringCheck {
    /// Peak current with the inductance of the settings, A.
    expected: f32,
    /// Margin for noise and the residual current of the previous pulse, A.
    noise: f32,
    /// Amplitude of the pulses, V peak.
    volts: f32,
    /// Duration of the rise and of the fall, periods.
    rise: u32,
}

/// State of the check.
#[derive(Clone, Copy, Debug, Default)]
pub struct WiringCheckState {
    /// Control period within the pulse.
    period: u32,
    /// Number of the pulse.
    pulse: u32,
    /// Summed responses of sensors a and b to the pulses on phases a, b, c, A.
    answers: [[f32; 2]; 3],
}

/// Part of a pulse in the next control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Voltage in the stator frame, V peak.
    pub voltage: AlphaBeta,
    /// Expected current in the stator frame, A peak, for the dead-time compensation.
    pub current: AlphaBeta,
}

/// Unit vectors along phases a, b, c.
const AXES: [AlphaBeta; 3] = [
    AlphaBeta { alpha: 1.0, beta: 0.0 },
    AlphaBeta { alpha: -0.5, beta: 0.866_025_4 },
    AlphaBeta { alpha: -0.5, beta: -0.866_025_4 },
];

/// Motor and bounds of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WiringSettings {
    /// Transient inductance of the motor, H.
    pub sigma_ls: f32,
    /// Peak current of the pulses with this inductance, A.
    pub expected_a: f32,
    /// Margin for noise and the residual current of the previous pulse, A: ten times the rms of the noise.
    pub noise_a: f32,
    /// Largest voltage of a pulse, V: available at the lowest dc link in use, and far above the voltage error of
    /// the dead time. A larger inductance gets a longer pulse.
    pub highest_v: f32,
}

impl WiringCheckState {
    /// Returns the mean responses of sensors a and b to the pulses on phases a, b and c, A, once all pulses have been applied.
    pub fn answers(&self) -> [[f32; 2]; 3] {
        // These are loops, because `map` of a nested array is not inlined and the interrupt calls nothing outside its memory.
        let mut answers = self.answers;
        for answer in answers.iter_mut().flatten() {
            *answer *= 1.0 / (2 * ROUNDS) as f32;
        }
        answers
    }
}

impl WiringCheck {
    /// Designs the pulses.
    pub fn new(s: &WiringSettings) -> Self {
        let volt_periods = s.expected_a * s.sigma_ls / PERIOD_S;
        let rise = (volt_periods / s.highest_v) as u32 + 1;
        let rise = rise.clamp(SHORTEST_RISE, LONGEST_RISE);
        let volts = volt_periods / rise as f32;
        let volts = if volts < s.highest_v { volts } else { s.highest_v };
        Self { expected: s.expected_a, noise: s.noise_a, volts, rise }
    }

    /// Processes one sample of the phase currents, A. Returns `None` when all pulses have been
    /// applied; then [judge](WiringCheck::judge) the responses.
    ///
    /// # Errors
    /// [`Fault::WiringCurrent`] when the current exceeds its bound.
    pub fn step(&self, state: &mut WiringCheckState, phases: Abc) -> Result<Option<Pulse>, Fault> {
        // The voltage computed in period n acts from sample n + 1 on and shows in sample n + 2.
        let risen = state.period.saturating_sub(1);
        let share = if risen < self.rise { risen as f32 / self.rise as f32 } else { 1.0 };
        let allowed = LARGEST * self.expected * share + self.noise;
        Fault::WiringCurrent.unless(phases.a.abs() < allowed && phases.b.abs() < allowed)?;
        let sign = if state.pulse.is_multiple_of(2) { 1.0 } else { -1.0 };
        let leg = (state.pulse / 2 % 3) as usize;
        if risen == self.rise {
            state.answers[leg][0] += sign * phases.a;
            state.answers[leg][1] += sign * phases.b;
        }
        let volts = if state.period < self.rise {
            sign * self.volts
        } else if state.period < 2 * self.rise {
            -sign * self.volts
        } else {
            0.0
        };
        let flowing = if state.period <= 2 * self.rise { sign * self.expected } else { 0.0 };
        state.period += 1;
        if state.period >= 2 * self.rise + REST {
            state.period = 0;
            state.pulse += 1;
            if state.pulse >= PULSES_PER_ROUND * ROUNDS {
                return Ok(None);
            }
        }
        Ok(Some(Pulse { voltage: AXES[leg] * volts, current: AXES[leg] * flowing }))
    }

    /// Evaluates the responses.
    ///
    /// # Errors
    /// [`Fault::WiringNoCurrent`], [`Fault::WiringExchanged`], [`Fault::WiringPolarityA`] or
    /// [`Fault::WiringPolarityB`].
    #[cold]
    pub fn judge(&self, answers: &[[f32; 2]; 3]) -> Result<(), Fault> {
        let [a, b, c] = *answers;
        let least = LEAST_SHARE * self.expected;
        // These are the responses of a sensor to its own phase and to the two others.
        let (at_a, at_b) = ([a[0], b[0], c[0]], [b[1], a[1], c[1]]);
        let silent = |[x, y, z]: [f32; 3]| x.abs() < least && y.abs() < least && z.abs() < least;
        let exchanged = |[own, y, z]: [f32; 3]| own.abs() < y.abs() || own.abs() < z.abs();
        match () {
            () if silent(at_a) || silent(at_b) => Err(Fault::WiringNoCurrent),
            () if exchanged(at_a) || exchanged(at_b) => Err(Fault::WiringExchanged),
            () if a[0] < 0.0 => Err(Fault::WiringPolarityA),
            () if b[1] < 0.0 => Err(Fault::WiringPolarityB),
            () => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXPECTED_A: f32 = 0.2;
    const HIGHEST_V: f32 = 60.0;

    /// Returns the pulses for the dissertation's motor and board.
    fn pulses(sigma_ls: f32) -> WiringCheck {
        WiringCheck::new(&WiringSettings {
            sigma_ls,
            expected_a: EXPECTED_A,
            noise_a: 0.05,
            highest_v: HIGHEST_V,
        })
    }

    proptest! {
        /// With any measurements the check ends, and the voltage is never higher than its limit.
        #[test]
        fn it_ends(sigma_ls in 1e-6_f32..100.0, bits: [u32; 16]) {
            let check = pulses(sigma_ls);
            let mut state = WiringCheckState::default();
            let longest = (2 * LONGEST_RISE + REST) * PULSES_PER_ROUND * ROUNDS;
            let ends = (0..longest).any(|n| {
                let current = |k: usize| f32::from_bits(bits[(n as usize + k) % 16]);
                match check.step(&mut state, Abc::new(current(0), current(1), 0.0)) {
                    Ok(Some(Pulse { voltage, .. })) => {
                        assert!(voltage.length_squared() <= HIGHEST_V * HIGHEST_V * 1.000_1);
                        false
                    }
                    _ => true,
                }
            });
            prop_assert!(ends);
        }
    }

    #[test]
    fn not_a_number_is_no_current() {
        let check = pulses(0.05);
        let nan = Abc::new(f32::NAN, 0.0, 0.0);
        let next = check.step(&mut WiringCheckState::default(), nan);
        assert_eq!(next, Err(Fault::WiringCurrent));
    }

    /// Returns the result of the check on a motor of `inductance` H, while 51.5 mH are expected, with the
    /// readings of `sensors`; and the largest phase current, A.
    fn check(inductance: f32, sensors: fn(Abc) -> Abc) -> (Result<(), Fault>, f32) {
        let check = pulses(0.0515);
        let (mut state, mut current, mut largest) =
            (WiringCheckState::default(), AlphaBeta::ZERO, 0.0_f32);
        let mut acting = AlphaBeta::ZERO;
        loop {
            match check.step(&mut state, sensors(current.to_abc())) {
                Ok(Some(Pulse { voltage, current: flowing })) => {
                    // The expected current flows while the voltage acts.
                    current += acting * (PERIOD_S / inductance);
                    if voltage != AlphaBeta::ZERO {
                        let along = flowing.alpha * current.alpha + flowing.beta * current.beta;
                        assert!(along > -1e-4 && (flowing.length_squared() - 0.04).abs() < 1e-6);
                    }
                    acting = voltage;
                    let Abc { a, b, c } = current.to_abc();
                    largest = largest.max(a.abs()).max(b.abs()).max(c.abs());
                }
                Ok(None) => return (check.judge(&state.answers()), largest),
                Err(fault) => return (Err(fault), largest),
            }
        }
    }

    #[test]
    fn right_wiring_passes_with_the_current_that_was_meant() {
        let (result, largest) = check(0.0515, |i| i);
        assert_eq!(result, Ok(()));
        assert!((largest - EXPECTED_A).abs() < 0.01, "{largest}");
        // A motor with half or twice the inductance still passes.
        for inductance in [0.027, 0.1] {
            assert_eq!(check(inductance, |i| i).0, Ok(()), "{inductance}");
        }
    }

    #[test]
    fn wrong_wiring_is_named() {
        type Sensors = fn(Abc) -> Abc;
        let cases: [(Sensors, Fault); 9] = [
            (|i| Abc::new(-i.a, i.b, 0.0), Fault::WiringPolarityA),
            (|i| Abc::new(i.a, -i.b, 0.0), Fault::WiringPolarityB),
            (|i| Abc::new(-i.a, -i.b, 0.0), Fault::WiringPolarityA),
            (|i| Abc::new(i.b, i.a, 0.0), Fault::WiringExchanged),
            (|i| Abc::new(i.c, i.b, 0.0), Fault::WiringExchanged),
            (|i| Abc::new(i.a, i.c, 0.0), Fault::WiringExchanged),
            (|i| Abc::new(0.0, i.b, 0.0), Fault::WiringNoCurrent),
            (|i| Abc::new(i.a, 0.0, 0.0), Fault::WiringNoCurrent),
            (|i| Abc::new(0.2 * i.a, i.b, 0.0), Fault::WiringNoCurrent),
        ];
        for (n, (sensors, fault)) in cases.into_iter().enumerate() {
            assert_eq!(check(0.0515, sensors).0, Err(fault), "case {n}");
        }
        assert_eq!(check(0.0515, |i| Abc::new(0.3 * i.a, i.b, 0.0)).0, Ok(()));
    }

    /// Responses at the threshold and equal responses pass. A response to another phase alone is distinguished from no response.
    #[test]
    fn answers_at_the_bounds_are_told_apart() {
        let l = LEAST_SHARE * EXPECTED_A;
        let less = 0.99 * l;
        for (answers, expected) in [
            ([[l, 0.0], [0.0, l], [0.0; 2]], Ok(())),
            ([[l, l], [-l, l], [0.0; 2]], Ok(())),
            ([[l, 0.0], [0.0, l], [l, -l]], Ok(())),
            ([[less, -less], [less, l], [less, 0.0]], Err(Fault::WiringNoCurrent)),
            ([[l, less], [0.0, less], [0.0, -less]], Err(Fault::WiringNoCurrent)),
            ([[0.0, 0.0], [l, l], [0.0; 2]], Err(Fault::WiringExchanged)),
            ([[0.0, 0.0], [0.0, l], [-l, 0.0]], Err(Fault::WiringExchanged)),
            ([[l, -l], [0.0, 0.0], [0.0; 2]], Err(Fault::WiringExchanged)),
            ([[l, 0.0], [0.0, 0.0], [0.0, l]], Err(Fault::WiringExchanged)),
            ([[-l, 0.0], [0.0, -l], [0.0; 2]], Err(Fault::WiringPolarityA)),
            ([[l, 0.0], [0.0, -l], [0.0; 2]], Err(Fault::WiringPolarityB)),
        ] {
            assert_eq!(pulses(0.0515).judge(&answers), expected, "{answers:?}");
        }
    }

    #[test]
    fn too_little_inductance_ends_it_within_the_bound() {
        for share in [0.4, 0.3, 0.21] {
            let (result, largest) = check(share * 0.0515, |i| i);
            assert_eq!(result, Err(Fault::WiringCurrent), "{share}");
            assert!(largest < 0.5, "{share}: {largest}");
        }
        // A current without a voltage is refused.
        for bad in [Abc::new(0.06, 0.0, 0.0), Abc::new(0.0, -0.06, 0.0)] {
            let next = pulses(0.05).step(&mut WiringCheckState::default(), bad);
            assert_eq!(next, Err(Fault::WiringCurrent));
        }
    }
}
