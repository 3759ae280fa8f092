//! Copper loss of the motor against the minimum for its torque, with and without `flux.minimise_loss`.

use super::course::Bench;
use super::full_range::for_the_range;
use super::torque_limit::learned_limit;
use crate::plant::MachineSettings;
use crate::prelude::*;

/// Speed, rpm on four poles: above the range of the injection, below field weakening.
const RPM: f64 = 1200.0;
const SHARES: [f64; 3] = [0.25, 0.5, 1.0];
/// Number of corrections of the q-axis current until it gives the torque, and the time of each, s.
const CORRECTIONS: u32 = 6;
const CORRECTED_S: f64 = 1.5;
/// Number of samples of the mean, and the time between two, s.
const SAMPLES: u32 = 50;
const SAMPLE_S: f64 = 0.01;

/// Runs the experiment, which is not in the source.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let mut table = Table::new("Copper loss", &[]);
    let mut config = for_the_range(context.config)?;
    for economy in [false, true] {
        config.drive.flux.minimise_loss = economy;
        let (drive, limit) = learned_limit(&config, context.seed)?;
        let points = SHARES.map(|share| (share * limit.nm, share * limit.i_q));
        let measured = context.in_parallel("losses", &points, |number, &point| {
            measure(&config, &drive, point, context.seed.wrapping_add(number))
        })?;
        let word = if economy { "economy" } else { "setting" };
        for (percent, [i_d, nm, loss]) in SHARES.map(|share| 100.0 * share).iter().zip(measured) {
            let least = least_loss(&plant_settings(&config).machine, nm);
            outcome.metrics.set(format!("loss_{word}_{percent}_pct_of_least"), loss / least);
            table.record([
                ("flux", Cell::from(word)),
                ("torque (% of the limit)", Cell::fixed(*percent, 0)),
                ("torque (Nm)", Cell::fixed(nm, 2)),
                ("d-axis current (A)", Cell::fixed(i_d, 2)),
                ("loss (W)", Cell::fixed(loss, 1)),
                ("least (W)", Cell::fixed(least, 1)),
                ("loss of least", Cell::fixed(loss / least, 3)),
            ]);
        }
    }
    outcome.tables.push(table);
    Ok(outcome)
}

/// Minimum copper loss at a torque, W: `1.5 (r_s i_d^2 + (r_s + R_R) i_q^2)` with `i_d = i_q sqrt((r_s + R_R)/r_s)`.
fn least_loss(machine: &MachineSettings, nm: f64) -> f64 {
    let k = machine.lm / (machine.lm + machine.llr);
    let both = machine.rs + k * k * machine.rr;
    2.0 * nm * (machine.rs * both).sqrt() / (f64::from(machine.pole_pairs) * k * machine.lm)
}

/// Mean d-axis current, A, torque, Nm, and copper loss, W, at a torque; also takes a first value of the q-axis current.
fn measure(
    config: &Config,
    drive: &Drive,
    (nm, mut i_q): (f64, f64),
    seed: u64,
) -> Result<[f64; 3], Error> {
    let mut bench = Bench::held(config, drive, RPM, seed)?;
    for _ in 0..CORRECTIONS {
        bench.command_torque(i_q)?;
        bench.watch(CORRECTED_S);
        // The torque is proportional to the current or to its square.
        i_q *= (nm / bench.rig.plant.torque()).sqrt();
    }
    let mut mean = [0.0; 3];
    for _ in 0..SAMPLES {
        bench.watch(SAMPLE_S);
        let (plant, machine) = (&bench.rig.plant, plant_settings(config).machine);
        let (psi, i) = (plant.rotor_flux(), plant.current());
        let rotor = (psi - i * machine.lm) / (machine.lm + machine.llr);
        let loss = 1.5 * (machine.rs * i.norm_sqr() + machine.rr * rotor.norm_sqr());
        let now = [psi.norm() / machine.lm, plant.torque(), loss];
        mean.iter_mut().zip(now).for_each(|(mean, now)| *mean += now / f64::from(SAMPLES));
    }
    let lost = || Error::Refused(format!("the drive did not regulate {nm:.2} Nm"));
    if bench.has_ended { Err(lost()) } else { Ok(mean) }
}
