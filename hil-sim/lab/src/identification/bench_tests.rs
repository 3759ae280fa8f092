//! The direct-current, locked-rotor and no-load tests of section 3.6 of Barroso (2017): the equivalent circuit (Figure
//! 21) from readings of meters, and the readings that a simulated motor gives.

use std::f64::consts::SQRT_2;

use sim_bench::plant::{Machine, PlantError, SaliencySettings};

use super::Complex;
use crate::prelude::*;

/// Readings of the meters. Voltages and currents of the two tests with alternating current are phase values, rms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Dc voltage between two phases, V, and the current through them, A.
    pub dc: (f64, f64),
    /// Frequency (Hz), voltage (V), current (A) and the angle between them (rad), rotor locked.
    pub locked: (f64, f64, f64, f64),
    /// Frequency (Hz), voltage (V) and current (A) without load.
    pub no_load: (f64, f64, f64),
}

impl Readings {
    /// Returns the readings of sections 3.6.1 to 3.6.3; the frequency without load is the rated one.
    pub fn printed() -> Self {
        let of = |section: &str, quantity: &str| {
            source::printed(&format!("section 3.6.{section}"), quantity)
        };
        let locked =
            ["frequency", "phase voltage", "phase current", "theta_rb"].map(|q| of("2", q));
        Self {
            dc: (of("1", "voltage"), of("1", "current")),
            locked: locked.into(),
            no_load: (60.0, of("3", "phase voltage"), of("3", "phase current") / 1e3),
        }
    }

    /// Impedance of a phase with the rotor locked (Eq. 3.17), ohm.
    pub fn locked_impedance(&self) -> Complex {
        let (_, v, i, angle) = self.locked;
        Complex::from_polar(v / i, angle)
    }

    /// Impedance of a phase without load, ohm.
    pub fn no_load_impedance(&self) -> f64 {
        self.no_load.1 / self.no_load.2
    }

    /// The circuit as section 3.6 derives it: no current in the magnetising branch while the rotor is locked, no
    /// voltage across the stator resistance without load, two equal leakage inductances.
    pub fn as_printed(&self) -> MachineSettings {
        let r_s = 0.5 * self.dc.0 / self.dc.1;
        let z = self.locked_impedance();
        let leakage = z.im / (2.0 * TAU * self.locked.0);
        let l_s = self.no_load_impedance() / (TAU * self.no_load.0);
        circuit([r_s, z.re - r_s, leakage, l_s - leakage])
    }

    /// The circuit that has these readings, with a magnetising branch in the locked-rotor test and the stator
    /// resistance in the no-load test: Z - r_s - j w L_s = (w L_m)² / (r_r + j w L_r), L_r = L_s.
    pub fn exact(&self) -> MachineSettings {
        let r_s = 0.5 * self.dc.0 / self.dc.1;
        let z = self.no_load_impedance();
        let l_s = (z * z - r_s * r_s).sqrt() / (TAU * self.no_load.0);
        let w = TAU * self.locked.0;
        let rotor = (self.locked_impedance() - Complex::new(r_s, w * l_s)).inv();
        let l_m = (l_s / (rotor.im * w)).sqrt();
        let r_r = rotor.re * (w * l_m).powi(2);
        circuit([r_s, r_r, l_s - l_m, l_m])
    }
}

/// Makes the circuit from the resistances of stator and rotor, the leakage inductance of each, and the magnetising inductance.
fn circuit([rs, rr, leakage, lm]: [f64; 4]) -> MachineSettings {
    MachineSettings { rs, rr, lls: leakage, llr: leakage, lm, ..MachineSettings::default() }
}

/// Steps of the simulation in a period of the supply.
const STEPS: u32 = 400;
/// The current of the direct-current test is read after this time, s.
const DC_S: f64 = 2.0;
/// Time for which the alternating current settles before it is read, s.
const SETTLE_S: f64 = 3.0;
/// Periods over which a meter averages.
const PERIODS: u32 = 10;
/// Number of adjustments of the supply until it gives the wanted current: the saliency makes the relation nonlinear.
const ADJUSTMENTS: u32 = 4;

/// Drive of the rotor in the no-load test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shaft {
    /// Another machine drives it at synchronous speed: no slip, as section 3.6.3 assumes.
    Driven,
    /// The motor itself drives it against friction, from synchronous speed.
    Free,
}

/// Runs the three tests on a simulated motor, with the currents and the no-load voltage of
/// [`Readings::printed`].
///
/// # Errors
/// [`PlantError`] if the plant refuses the settings.
pub fn measure(
    machine: &MachineSettings,
    saliency: &SaliencySettings,
    mechanics: &MechanicsSettings,
    shaft: Shaft,
) -> Result<Readings, PlantError> {
    let bench = |load: Load| -> Result<MotorModel, PlantError> {
        let mechanics = Mechanics::new(&MechanicsSettings { load, ..*mechanics })?;
        Ok(MotorModel::new(Machine::new(machine, saliency)?, mechanics))
    };
    let printed = Readings::printed();

    let locked = bench(Load::Locked)?;
    let dc = adjusted(printed.dc, |volts| dc_current(locked, volts));
    let (hz, volts, amps, _) = printed.locked;
    let (volts, amps) = adjusted((volts, amps), |volts| steady(locked, hz, volts).norm() / SQRT_2);
    let angle = -steady(locked, hz, volts).arg();

    let (hz, no_load_volts, _) = printed.no_load;
    let synchronous = TAU * hz / f64::from(machine.pole_pairs);
    let shaft = match shaft {
        Shaft::Driven => Load::Speed { speed: synchronous },
        Shaft::Free => Load::Free { torque: 0.0 },
    };
    let mut turning = bench(shaft)?;
    turning.state.speed = synchronous;
    let current = steady(turning, hz, no_load_volts).norm() / SQRT_2;
    Ok(Readings {
        dc,
        locked: (printed.locked.0, volts, amps, angle),
        no_load: (hz, no_load_volts, current),
    })
}

/// Adjusts the voltage until the current equals the reading; returns the final values of both.
fn adjusted((volts, amps): (f64, f64), current: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut volts = volts;
    for _ in 0..ADJUSTMENTS {
        volts *= amps / current(volts);
    }
    (volts, current(volts))
}

/// Direct current through phases b and c in series, A, with phase a open: the voltage lies along beta.
fn dc_current(mut motor: MotorModel, volts: f64) -> f64 {
    const H: f64 = 1e-4;
    for _ in 0..(DC_S / H) as u32 {
        motor.step(Complex::new(0.0, volts / 3f64.sqrt()), H);
    }
    motor.state.electrical.i.im * 0.5 * 3f64.sqrt()
}

/// Steady current vector (A peak) at `volts` rms per phase: its fundamental, relative to the voltage.
fn steady(mut motor: MotorModel, hz: f64, volts: f64) -> Complex {
    let h = 1.0 / (hz * f64::from(STEPS));
    let settle = (SETTLE_S * hz) as u32;
    let mut sum = Complex::ZERO;
    for period in 0..settle + PERIODS {
        for step in 0..STEPS {
            let turn = TAU * f64::from(step) / f64::from(STEPS);
            if period >= settle {
                sum += motor.state.electrical.i * Complex::from_polar(1.0, -turn);
            }
            // The voltage is constant within a step: the mean of the sinusoid over the step, half a step ahead.
            let middle = turn + 0.5 * TAU / f64::from(STEPS);
            motor.step(Complex::from_polar(SQRT_2 * volts, middle), h);
        }
    }
    sum / f64::from(PERIODS * STEPS)
}
