//! The saliency that a motor shows at 600 Hz over q-axis current and angle error, which is the signal available to a
//! drive with injection.

pub(super) mod steady;

use std::f64::consts::FRAC_PI_2;

use sim_bench::config::flux_level_a;
use sim_bench::plant::{EnergyState, Machine, MachineState};

use steady::Listed;

use crate::prelude::*;

/// Angular frequency of the injection, rad/s.
const CARRIER: f64 = TAU * 600.0;
/// q-axis currents, A with the dissertation's motor: up to 1.66 times the rated one.
const CURRENTS_A: [f64; 9] = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0];
/// Angle errors of the table, degrees.
const SHOWN_DEG: [i32; 7] = [-10, 0, 10, 20, 40, 60, 70];
/// Angle errors of the curves: up to the q axis on either side.
const FIRST_DEG: i32 = -60;
const LAST_DEG: i32 = 90;
/// Half of the angle over which the saliency sensitivity is computed, degrees.
const SLOPE_DEG: f64 = 8.5;
/// Smallest d-axis current in the flux frame, as a share of the whole current: below it the flux has collapsed.
const LEAST_DIRECT: f64 = 0.02;

/// Number of steps from no load to the load, if a steady state is not found at once.
const LOAD_STEPS: u32 = 40;
/// Saliency below which a signal is only rounding.
const NOTHING: f64 = 1e-6;

/// A motor at rest whose saliency can be computed.
pub struct Probe {
    machine: ProbeModel,
    settings: MachineSettings,
    /// Magnetising current of the nominal flux, A.
    pub i_d: f64,
}

enum ProbeModel {
    A(Machine),
    Energy(EnergyMachine),
}

impl Probe {
    /// Makes a probe of the motor that the configuration describes, without parts that do not rotate with the flux.
    ///
    /// # Errors
    /// [`Error::Refused`] with the setting.
    pub fn new(config: &Config) -> Result<Self, Error> {
        check_model(config)?;
        let plant = plant_settings(config);
        let settings = plant.machine;
        let machine = match plant.iron {
            None => Machine::new(&settings, &plant.saliency).map(ProbeModel::A),
            Some(mut iron) => {
                (iron.slots, iron.stator_fixed) = (0.0, 0.0);
                EnergyMachine::new(&settings, &iron).map(ProbeModel::Energy)
            }
        };
        let machine = machine.map_err(Error::refused)?;
        let i_d = match config.model.plant {
            PlantModel::A => config.drive.i_d().into(),
            _ => flux_level_a(config),
        };
        Ok(Self { machine, settings, i_d })
    }

    /// Returns the saliency signal q at the current `(i_d, i_q)`, A, of a frame that lags the rotor flux by `e`, rad,
    /// with the injection across that frame, in steady state with the shaft locked. With the injection current `x`
    /// along its axis and `y` across, `q = -Re(y x*)/|x|^2`, as the synchronous demodulation gives it. None if the flux
    /// has collapsed.
    pub fn q(&self, i_d: f64, i_q: f64, e: f64) -> Option<f64> {
        let axis = FRAC_PI_2 - e;
        let [along, across] = self.admittance(i_d, i_q, e)?;
        let (u, t) = ([axis.cos(), axis.sin()], [-axis.sin(), axis.cos()]);
        let i = [0, 1].map(|k| along[k] * u[0] + across[k] * u[1]);
        let on = |v: [f64; 2]| i[0] * v[0] + i[1] * v[1];
        let (x, y) = (on(u), on(t));
        Some(-(y * x.conj()).re / x.norm_sqr())
    }

    /// Returns the saliency sensitivity dq/de at zero angle error, 1/rad.
    pub fn slope(&self, i_d: f64, i_q: f64) -> Option<f64> {
        let e = SLOPE_DEG.to_radians();
        Some((self.q(i_d, i_q, e)? - self.q(i_d, i_q, -e)?) / (2.0 * e))
    }

    /// Returns the saliency without load, relative (positive is low inductance along the flux), and the mean inductance, H.
    pub fn at_rest(&self, i_d: f64) -> Option<(f64, f64)> {
        let [along, across] = self.admittance(i_d, 0.0, 0.0)?;
        let inductance = |y: Complex64| (1.0 / y).im / CARRIER;
        let (d, q) = (inductance(along[0]), inductance(across[1]));
        Some(((q - d) / (q + d), 0.5 * (q + d)))
    }

    fn admittance(&self, i_d: f64, i_q: f64, e: f64) -> Option<[[Complex64; 2]; 2]> {
        let i = Complex64::new(i_d, i_q) * Complex64::cis(-e);
        if i.re < LEAST_DIRECT * i.norm() {
            return None;
        }
        match &self.machine {
            ProbeModel::A(machine) => {
                self.of(machine, i, |i, psi, _| MachineState { i, psi: psi.into(), i_lp: i })
            }
            ProbeModel::Energy(machine) => self.of(&machine.with_load(i.im), i, |i, psi, main| {
                let psi_s = main + i * self.settings.lls;
                EnergyState::of_fluxes([psi_s, psi.into(), psi.into(), main])
            }),
        }
    }

    /// Returns the admittance at the steady state with the current `i`, A, in the frame of the flux. `linear` gives the
    /// state of the linear machine for a current, its rotor flux and its main flux.
    fn of<M: Listed>(
        &self,
        machine: &M,
        i: Complex64,
        linear: impl Fn(Complex64, f64, Complex64) -> M::State,
    ) -> Option<[[Complex64; 2]; 2]> {
        let m = &self.settings;
        let guess = |i: Complex64| {
            // psi = Lm i_d, i_r = -j Lm/Lr i_q
            let (psi, share) = (m.lm * i.re, m.lm / (m.lm + m.llr));
            let slip = m.rr * share * i.im / psi;
            let main = Complex64::new(psi, m.llr * share * i.im);
            let v = i * m.rs + Complex64::new(0.0, slip) * (main + i * m.lls);
            (linear(i, psi, main), v, slip)
        };
        let psi = m.lm * i.re;
        let (state, ..) = steady::at_current(machine, i, &guess(i), psi)
            .or_else(|_| {
                // Proceeds from no load, step by step.
                (0..=LOAD_STEPS).try_fold(guess(i.re.into()), |start, k| {
                    let share = f64::from(k) / f64::from(LOAD_STEPS);
                    steady::at_current(machine, Complex64::new(i.re, share * i.im), &start, psi)
                })
            })
            .ok()?;
        steady::admittance(machine, &state, CARRIER, psi)
    }

    /// Returns the angle errors, degrees, at which the signal is the same as at zero error, within the range of the curves.
    fn second_zeros(curve: &[(f64, f64)], at_zero: f64) -> Vec<f64> {
        curve
            .windows(2)
            .filter(|w| w[0].0 > 2.0 || w[1].0 < -2.0)
            .filter(|w| (w[0].1 - at_zero) * (w[1].1 - at_zero) < 0.0)
            .filter(|w| (w[0].1 - w[1].1).abs() > NOTHING)
            .map(|w| {
                let share = (at_zero - w[0].1) / (w[1].1 - w[0].1);
                w[0].0 + share * (w[1].0 - w[0].0)
            })
            .collect()
    }
}

/// Runs the experiment, a map of the saliency.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let config = context.config;
    let probe = Probe::new(config)?;
    let currents = CURRENTS_A.map(|on_reference| config.amperes(on_reference));
    let degrees: Vec<i32> = (FIRST_DEG..=LAST_DEG).collect();
    let curves = context.in_parallel("saliency", &currents, |_, &i_q| {
        let at =
            |&e: &i32| Some((f64::from(e), probe.q(probe.i_d, i_q, f64::from(e).to_radians())?));
        Ok(degrees.iter().filter_map(at).collect::<Vec<_>>())
    })?;

    let mut outcome = Outcome::default();
    let lost = || Error::Refused("the motor has no steady state without load".to_owned());
    let (saliency, inductance) = probe.at_rest(probe.i_d).ok_or_else(lost)?;
    outcome.metrics.set("direct_current_a", probe.i_d);
    outcome.metrics.set("flux_wb", probe.i_d * config.motor.l_m);
    outcome.metrics.set("saliency_at_rest_percent", 100.0 * saliency);
    outcome.metrics.set("inductance_600_hz_mh", 1e3 * inductance);
    let axes = |(saliency, mean): (f64, f64)| [(1.0 - saliency) * mean, (1.0 + saliency) * mean];
    let half = axes(probe.at_rest(0.5 * probe.i_d).ok_or_else(lost)?);
    let [d, q] = axes((saliency, inductance));
    let [by_d, by_q] = [half[0] / d, half[1] / q].map(|ratio| 100.0 * (ratio - 1.0).abs());
    outcome.metrics.set("voltage_d_to_q", d / q);
    outcome.metrics.set("half_flux_d_percent", by_d);
    outcome.metrics.set("half_flux_q_percent", by_q);
    for (quantity, holds) in [
        ("the quadrature axis has the lower impedance at the frequency of injection", q < d),
        (
            "the flux of the stator influences the impedance less on the quadrature axis",
            by_q < by_d,
        ),
    ] {
        let ours = beside("section 5.1", quantity).unknown("the saliency of its motor");
        outcome.compared.push(ours.simulated(holds));
    }
    let slopes = currents.map(|i_q| probe.slope(probe.i_d, i_q));
    if let Some(slope) = slopes[0] {
        outcome.metrics.set("slope_at_rest_per_rad", slope);
    }
    let mut panel = Panel::new("angle error (°)", "q (%)");
    let mut map = texts::table("saliency", "map");
    let mut table = texts::table("saliency", "zeros");
    for ((i_q, curve), slope) in currents.iter().zip(&curves).zip(slopes) {
        let q = |e: i32| curve.iter().find(|point| point.0 == f64::from(e)).map(|point| point.1);
        let cell = |e: i32| Cell::fixed_or_dash(q(e).map(|q| 100.0 * q), 2);
        let i_q_text = format!("{:.2}", i_q);
        let head = ("iq (A)".to_owned(), Cell::from(i_q_text.clone()));
        map.record(std::iter::once(head).chain(SHOWN_DEG.map(|e| (format!("{e}°"), cell(e)))));
        let zeros = q(0).map(|q| Probe::second_zeros(curve, q)).unwrap_or_default();
        let zeros: Vec<String> = zeros.iter().map(|e| format!("{e:.0}°")).collect();
        let of_rest = slope.zip(slopes[0].filter(|k0| k0.abs() > NOTHING)).map(|(k, k0)| k / k0);
        let zeros = if zeros.is_empty() { "-".to_owned() } else { zeros.join(", ") };
        table.record([
            ("iq (A)", Cell::from(i_q_text.clone())),
            ("k (1/rad)", Cell::fixed_or_dash(slope, 4)),
            ("share of k without load", Cell::fixed_or_dash(of_rest, 2)),
            ("second zeros", Cell::from(zeros)),
        ]);
        let points = curve.iter().map(|(e, q)| (*e, 100.0 * q)).collect();
        panel = panel.with(Series::line(format!("iq = {i_q_text} A"), points));
    }
    let figure = texts::figure("saliency", "map");
    outcome.figures.push(figure.panel(panel));
    outcome.tables.extend([map, table]);
    Ok(outcome)
}
