//! The selection of the machine model.

use crate::energy::EnergyMachine;
use crate::integrate::MotorModel;
use crate::machine::Machine;

/// The motor, with one variant for each machine model. A call of the plant selects once a period.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a plant has one, and model A is not behind a pointer"
)]
pub(crate) enum Motor {
    A(MotorModel<Machine>),
    Energy(Box<MotorModel<EnergyMachine>>),
}

/// Evaluates `$body` with `$motor` bound to the [`MotorModel`] of either machine model.
macro_rules! whichever {
    ($which:expr, $motor:ident => $body:expr) => {
        match $which {
            Motor::A($motor) => $body,
            Motor::Energy($motor) => $body,
        }
    };
}
pub(crate) use whichever;
