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

/// The phases that are connected to a source.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Terminals<S> {
    /// All three.
    All(S),
    /// All but this one, 0 to 2, whose current is zero.
    Without(usize, S),
    /// None; the current is zero.
    None,
}

impl<S: Source> Terminals<S> {
    /// The source, with this phase interrupted.
    #[inline]
    pub(crate) fn new(source: S, open: Option<usize>) -> Self {
        match open {
            None => Self::All(source),
            Some(phase) => Self::Without(phase, source),
        }
    }

    /// Derivative of the state, and terminal voltage.
    #[inline(always)]
    pub(crate) fn rates<M: MachineModel>(
        &self,
        machine: &M,
        x: &M::State,
        w: f64,
    ) -> (Rate<M>, Complex) {
        match self {
            Self::All(source) => {
                let v = source.voltage(x.current());
                (machine.derivative(x, v, w), v)
            }
            Self::Without(phase, source) => {
                // Along this axis the leg of the open phase has no part.
                let axis = LINES[*phase];
                machine.derivative_on_line(x, dot(source.voltage(x.current()), axis), axis, w)
            }
            Self::None => machine.derivative_open(x, w),
        }
    }

    /// Takes what current the open phases have. At an interruption its energy goes into the arc; later it is
    /// an error of rounding.
    pub(crate) fn confine<M: MachineModel>(&self, machine: &M, x: &mut M::State) {
        let i = match self {
            Self::All(_) => return,
            Self::Without(phase, _) => without(x.current(), *phase),
            Self::None => Complex::ZERO,
        };
        *x = machine.with_current(x, i);
    }
}

/// The current `i` less that of this phase.
pub(crate) fn without(i: Complex, phase: usize) -> Complex {
    LINES[phase] * dot(i, LINES[phase])
}
