//! What the terminals of the motor are connected to.

use crate::complex::{Complex, dot};
use crate::model::{ElectricalState as _, MachineModel, Rate};

/// Unit vectors along which the current lies while phase a, b or c is without current.
const LINES: [Complex; 3] = [
    Complex::new(0.0, 1.0),
    Complex::new(0.866_025_403_784_438_6, 0.5),
    Complex::new(0.866_025_403_784_438_6, -0.5),
];

/// A source of voltage.
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

/// What the terminals are connected to. (A type each: the usual one pays nothing for the others.)
pub(crate) trait Terminals {
    /// Derivative of the state, and terminal voltage.
    fn rates<M: MachineModel>(&self, machine: &M, x: &M::State, w: f64) -> (Rate<M>, Complex);

    /// Takes what current the open phases have. At an interruption its energy goes into the arc; later it is
    /// an error of rounding.
    fn confine<M: MachineModel>(&self, _: &M, _: &mut M::State) {}
}

/// All three phases are connected to a source.
pub(crate) struct All<S>(pub S);

/// All but this phase, 0 to 2.
pub(crate) struct Without<S>(pub usize, pub S);

/// None is.
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
        // Along this axis the leg of the open phase has no part.
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

/// The current `i` less that of this phase.
pub(crate) fn without(i: Complex, phase: usize) -> Complex {
    LINES[phase] * dot(i, LINES[phase])
}
