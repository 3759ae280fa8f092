//! Comparison of simulated motors with motors that others have measured: a load test, a saturation curve, a direct start.

use std::f64::consts::SQRT_2;

use sim_bench::config::motors::{self, Motor};
use sim_bench::plant::{EnergyState, phases};

use crate::prelude::*;
use crate::saliency::steady::at_voltage;

/// The linear circuit of the same motor, from its locked-rotor test and its no-load current; its inertia is fitted to the start as well.
const CIRCUIT: [(&str, f64); 6] = [
    ("motor.r_r", 1.287),
    ("motor.l_ls", 0.00824),
    ("motor.l_lr", 0.00824),
    ("motor.l_m", 0.1289),
    ("motor.inertia", 0.028),
    ("iron.skin_ratio", 1.0),
];
/// Known values of the record: torque of the load step, Nm; voltage of the locked-rotor test, V peak.
const LABORATORY: (f64, f64) = (29.03, 72.2);

/// Stray load loss of the 18.5 kW motor at the rated point, W, and that point: line current, A rms, and speed, rad/s
/// (from the file of the load test: 0.5 % of the input). The loss is proportional to the square of the current and
/// reduces the shaft power. The plant does not model it.
const STRAY: (f64, f64, f64) = (102.2, 32.85, 153.15);

/// A point of the load test, at the supply voltage and frequency of the nameplate.
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

/// Returns the measured points of the 18.5 kW motor.
///
/// # Errors
/// [`Error::Internal`] if the table that comes with the program is damaged.
pub fn measured() -> Result<Vec<LoadPoint>, Error> {
    let load_test = motors::measured("modelica-18kw5.csv")?;
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(load_test.as_bytes());
    reader.deserialize().map(|row| row.map_err(|e| Error::Internal(e.to_string()))).collect()
}

/// A motor at its supply, in steady state.
struct Supplied {
    machine: EnergyMachine,
    shaft: MechanicsSettings,
    /// As [`STRAY`], W.
    stray_w: f64,
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
            shaft: plant.mechanics,
            stray_w: 0.0,
            v: f64::from(plate.voltage_v) * (2.0_f64 / 3.0).sqrt(),
            w_s: TAU * f64::from(plate.frequency_hz),
        })
    }

    /// Returns the state at the electrical speed `w`, rad/s.
    fn state(&self, w: f64) -> Result<EnergyState, Error> {
        // The stator flux of an ideal winding, and the same flux in the rotor.
        let flux = Complex64::new(0.0, -0.97 * self.v / self.w_s);
        let mut start = EnergyState::of_fluxes([flux; 4]);
        self.machine.settle(&mut start);
        at_voltage(&self.machine, self.v.into(), (self.w_s, w), &start)
    }

    /// Returns the point at the electrical speed `w`, rad/s.
    fn point(&self, w: f64) -> Result<LoadPoint, Error> {
        let x = self.state(w)?;
        let (i, speed) = (x.current(), w / self.machine.pole_pairs());
        let current_a = i.norm() / SQRT_2;
        let stray = self.stray_w * (current_a / STRAY.1).powi(2) * speed / STRAY.2;
        let power_w = (self.machine.torque(&x) - self.shaft.friction * speed) * speed - stray;
        let input = 1.5 * self.v * i.re;
        Ok(LoadPoint {
            power_w,
            current_a,
            speed_rpm: speed * 60.0 / TAU,
            power_factor: i.re / i.norm(),
            efficiency: power_w / input,
        })
    }

    /// Returns the point at which a quantity that increases with the slip has this value, between 90 % and 100 % of the
    /// synchronous speed.
    fn at(&self, value: f64, of: impl Fn(&LoadPoint) -> f64) -> Result<LoadPoint, Error> {
        let (mut slow, mut fast) = (0.9 * self.w_s, self.w_s);
        for _ in 0..50 {
            let middle = 0.5 * (slow + fast);
            if of(&self.point(middle)?) > value { slow = middle } else { fast = middle }
        }
        self.point(0.5 * (slow + fast))
    }

    /// Largest current of a phase in a start from rest at full voltage, A; the instant of switching changes it by 3 %.
    fn start_peak(&self) -> Result<f64, Error> {
        let shaft = Mechanics::new(&self.shaft).map_err(Error::refused)?;
        let (mut motor, h, mut peak) = (MotorModel::new(self.machine, shaft), 50e-6, 0.0);
        for k in 0..1000 {
            motor.step(Complex64::from_polar(self.v, self.w_s * h * (f64::from(k) + 0.5)), h);
            let currents = phases(motor.state.electrical.current());
            peak = currents.into_iter().map(f64::abs).fold(peak, f64::max);
        }
        Ok(peak)
    }
}

/// Returns the peak current of the start, A; the slip at the torque of the load step, rpm; and the no-load and
/// locked-rotor currents, A peak. They are of the motor of the laboratory record, or of its linear circuit.
///
/// # Errors
/// As with the steady state.
pub fn started(linear: bool) -> Result<[f64; 4], Error> {
    let mut config = config("dissertation", "laboratory-4kw.toml")?;
    if linear {
        CIRCUIT.iter().try_for_each(|(key, value)| config.set(key, value))?;
        (config.iron.leakage_saturation, config.iron.rotor_leakage_saturation) = (None, None);
    }
    let mut motor = Supplied::new(&config)?;
    let loaded = motor.at(LABORATORY.0, |p| p.power_w / (p.speed_rpm * TAU / 60.0))?;
    let (peak, idle) = (motor.start_peak()?, motor.state(motor.w_s)?.current().norm());
    motor.v = LABORATORY.1;
    Ok([peak, 1500.0 - loaded.speed_rpm, idle, motor.state(0.0)?.current().norm()])
}

fn config(motor: &str, iron: &str) -> Result<Config, Error> {
    let mut config = Config::of_motor(Some(motor))?;
    Motor::from_text(motor, motors::measured(iron)?)?.apply(&mut config)?;
    Ok(config)
}

/// Simulates the 18.5 kW motor at the powers of the measured points.
///
/// # Errors
/// As with the steady state.
pub fn simulated(measured: &[LoadPoint]) -> Result<Vec<LoadPoint>, Error> {
    let mut motor = Supplied::new(&config("modelica-18kw5", "modelica-18kw5.toml")?)?;
    motor.stray_w = STRAY.0;
    measured.iter().map(|point| motor.at(point.power_w, |p| p.power_w)).collect()
}

/// Returns the stator flux, Wb, and the no-load current, A peak, of the 2.2 kW motor at 50 Hz and a line-to-line voltage, V rms.
///
/// # Errors
/// As with the steady state.
pub fn no_load(voltage_v: f64) -> Result<(f64, f64), Error> {
    let mut motor = Supplied::new(&config("motulator-2kw2", "motulator-2kw2.toml")?)?;
    motor.v = voltage_v * (2.0_f64 / 3.0).sqrt();
    let x = motor.state(motor.w_s)?;
    Ok((x.psi_s.norm(), x.current().norm()))
}

/// Returns the published curve: current, A peak, at a stator flux, Wb.
pub fn published(psi: f64) -> f64 {
    psi * (1.0 + (0.84 * psi).powi(7)) / 0.34
}

/// Runs all comparisons.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(_: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let measured = measured()?;
    let simulated = simulated(&measured)?;
    let mut table = texts::table("measured-motors", "load_test");
    for (m, s) in measured.iter().zip(&simulated) {
        let current = 100.0 * (s.current_a / m.current_a - 1.0);
        let efficiency = 100.0 * (s.efficiency - m.efficiency);
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
    let mut table = texts::table("measured-motors", "saturation");
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
    let mut table = texts::table("measured-motors", "start");
    let (energy, linear) = (started(false)?, started(true)?);
    let quantities = [
        ("peak of the direct start (A)", 95.0, [89.0, 64.0]),
        ("slip at 29 Nm (rpm)", 51.0, [51.1, 67.0]),
        ("current without load (A peak)", 7.58, [7.59, 7.66]),
        ("locked rotor at 72 V peak (A peak)", 12.9, [12.9, 12.9]),
    ];
    for (n, (quantity, measured, [of_energy, of_linear])) in quantities.into_iter().enumerate() {
        table.record([
            ("quantity", Cell::from(quantity)),
            ("measured", Cell::significant(measured, 3)),
            ("energy model in it", Cell::significant(of_energy, 3)),
            ("linear circuit in it", Cell::significant(of_linear, 3)),
            ("energy model", Cell::significant(energy[n], 3)),
            ("linear circuit", Cell::significant(linear[n], 3)),
        ]);
    }
    outcome.tables.push(table);
    Ok(outcome)
}
