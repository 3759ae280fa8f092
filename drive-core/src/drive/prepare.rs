//! Preparation from off to the first current: offsets, bootstraps, wiring.

use super::scalar::Scalar;
use super::standstill_test::StandstillTest;
use super::{CarryOver, Common, Drive, Field, Goal, Phase, References, Start, Telemetry};
use crate::drive::state::State;
use crate::io::LOW_SIDES_ON;
use crate::protect::offsets::OffsetCheckState;
use crate::protect::wiring_check::WiringCheckState;
use crate::{AngleLoop, Coefficients, Dq, Fault, Measured, PERIOD_S, UnitVector};

/// Periods from the command to switch the low sides on to the first sample with the low sides on, with a margin.
const LOW_SIDES_ON_FROM: u32 = 4;

/// A drive in preparation. The outputs are off, or on without control.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepare {
    pub step: Preparation,
    pub job: Start,
    pub carried: CarryOver,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Preparation {
    /// The outputs are off, and the offsets are measured.
    Offsets(OffsetCheckState),
    /// The low sides are on, to charge the bootstrap capacitors; the offsets of shunts are measured again.
    LowSides(OffsetCheckState),
    /// Voltage pulses check the wiring.
    Wiring(WiringCheckState),
}

impl Prepare {
    pub fn state(&self) -> State {
        match self.step {
            Preparation::Offsets(_) => State::Calibrating,
            Preparation::LowSides(_) => State::Precharge,
            Preparation::Wiring(_) => State::CheckingWiring,
        }
    }
}

impl<L: AngleLoop> Drive<L> {
    /// Runs a step of the preparation.
    #[cold]
    pub(super) fn prepare(&mut self, measured: &Measured) -> Result<Option<[f32; 3]>, Fault> {
        let (c, k) = (&self.c, &mut self.kept);
        let Phase::Prepare(prepare) = &mut self.phase else { return Ok(None) };
        match &mut prepare.step {
            Preparation::Offsets(state) => {
                let residual = prepare.carried.residual;
                let start = c.flying_start.as_ref().zip(residual);
                let waits = start.is_some_and(|(start, flux)| start.waits(&flux, k.elapsed));
                if !waits && let Some(offsets) = c.offsets.step(state, measured)? {
                    k.offsets = offsets;
                    // A residual flux of the run before would be short-circuited by the low sides. If the wiring was not checked
                    // yet, there was no run.
                    if residual.is_some() && !k.wiring_unchecked {
                        self.energise(measured.encoder);
                    } else {
                        prepare.step = Preparation::LowSides(OffsetCheckState::default());
                        k.elapsed = 0;
                    }
                }
                return Ok(None);
            }
            Preparation::LowSides(state) => {
                // In the first samples the bridge is still off.
                if k.elapsed >= LOW_SIDES_ON_FROM {
                    c.offsets.step_again(state, measured)?;
                }
                if k.elapsed >= c.sequence.precharge {
                    // The boost of V/f control and the pulses of the commissioning check the wiring themselves.
                    if matches!(prepare.job, Start::Field(_)) && k.wiring_unchecked {
                        prepare.step = Preparation::Wiring(WiringCheckState::default());
                        k.elapsed = 0;
                    } else {
                        self.energise(measured.encoder);
                    }
                }
            }
            Preparation::Wiring(pulses) => match c.pulse(&c.wiring, pulses, measured)? {
                Some(duties) => return Ok(Some(duties)),
                None => {
                    c.wiring.judge(&pulses.answers())?;
                    k.wiring_unchecked = false;
                    self.energise(measured.encoder);
                }
            },
        }
        Ok(Some(LOW_SIDES_ON))
    }

    /// Continues with the work for which the drive was started.
    #[cold]
    fn energise(&mut self, encoder: u32) {
        let Phase::Prepare(prepare) = &self.phase else { return };
        let left = prepare.carried;
        match prepare.job {
            Start::Scalar { speed, built } => {
                self.enter(Phase::Scalar(Scalar::new(built, speed, left)));
            }
            Start::Test(wanted) => self.enter(Phase::Test(StandstillTest::new(wanted, left))),
            Start::Field(goal) => {
                let built = self.c.catches(&prepare.job).map(|start| start.built);
                // The field is large, so it is built in place.
                self.enter(Phase::Field(Field::default()));
                let (c, k, Phase::Field(field)) = (&self.c, &mut self.kept, &mut self.phase) else {
                    return;
                };
                c.begin_field(field, goal, &left);
                if let Some(built) = built {
                    c.begin_search(field, built);
                } else {
                    c.continue_at_standstill(field, k, encoder);
                }
            }
        }
    }

    /// Begins the preparation for this work.
    pub(super) fn prepare_for(&mut self, job: Start) {
        let mut carried = self.carry_over();
        let (c, k) = (&self.c, &mut self.kept);
        carried.residual = carried.residual.and_then(|residual| {
            let residual = residual.after(k.elapsed);
            c.catches(&job).filter(|start| start.is_recent(&residual)).map(|_| residual)
        });
        carried.resistance.rest(k.elapsed as f32 * PERIOD_S);
        let boost = c.volts_per_hertz.map(|turning| turning.boost_a);
        let i_d = match job {
            Start::Scalar { .. } => boost.unwrap_or(c.voltage_limit.i_d),
            Start::Field(_) | Start::Test(_) => c.voltage_limit.i_d,
        };
        c.start(k, i_d, carried.inverter_drop);
        if matches!(job, Start::Field(Goal::Learn)) {
            k.learned = None;
        }
        let step = Preparation::Offsets(OffsetCheckState::default());
        self.enter(Phase::Prepare(Prepare { step, job, carried }));
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Resets all state that does not outlive a run.
    fn start(&self, k: &mut Common, i_d: f32, inverter_drop: f32) {
        k.starts = k.starts.wrapping_add(1);
        k.offsets = [0.0; 3];
        k.seen = Telemetry { inverter_drop, ..Telemetry::still() };
        k.rotor_count = 0;
        self.start_limits(&mut k.limits);
        k.no_torque(i_d, self.injection_axis);
    }

    /// Whether the shaft is at rest, as far as the angle shows; NaN is not at rest.
    pub(super) fn is_at_standstill(&self, k: &Common) -> bool {
        k.seen.rotor_freq.abs() <= self.sequence.standing_freq
    }
}

impl Common {
    /// Sets the references to this d-axis current, A, and no torque.
    pub fn no_torque(&mut self, i_d: f32, injection_axis: UnitVector) {
        let current = Dq::new(i_d, 0.0);
        self.references = References { current, test_voltage: Dq::ZERO, injection_axis };
    }
}
