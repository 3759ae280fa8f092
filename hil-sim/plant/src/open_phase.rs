//! A phase that is interrupted between inverter and motor.

use crate::complex::{Complex, dot};
use crate::integrate::MotorModel;
use crate::model::{ElectricalState as _, MachineModel, Rate};

/// Unit vectors along which the current lies while phase a, b or c is without current.
pub(crate) const LINES: [Complex; 3] = [
    Complex::new(0.0, 1.0),
    Complex::new(0.866_025_403_784_438_6, 0.5),
    Complex::new(0.866_025_403_784_438_6, -0.5),
];

/// The interrupted phase: 0, 1 or 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OpenPhase(pub usize);

impl OpenPhase {
    /// Derivative of the state and terminal voltage, where the inverter gives `v` to the phases that are left.
    #[inline(never)]
    pub(crate) fn rates<M: MachineModel>(
        self,
        machine: &M,
        x: &M::State,
        v: Complex,
        w: f64,
    ) -> (Rate<M>, Complex) {
        // Along this axis the leg of the open phase has no part.
        let axis = LINES[self.0];
        machine.derivative_on_line(x, dot(v, axis), axis, w)
    }

    /// Takes what current the phase has; at the interruption its energy goes into the arc.
    #[inline(never)]
    pub(crate) fn confine<M: MachineModel>(self, motor: &mut MotorModel<M>) {
        let (axis, x) = (LINES[self.0], &motor.state.electrical);
        motor.state.electrical = motor.machine.with_current(x, axis * dot(x.current(), axis));
    }
}
