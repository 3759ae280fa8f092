//! Comparison of a recorded start with the simulated motor at the recorded voltages.

use sim_bench::plant::IronSettings;

use crate::identify_trace::{Contents, Reading, Voltages, read, rms};
use crate::prelude::*;

/// Parts of a start, with their ends, s: the largest currents occur in the first.
const PARTS: [(&str, f64); 3] = [("start", 0.12), ("run_in", 0.25), ("later", f64::INFINITY)];
/// Integration steps per row.
const STEPS: u32 = 4;

/// Runs the experiment. It needs a file of the user, with the columns of `identify-trace` and voltages sampled at the
/// terminals, starting when the motor is switched on.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let (config, file) = (context.config, context.file);
    let path =
        file.ok_or_else(|| Error::Refused("measured-start needs --input FILE".to_owned()))?;
    let Contents { record, remarks, .. } = read(path, &Reading::of(Voltages::Sampled), config)?;
    let mut plant = plant_settings(config);
    let iron = plant.iron.unwrap_or(IronSettings::LINEAR);
    let machine = EnergyMachine::new(&plant.machine, &iron).map_err(Error::refused)?;
    plant.mechanics.load = Load::Free { torque: config.load.torque_nm.unwrap_or(0.0) };
    let shaft = Mechanics::new(&plant.mechanics).map_err(Error::refused)?;
    let mut motor = MotorModel::new(machine, shaft);
    motor.state.speed = record.omega_m[0] / machine.pole_pairs();
    let (mut current, mut speed) = (Vec::new(), Vec::new());
    for (k, v) in record.v.iter().enumerate() {
        current.push(motor.state.electrical.current());
        speed.push(motor.state.speed * 60.0 / TAU);
        let rise = record.v[(k + 1).min(record.v.len() - 1)] - v;
        for n in 0..STEPS {
            let share = (f64::from(n) + 0.5) / f64::from(STEPS);
            motor.step(v + rise * share, record.h / f64::from(STEPS));
        }
    }
    let mut outcome = Outcome { remarks, ..Outcome::default() };
    let mut table = Table::new("Recorded and simulated start", &[])
        .note(format!("{}; rms of the difference.", config.motor_text()));
    let row = |t: f64| ((t / record.h) as usize).min(current.len());
    let mut from = 0.0;
    for (name, to) in PARTS {
        let part = row(from)..row(to);
        if part.is_empty() {
            continue;
        }
        let (recorded, simulated) = (&record.i[part.clone()], &current[part.clone()]);
        let apart: Vec<Complex64> = recorded.iter().zip(simulated).map(|(a, b)| a - b).collect();
        let to_rpm = 60.0 / TAU / machine.pole_pairs();
        let rpm =
            part.clone().map(|k| (record.omega_m[k] * to_rpm - speed[k]).powi(2)).sum::<f64>();
        let peak = |i: &[Complex64]| Cell::fixed(i.iter().map(|i| i.norm()).fold(0.0, f64::max), 1);
        let share = 100.0 * rms(&apart) / rms(recorded);
        outcome.metrics.set(format!("{name}_current_percent"), share);
        table.record([
            ("from (s)", Cell::fixed(std::mem::replace(&mut from, to), 2)),
            ("to (s)", Cell::fixed(part.end as f64 * record.h, 2)),
            ("recorded peak (A)", peak(recorded)),
            ("simulated peak (A)", peak(simulated)),
            ("current (%)", Cell::fixed(share, 1)),
            ("speed (rpm)", Cell::fixed((rpm / part.len() as f64).sqrt(), 1)),
        ]);
    }
    outcome.tables.push(table);
    Ok(outcome)
}
