//! Field orientation with the encoder: the error of the drive's flux angle, and the torque.

use crate::prelude::*;

const SPEEDS_RPM: [f64; 7] = [0.0, 30.0, 150.0, 300.0, 700.0, 1200.0, 1440.0];
const IQ_A: f64 = 2.0;

/// Mean flux angle error, degrees, and torque as a share of 3/2 P (Lm/Lr) ψ i_q.
type Orientation = (f64, f64);

/// Runs the experiment: Section 2.3.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let jobs: Vec<(bool, f64)> =
        [true, false].iter().flat_map(|&c| SPEEDS_RPM.iter().map(move |&n| (c, n))).collect();
    let results = context.in_parallel("encoder-orientation", &jobs, |_, &(compensate, rpm)| {
        orientation(context, compensate, rpm)
    })?;
    let (with, without) = results.split_at(SPEEDS_RPM.len());

    let mut outcome = Outcome::default();
    let columns = columns![|n, a: &Orientation|
        "speed (rpm)" => Cell::fixed(SPEEDS_RPM[n], 0);
        "angle error, delays compensated (°)" => Cell::fixed(a.0, 3);
        "delays left in (°)" => Cell::fixed(without[n].0, 3);
        "torque, compensated (% of Eq. 2.7)" => Cell::fixed(a.1 * 100.0, 2);
        "left in (%)" => Cell::fixed(without[n].1 * 100.0, 2);
    ];
    let iq_a = ("iq_a", context.config.amperes(IQ_A));
    let table = texts::table_with("encoder-orientation", "orientation", &[iq_a]);
    outcome.tables.push(Table::of(table, &columns, with.iter().enumerate()));
    let line = |name: &str, of: &[Orientation]| {
        Series::line(name, SPEEDS_RPM.into_iter().zip(of.iter().map(|x| x.0)).collect())
    };
    let largest = |r: &[Orientation]| r.iter().map(|x| x.0.abs()).fold(0.0, f64::max);
    outcome.metrics.set("angle_error_max_deg", largest(with));
    outcome.metrics.set("angle_error_uncompensated_max_deg", largest(without));
    let torque = with.iter().map(|x| (x.1 - 1.0).abs()).fold(0.0, f64::max);
    outcome.metrics.set("torque_error_max_pct", torque * 100.0);
    let panel = Panel::new("speed (rpm)", "mean flux angle error (° electrical)")
        .with(line("delays compensated", with))
        .with(line("delays left in", without));
    outcome.figures.push(texts::figure("encoder-orientation", "orientation").panel(panel));
    Ok(outcome)
}

fn orientation(context: &Context<'_>, compensate: bool, rpm: f64) -> Result<Orientation, Error> {
    let mut config = context.config.clone();
    config.drive.angle_source = AngleSource::Encoder;
    config.drive.ignore_delays = !compensate;
    config.load.mode = LoadMode::Speed;
    config.load.speed_rpm = rpm;
    let mut rig = Rig::started(&config, context.seed, Mode::Torque)?;
    let iq = config.amperes(IQ_A);
    rig.settle(&Command::Torque(iq as f32), 1.0)?;
    let [error, share] = rig.stats(context.seconds.unwrap_or(0.3), |p| {
        [p.angle_error_deg, p.torque / (p.torque_per_flux_ampere * p.flux * iq)]
    });
    Ok((error.mean(), share.mean()))
}
