//! Steady states of a machine model, and its small-signal behaviour about them.

use nalgebra::{DMatrix, DVector};
use sim_bench::plant::{EnergyRate, EnergyState, Machine, MachineState, Rate};

use crate::prelude::*;

/// Step of the numerical derivatives, relative to the size of a state.
const STEP: f64 = 1e-6;
const ITERATIONS: usize = 60;

/// A machine whose integrated state is a list of space vectors that all rotate with the flux.
pub(crate) trait Listed: MachineModel {
    /// Returns the integrated vectors, in a fixed order.
    fn list(&self, x: &Self::State) -> Vec<Complex64>;
    /// Returns their rates, in the same order.
    fn rates(&self, k: &Rate<Self>) -> Vec<Complex64>;
    /// Makes the state from these vectors.
    fn state(&self, list: &[Complex64]) -> Self::State;
}

impl Listed for Machine {
    fn list(&self, x: &MachineState) -> Vec<Complex64> {
        vec![x.i, x.psi, x.i_lp]
    }

    fn rates(&self, k: &MachineState) -> Vec<Complex64> {
        self.list(k)
    }

    fn state(&self, list: &[Complex64]) -> MachineState {
        MachineState { i: list[0], psi: list[1], i_lp: list[2] }
    }
}

impl Listed for EnergyMachine {
    fn list(&self, x: &EnergyState) -> Vec<Complex64> {
        integrated(self, [x.psi_s, x.psi_r, x.psi_deep, x.psi_iron])
    }

    fn rates(&self, k: &EnergyRate) -> Vec<Complex64> {
        integrated(self, [k.psi_s, k.psi_r, k.psi_deep, k.psi_iron])
    }

    fn state(&self, list: &[Complex64]) -> EnergyState {
        let mut rest = list[2..].iter();
        let mut next = |there: bool| if there { rest.next().copied() } else { None };
        let psi_deep = next(self.has_skin_effect()).unwrap_or_default();
        let psi_iron = next(self.has_iron_loss()).unwrap_or_default();
        let (psi_s, psi_r) = (list[0], list[1]);
        let mut x = EnergyState::of_fluxes([psi_s, psi_r, psi_deep, psi_iron]);
        self.settle(&mut x);
        x
    }
}

/// Selects the vectors that the machine integrates: stator, rotor, bottom of the bars and iron.
fn integrated(machine: &EnergyMachine, all: [Complex64; 4]) -> Vec<Complex64> {
    let there = [true, true, machine.has_skin_effect(), machine.has_iron_loss()];
    all.into_iter().zip(there).filter(|(_, there)| *there).map(|(z, _)| z).collect()
}

/// Returns real and imaginary parts, one after the other.
fn flat(list: &[Complex64]) -> Vec<f64> {
    list.iter().flat_map(|z| [z.re, z.im]).collect()
}

fn listed(flat: &[f64]) -> Vec<Complex64> {
    flat.chunks(2).map(|z| Complex64::new(z[0], z[1])).collect()
}

/// Finds the root of `f` near `start`, by Newton's method with a line search; `sizes` are typical sizes of the unknowns.
///
/// # Errors
/// [`Error::Refused`] if it does not converge.
pub(crate) fn root(
    f: impl Fn(&[f64]) -> Vec<f64>,
    start: Vec<f64>,
    sizes: &[f64],
) -> Result<Vec<f64>, Error> {
    let lost = || Error::Refused("there is no steady state near the linear one".to_owned());
    let mut y = start;
    for _ in 0..ITERATIONS {
        let residual = DVector::from_vec(f(&y));
        let slope = jacobian(&f, &y, sizes);
        let step = slope.lu().solve(&-&residual).ok_or_else(lost)?;
        let mut share = 1.0;
        let moved = |share: f64| -> Vec<f64> {
            y.iter().zip(step.iter()).map(|(y, step)| y + share * step).collect()
        };
        while share > 1e-4 && DVector::from_vec(f(&moved(share))).norm() > residual.norm() {
            share *= 0.5;
        }
        let small = step.iter().zip(sizes).all(|(step, size)| step.abs() < 1e-10 * size);
        y = moved(share);
        if small {
            return Ok(y);
        }
    }
    Err(lost())
}

/// Central differences of `f` at `y`.
fn jacobian(f: impl Fn(&[f64]) -> Vec<f64>, y: &[f64], sizes: &[f64]) -> DMatrix<f64> {
    let column = |k: usize| {
        let at = |sign: f64| {
            let mut y = y.to_vec();
            y[k] += sign * STEP * sizes[k];
            DVector::from_vec(f(&y))
        };
        (at(1.0) - at(-1.0)) / (2.0 * STEP * sizes[k])
    };
    DMatrix::from_columns(&(0..y.len()).map(column).collect::<Vec<_>>())
}

/// A first guess of a steady state: state, terminal voltage, V, and slip, rad/s.
pub(crate) type Guess<M> = (<M as MachineModel>::State, Complex64, f64);

/// Finds the steady state at the stator current `i`, A, in the frame of the rotor flux, with the shaft locked.
///
/// # Errors
/// As [`root`].
pub(crate) fn at_current<M: Listed>(
    machine: &M,
    i: Complex64,
    start: &Guess<M>,
    flux: f64,
) -> Result<Guess<M>, Error> {
    let mut y = flat(&machine.list(&start.0));
    let n = y.len();
    y.extend([start.1.re, start.1.im, start.2]);
    let sizes: Vec<f64> = (0..n).map(|_| flux).chain([10.0, 10.0, 10.0]).collect();
    let residual = |y: &[f64]| {
        let list = listed(&y[..n]);
        let x = machine.state(&list);
        let (v, slip) = (Complex64::new(y[n], y[n + 1]), y[n + 2]);
        let rates = machine.rates(&machine.derivative(&x, v, 0.0));
        let turning = list.iter().map(|z| Complex64::new(0.0, slip) * z);
        let mut residual: Vec<Complex64> = rates.iter().zip(turning).map(|(a, b)| a - b).collect();
        residual.push(x.current() - i);
        let mut residual = flat(&residual);
        residual.push(x.rotor_flux().im);
        residual
    };
    let found = root(residual, y, &sizes)?;
    let v = Complex64::new(found[n], found[n + 1]);
    Ok((machine.state(&listed(&found[..n])), v, found[n + 2]))
}

/// Finds the steady state at the voltage `v`, V, the electrical frequency `w_s` and the electrical speed `w`, rad/s.
///
/// # Errors
/// As [`root`].
pub(crate) fn at_voltage<M: Listed>(
    machine: &M,
    v: Complex64,
    (w_s, w): (f64, f64),
    start: &M::State,
) -> Result<M::State, Error> {
    let y = flat(&machine.list(start));
    let sizes = vec![v.norm() / w_s.abs(); y.len()];
    let residual = |y: &[f64]| {
        let list = listed(y);
        let rates = machine.rates(&machine.derivative(&machine.state(&list), v, w));
        let turning = list.iter().map(|z| Complex64::new(0.0, w_s) * z);
        flat(&rates.iter().zip(turning).map(|(a, b)| a - b).collect::<Vec<_>>())
    };
    Ok(machine.state(&listed(&root(residual, y, &sizes)?)))
}

/// Returns the admittance at the frequency `w`, rad/s, for small signals about a state, with the shaft locked. Its
/// columns are the currents, A, caused by 1 V along and across the real axis.
pub(crate) fn admittance<M: Listed>(
    machine: &M,
    x: &M::State,
    w: f64,
    flux: f64,
) -> Option<[[Complex64; 2]; 2]> {
    let y = flat(&machine.list(x));
    let sizes = vec![flux; y.len()];
    let rates = |y: &[f64], v: Complex64| {
        flat(&machine.rates(&machine.derivative(&machine.state(&listed(y)), v, 0.0)))
    };
    let a = jacobian(|y| rates(y, Complex64::default()), &y, &sizes);
    let c = jacobian(|y| flat(&[machine.state(&listed(y)).current()]), &y, &sizes);
    let still = DVector::from_vec(rates(&y, Complex64::default()));
    let by = |v: Complex64| DVector::from_vec(rates(&y, v)) - &still;
    let b = DMatrix::from_columns(&[by(Complex64::new(1.0, 0.0)), by(Complex64::new(0.0, 1.0))]);
    let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
    let identity = DMatrix::<Complex64>::identity(y.len(), y.len());
    let response = (identity * Complex64::new(0.0, w) - complex(&a)).lu().solve(&complex(&b))?;
    let currents = complex(&c) * response;
    Some([0, 1].map(|k| [currents[(0, k)], currents[(1, k)]]))
}
