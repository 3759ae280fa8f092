//! Circuits at the terminals of the motor.

use crate::complex::{Complex, dot};
use crate::model::{ElectricalState as _, MachineModel, Rate};

/// Unit vectors along which the current vector lies while phase a, b or c carries no current.
const LINES: [Complex; 3] = [
    Complex::new(0.0, 1.0),
    Complex::new(0.866_025_403_784_438_6, 0.5),
    Complex::new(0.866_025_403_784_438_6, -0.5),
];

/// A voltage source.
pub(crate) trait Source {
    /// Line-to-neutral voltage, V, at the stator current `i`, A.
    fn voltage(&self, i: Complex) -> Complex;
}

/// A constant voltage.
impl Source for Complex {
    #[inline(always)]
    fn voltage(&self, _: Complex) -> Complex {
        *self
    }
}

/// The circuit at the terminals. (Each circuit has its own type, so that the usual one pays nothing for the others.)
pub(crate) trait Terminals {
    /// Returns the derivative of the state, and the terminal voltage.
    fn rates<M: MachineModel>(&self, machine: &M, x: &M::State, w: f64) -> (Rate<M>, Complex);

    /// Removes the current of open phases. At an interruption the energy of that current goes into the arc; later the
    /// current is only a rounding error.
    fn confine<M: MachineModel>(&self, _: &M, _: &mut M::State) {}
}

/// All three phases are connected to a source.
pub(crate) struct All<S>(pub S);

/// All phases but this one, 0 to 2, are connected to a source.
pub(crate) struct Without<S>(pub usize, pub S);

/// No phase is connected.
pub(crate) struct Open;

impl<S: Source> Terminals for All<S> {
    #[inline(always)]
    fn rates<M: MachineModel>(&self, machine: &M, x: &M::State, w: f64) -> (Rate<M>, Complex) {
        let v = self.0.voltage(x.current());
        (machine.derivative(x, v, w), v)
    }
}

impl<S: Source> Terminals for Without<S> {
    fn rates<M: MachineModel>(&self, machine: &M, x: &M::State, w: f64) -> (Rate<M>, Complex) {
        // The leg of the open phase has no component along this axis.
        let axis = LINES[self.0];
        machine.derivative_on_line(x, dot(self.1.voltage(x.current()), axis), axis, w)
    }

    fn confine<M: MachineModel>(&self, machine: &M, x: &mut M::State) {
        *x = machine.with_current(x, without(x.current(), self.0));
    }
}

impl Terminals for Open {
    fn rates<M: MachineModel>(&self, machine: &M, x: &M::State, w: f64) -> (Rate<M>, Complex) {
        machine.derivative_open(x, w)
    }

    fn confine<M: MachineModel>(&self, machine: &M, x: &mut M::State) {
        *x = machine.with_current(x, Complex::ZERO);
    }
}

/// Returns the current `i` without the component of this phase.
pub(crate) fn without(i: Complex, phase: usize) -> Complex {
    LINES[phase] * dot(i, LINES[phase])
}
