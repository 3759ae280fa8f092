//! Test signals to a motor at rest, for the [commissioning](crate::commission).
//!
//! One controller regulates the current along phase a, with an optional injection. The voltage across phase a is
//! the injection alone, without control. The dead time is not compensated, since the commissioning measures it.

use super::{CarryOver, Common, Drive, Phase, Start};
use crate::carrier::{CARRIER_COS, CARRIER_SAMPLES};
use crate::current::{Pi, PiState, pi::ReferenceState};
use crate::drive::command::{Accepted, Refused};
use crate::drive::state::State;
use crate::drive::test_signal::{Regulator, TestReport, TestSignal};
use crate::filter::{LPF, LpfState};
use crate::io::LOW_SIDES_ON;
use crate::math::{all_finite, limited};
use crate::protect::WiringCheck;
use crate::protect::wiring_check::WiringCheckState;
use crate::{Abc, AlphaBeta, AngleLoop, Coefficients, Dq, Fault, Measured};

/// Control periods in which the injection rises to its amplitude: twenty injection periods.
const RAMP: f32 = 20.0 * CARRIER_SAMPLES as f32;

/// State of a drive that tests a motor at rest.
#[derive(Clone, Debug, Default)]
pub(super) struct StandstillTest {
    wanted: TestSignal,
    low_pass: LpfState,
    control: Control,
    /// Number of pulse trains that have ended.
    trains: u32,
    pulses: WiringCheckState,
    pub carried: CarryOver,
}

/// State of the current along phase a and of the injection.
#[derive(Clone, Copy, Debug, Default)]
struct Control {
    regulator: PiState,
    reference: ReferenceState,
    /// Present amplitude of the injection, V.
    carrier: AlphaBeta,
    /// Sample within the injection period.
    index: usize,
    /// Register of the binary sequence; zero before its first sample.
    register: u8,
}

/// Returns the next sample, plus or minus one, of the maximum-length sequence by x^8 + x^6 + x^5 + x^4 + 1.
pub(super) fn next_bit(register: &mut u8) -> f32 {
    let r = if *register == 0 { 1 } else { *register };
    *register = (r << 1) | ((r >> 7 ^ r >> 5 ^ r >> 4 ^ r >> 3) & 1);
    if r & 1 == 1 { 1.0 } else { -1.0 }
}

impl StandstillTest {
    pub fn new(wanted: TestSignal, carried: CarryOver) -> Self {
        Self { wanted, carried, ..Self::default() }
    }

    pub fn state(&self) -> State {
        match self.wanted {
            TestSignal::Pulses(_) => State::CheckingWiring,
            TestSignal::Rest | TestSignal::Current { .. } => State::Exciting,
        }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Runs a step of a test of a motor at rest.
    #[cold]
    pub(super) fn step_test(
        &self,
        test: &mut StandstillTest,
        k: &mut Common,
        measured: &Measured,
    ) -> Result<[f32; 3], Fault> {
        let current = measured.current();
        let mut realised = AlphaBeta::ZERO;
        let mut duties = LOW_SIDES_ON;
        match test.wanted {
            TestSignal::Pulses(pulses) => {
                let duties = self.pulse(&WiringCheck::new(&pulses), &mut test.pulses, measured)?;
                if duties.is_none() {
                    test.trains = test.trains.wrapping_add(1);
                    (test.control, test.wanted) = (Control::default(), TestSignal::Rest);
                    k.elapsed = 0;
                }
                return Ok(duties.unwrap_or(LOW_SIDES_ON));
            }
            TestSignal::Rest => {
                LPF.step(&mut test.low_pass, current);
            }
            TestSignal::Current { amperes, regulator, carrier, binary } => {
                let s = &mut test.control;
                let Regulator { k_c, z_c, direct, filtered } = regulator;
                let pi = Pi { k_c, z_c };
                let reference = pi.filter(&mut s.reference, direct, amperes);
                let behind = LPF.step(&mut test.low_pass, current);
                let seen = if filtered { behind } else { current };
                let along = pi.step(&mut s.regulator, reference - seen.alpha);
                let largest = (carrier.alpha.abs() + carrier.beta.abs() + 1.0) * (1.0 / RAMP);
                s.carrier.alpha += limited(carrier.alpha - s.carrier.alpha, largest);
                s.carrier.beta += limited(carrier.beta - s.carrier.beta, largest);
                let cos = CARRIER_COS.get(s.index).copied().unwrap_or(0.0);
                s.index = if s.index + 1 < CARRIER_SAMPLES { s.index + 1 } else { 0 };
                let factor = if binary { next_bit(&mut s.register) } else { cos };
                let wanted = AlphaBeta::new(along, 0.0) + s.carrier * factor;
                if !wanted.is_finite() {
                    return Err(self.not_finite(k, true).unwrap_or(Fault::NonFiniteState));
                }
                let modulated = self.modulator.step(wanted, Abc::ZERO, measured.dc_link);
                if modulated.limited {
                    s.regulator.back_calculate(modulated.realised.alpha - wanted.alpha);
                }
                realised = modulated.realised;
                duties = modulated.duties;
            }
        }
        let seen = &mut k.seen;
        (seen.measured, seen.realised) = (current, realised);
        seen.dc_link = measured.dc_link;
        // The thermal loads use this current.
        seen.current = Dq::new(current.alpha, current.beta);
        Ok(duties)
    }
}

impl<L: AngleLoop> Drive<L> {
    /// Whether the measurements of the last step are to be passed to the `Collector`.
    pub fn is_testing(&self) -> bool {
        matches!(&self.phase, Phase::Test(test) if test.state() == State::Exciting)
    }

    /// Returns the quantities of the drive that the commissioning needs.
    pub fn test_report(&self) -> TestReport {
        let (trains, answers) = match &self.phase {
            Phase::Test(test) => (test.trains, test.pulses.answers()),
            _ => Default::default(),
        };
        TestReport {
            state: self.present_state(),
            starts: self.kept.starts,
            offsets: [self.kept.offsets[0], self.kept.offsets[1]],
            trains,
            answers,
        }
    }

    /// Executes [`Command::Test`](super::Command::Test).
    pub(super) fn take_test(&mut self, wanted: TestSignal) -> Result<Accepted, Refused> {
        if let TestSignal::Current { amperes, regulator, carrier, .. } = wanted {
            let max = self.c.protection.trip_a;
            let numbers = [amperes, regulator.k_c, regulator.z_c, regulator.direct];
            if !(all_finite(&numbers) && carrier.is_finite()) {
                return Err(Refused::NotFinite);
            }
            if amperes.abs() > max {
                return Err(Refused::OutOfRange { min: -max, max });
            }
        }
        if let Phase::Test(test) = &mut self.phase {
            (test.wanted, self.kept.elapsed) = (wanted, 0);
            if let TestSignal::Pulses(_) = wanted {
                test.pulses = WiringCheckState::default();
            }
            return Ok(Accepted::AsGiven);
        }
        self.start(Start::Test(wanted))
    }
}
