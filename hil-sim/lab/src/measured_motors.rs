//! Simulated motors beside motors that others have measured: a load test, and a saturation curve.

use std::f64::consts::{SQRT_2, TAU};

use num_complex::Complex;
use serde::Deserialize;
use sim_bench::config::motors::Motor;
use sim_bench::plant::{ElectricalState as _, EnergyMachine, EnergyState, MachineModel as _};
use sim_bench::prelude::*;

use crate::saliency::steady::at_voltage;

/// Both comparisons.
pub const EXPERIMENT: Experiment = Experiment {
    name: "measured-motors",
    stands_for: "",
    about: "Simulated motors beside measured ones: 14 load points of an 18.5 kW motor, the saturation curve of a 2.2 kW motor.",
    uses: &[],
    not: &[],
    run,
};

const LOAD_TEST: &str = include_str!("../measured/modelica-18kw5.csv");
const LARGE: &str = include_str!("../measured/modelica-18kw5.toml");
const SMALL: &str = include_str!("../measured/motulator-2kw2.toml");

/// Stray load loss at the rated point, W, and that point: line current, A rms, and speed, rad/s (the file of the load
/// test: 0.5 % of the input). It goes with the square of the current, from the shaft. The plant does not have it.
const STRAY: (f64, f64, f64) = (102.2, 32.85, 153.15);

/// A point of the load test, at the supply of the nameplate.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct LoadPoint {
    /// Power at the shaft, W.
    pub power_w: f64,
    /// Current of a line, A rms.
    pub current_a: f64,
    /// Speed, rpm.
    pub speed_rpm: f64,
    /// Power factor.
    pub power_factor: f64,
    /// Efficiency.
    pub efficiency: f64,
}

/// The measured points of the 18.5 kW motor.
///
/// # Errors
/// [`Error::Internal`] when the table that comes with the program is broken.
pub fn measured() -> Result<Vec<LoadPoint>, Error> {
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(LOAD_TEST.as_bytes());
    reader.deserialize().map(|row| row.map_err(|e| Error::Internal(e.to_string()))).collect()
}

/// A motor at its supply, in the steady state.
struct Supplied {
    machine: EnergyMachine,
    friction: f64,
    /// Peak phase voltage, V, and frequency, rad/s.
    v: f64,
    w_s: f64,
}

impl Supplied {
    fn new(config: &Config) -> Result<Self, Error> {
        let plant = plant_settings(config);
        let iron = plant.iron.ok_or_else(|| Error::Internal("a motor without iron".to_owned()))?;
        let plate = &config.drive.nameplate;
        Ok(Self {
            machine: EnergyMachine::new(&plant.machine, &iron).map_err(Error::refused)?,
            friction: plant.mechanics.friction,
            v: f64::from(plate.voltage_v) * (2.0_f64 / 3.0).sqrt(),
            w_s: TAU * f64::from(plate.frequency_hz),
        })
    }

    /// State at the electrical speed `w`, rad/s.
    fn state(&self, w: f64) -> Result<EnergyState, Error> {
        // The stator flux of an ideal winding, and as much in the rotor.
        let flux = Complex::new(0.0, -0.97 * self.v / self.w_s);
        let mut start = EnergyState::of_fluxes([flux; 4]);
        self.machine.settle(&mut start);
        at_voltage(&self.machine, self.v.into(), (self.w_s, w), &start)
    }

    /// The point at the electrical speed `w`, rad/s.
    fn point(&self, w: f64) -> Result<LoadPoint, Error> {
        let x = self.state(w)?;
        let (i, speed) = (x.current(), w / self.machine.pole_pairs());
        let current_a = i.norm() / SQRT_2;
        let stray = STRAY.0 * (current_a / STRAY.1).powi(2) * speed / STRAY.2;
        let power_w = (self.machine.torque(&x) - self.friction * speed) * speed - stray;
        let input = 1.5 * self.v * i.re;
        Ok(LoadPoint {
            power_w,
            current_a,
            speed_rpm: speed * 60.0 / TAU,
            power_factor: i.re / i.norm(),
            efficiency: power_w / input,
        })
    }

    /// The point with this power at the shaft, W, between 90 % and all of the synchronous speed.
    fn with_power(&self, power_w: f64) -> Result<LoadPoint, Error> {
        let (mut slow, mut fast) = (0.9 * self.w_s, self.w_s);
        for _ in 0..50 {
            let middle = 0.5 * (slow + fast);
            if self.point(middle)?.power_w > power_w { slow = middle } else { fast = middle }
        }
        self.point(0.5 * (slow + fast))
    }
}

fn config(motor: &str, iron: &str) -> Result<Config, Error> {
    let mut config = Config::of_motor(Some(motor))?;
    Motor::from_text(motor, iron)?.apply(&mut config)?;
    Ok(config)
}

/// The simulated 18.5 kW motor at the powers of the measured points.
///
/// # Errors
/// As those of the steady state.
pub fn simulated(measured: &[LoadPoint]) -> Result<Vec<LoadPoint>, Error> {
    let motor = Supplied::new(&config("modelica-18kw5", LARGE)?)?;
    measured.iter().map(|point| motor.with_power(point.power_w)).collect()
}

/// Stator flux, Wb, and no-load current, A peak, of the 2.2 kW motor at 50 Hz and a voltage between lines, V rms.
///
/// # Errors
/// As those of the steady state.
pub fn no_load(voltage_v: f64) -> Result<(f64, f64), Error> {
    let mut motor = Supplied::new(&config("motulator-2kw2", SMALL)?)?;
    motor.v = voltage_v * (2.0_f64 / 3.0).sqrt();
    let x = motor.state(motor.w_s)?;
    Ok((x.psi_s.norm(), x.current().norm()))
}

/// The published curve: current, A peak, at a stator flux, Wb.
pub fn published(psi: f64) -> f64 {
    psi * (1.0 + (0.84 * psi).powi(7)) / 0.34
}

fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let measured = measured()?;
    let simulated = simulated(&measured)?;
    let mut table = Table::new("18.5 kW, 400 V, 50 Hz: simulated beside measured", &[]).note(
        "Measured: Modelica Standard Library, IMC_withLosses (BSD-3-Clause). Speed is printed there to 1 rpm. The current \
         without load fixes the knee of the main flux; everything else is from the published data.",
    );
    let mut worst = [0.0_f64; 3];
    for (m, s) in measured.iter().zip(&simulated) {
        let current = 100.0 * (s.current_a / m.current_a - 1.0);
        let efficiency = 100.0 * (s.efficiency - m.efficiency);
        let speed = s.speed_rpm - m.speed_rpm;
        let loaded = m.power_w > 3500.0;
        worst[0] = worst[0].max(current.abs());
        worst[1] = worst[1].max(speed.abs());
        worst[2] = worst[2].max(if loaded { efficiency.abs() } else { 0.0 });
        table.record([
            ("shaft (W)", Cell::fixed(m.power_w, 0)),
            ("measured (A)", Cell::fixed(m.current_a, 2)),
            ("simulated (A)", Cell::fixed(s.current_a, 2)),
            ("difference (%)", Cell::fixed(current, 2)),
            ("measured (rpm)", Cell::fixed(m.speed_rpm, 0)),
            ("simulated (rpm)", Cell::fixed(s.speed_rpm, 2)),
            ("power factor", Cell::fixed(m.power_factor, 3)),
            ("simulated", Cell::fixed(s.power_factor, 3)),
            ("efficiency (%)", Cell::fixed(100.0 * m.efficiency, 2)),
            ("difference (points)", Cell::fixed(efficiency, 2)),
        ]);
    }
    outcome.tables.push(table);
    for (name, value) in
        ["current_percent", "speed_rpm", "efficiency_points"].into_iter().zip(worst)
    {
        outcome.metrics.set(format!("largest_difference_{name}"), value);
    }
    let over = |points: &[LoadPoint], of: fn(&LoadPoint) -> f64| -> Vec<(f64, f64)> {
        points.iter().map(|p| (1e-3 * p.power_w, of(p))).collect()
    };
    let panel = |name: &str, of: fn(&LoadPoint) -> f64| {
        Panel::new("shaft (kW)", name)
            .with(Series::line("simulated", over(&simulated, of)))
            .with(Series::points("measured", over(&measured, of)))
    };
    outcome.figures.push(
        Figure::new("load_test", "Load test of the 18.5 kW motor", "")
            .panel(panel("current (A rms)", |p| p.current_a))
            .panel(panel("speed (rpm)", |p| p.speed_rpm))
            .panel(panel("efficiency", |p| p.efficiency)),
    );
    let mut table = Table::new("2.2 kW: current without load at 50 Hz", &[]).note(
        "Published: motulator (MIT), L_s = 0.34/(1 + (0.84 psi)^7) H over the stator flux psi.",
    );
    for voltage in [100.0, 200.0, 300.0, 350.0, 400.0, 430.0] {
        let (psi, current) = no_load(voltage)?;
        table.record([
            ("line voltage (V)", Cell::fixed(voltage, 0)),
            ("stator flux (Wb)", Cell::fixed(psi, 4)),
            ("simulated (A peak)", Cell::fixed(current, 4)),
            ("published (A peak)", Cell::fixed(published(psi), 4)),
        ]);
    }
    outcome.tables.push(table);
    Ok(outcome)
}
