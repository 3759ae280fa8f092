//! All six switches off: the diodes carry the currents into the dc link until they are zero.
//!
//! A phase whose current flows into the machine is connected to the negative rail by its diode, and a phase whose
//! current flows back to the positive rail. A phase without current floats. It stays exactly without current unless its
//! potential leaves the range between the rails. If all three phases float, the terminals show the back-EMF of the
//! decaying rotor flux, which rotates with the rotor.

use crate::complex::{Complex, clarke, phases, square};
use crate::integrate::{MotorModel, MotorState};
use crate::model::{ElectricalState as _, MachineModel};
use crate::terminals::{All, Open, Without, without};

/// Current below which a phase counts as having none, A.
const NO_CURRENT: f64 = 1e-9;
/// Largest number of conduction changes within one step. In a passive circuit more changes can only come from rounding.
const CHANGES: usize = 8;

/// Conduction of the diodes of each leg: +1 into the machine (negative rail), -1 back (positive rail), 0 none.
type Conduction = [i8; 3];

/// Integrates over `h` seconds; returns the terminal voltage integrated over them, V s.
pub(crate) fn step<M: MachineModel>(
    motor: &mut MotorModel<M>,
    vdc: f64,
    open: Option<usize>,
    h: f64,
) -> Complex {
    let mut rest = h;
    let mut volt_seconds = Complex::ZERO;
    // Phases that began to conduct but turned out not to: they float for the rest of the step.
    let mut blocked = [false; 3];
    if let Some(open) = open {
        blocked[open] = true;
        if phases(motor.state.electrical.current())[open] != 0.0 {
            confine(motor, without(motor.state.electrical.current(), open));
        }
    }
    for _ in 0..CHANGES {
        let conduction = conduction(motor, vdc, blocked);
        let before = motor.state;
        let v = advance(motor, conduction, vdc, rest);
        let Some((phase, fraction)) = first_reversal(motor, &before, conduction) else {
            return volt_seconds + v * rest;
        };
        let done = rest * fraction;
        motor.state = before;
        if phases(motor.state.electrical.current())[phase].abs() <= NO_CURRENT {
            blocked[phase] = true;
            continue;
        }
        volt_seconds += advance(motor, conduction, vdc, done) * done;
        let i = without(motor.state.electrical.current(), phase);
        confine(motor, if square(i).sqrt() <= NO_CURRENT { Complex::ZERO } else { i });
        rest -= done;
    }
    // Only rounding still changes the conduction: the currents are practically zero.
    confine(motor, Complex::ZERO);
    volt_seconds + motor.advance(&Open, rest) * rest
}

/// Sets the current.
fn confine<M: MachineModel>(motor: &mut MotorModel<M>, i: Complex) {
    motor.state.electrical = motor.machine.with_current(&motor.state.electrical, i);
}

/// Returns the diodes that conduct in the present state.
fn conduction<M: MachineModel>(motor: &MotorModel<M>, vdc: f64, blocked: [bool; 3]) -> Conduction {
    let mut flow = phases(motor.state.electrical.current()).map(sign);
    let conducting = flow.iter().filter(|&&f| f != 0).count();
    match conducting {
        // One phase floats: does its potential leave the range between the rails?
        2 => {
            let k = flow.iter().position(|&f| f == 0).unwrap_or(0);
            let (_, v) = motor.rates(&Without(k, diodes(flow, vdc)));
            // v_k = 2/3 leg_k - 1/3 (sum of the others), and the other legs are on opposite rails.
            let leg = 0.5 * vdc + 1.5 * phases(v)[k];
            if !blocked[k] {
                flow[k] = i8::from(leg < 0.0) - i8::from(leg > vdc);
            }
        }
        // All phases float: does the back-EMF between two of them exceed the link voltage?
        0 => {
            let emf = phases(motor.rates(&Open).1);
            let highest = (0..3).fold(0, |m, k| if emf[k] > emf[m] { k } else { m });
            let lowest = (0..3).fold(0, |m, k| if emf[k] < emf[m] { k } else { m });
            if emf[highest] - emf[lowest] > vdc && !blocked[highest] && !blocked[lowest] {
                flow[highest] = -1;
                flow[lowest] = 1;
            }
        }
        _ => {}
    }
    flow
}

fn sign(i: f64) -> i8 {
    i8::from(i > NO_CURRENT) - i8::from(i < -NO_CURRENT)
}

/// Integrates over `h` seconds with this conduction; returns the mean terminal voltage.
fn advance<M: MachineModel>(
    motor: &mut MotorModel<M>,
    flow: Conduction,
    vdc: f64,
    h: f64,
) -> Complex {
    match (flow.iter().filter(|&&f| f != 0).count(), flow.iter().position(|&f| f == 0)) {
        (3, _) => motor.advance(&All(diodes(flow, vdc)), h),
        (2, Some(k)) => motor.advance(&Without(k, diodes(flow, vdc)), h),
        _ => motor.advance(&Open, h),
    }
}

/// Returns the voltage at the conducting terminals. Legs with opposite signs lie symmetrically about the middle of the
/// link; their common-mode part has no space vector.
fn diodes(flow: Conduction, vdc: f64) -> Complex {
    clarke(flow.map(|f| -0.5 * vdc * f64::from(f)))
}

/// Returns the phase whose current is the first to reverse against its diode, and the fraction of the step at which it does.
fn first_reversal<M: MachineModel>(
    motor: &MotorModel<M>,
    before: &MotorState<M::State>,
    flow: Conduction,
) -> Option<(usize, f64)> {
    let (before, after) =
        (phases(before.electrical.current()), phases(motor.state.electrical.current()));
    (0..3)
        .filter(|&k| f64::from(flow[k]) * after[k] < 0.0)
        .map(|k| (k, (before[k] / (before[k] - after[k])).clamp(0.0, 1.0)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
