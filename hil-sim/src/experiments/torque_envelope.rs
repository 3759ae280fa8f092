//! The largest torque over speed and dc-link voltage, motoring and generating, as the drive gives it.

use super::course::Bench;
use super::full_range::{I_D_A, for_the_range};
use super::torque_limit::{BEYOND_A, TorqueLimit, learned_limit};
use crate::prelude::*;

/// Speeds, rpm on four poles.
const STEP_RPM: f64 = 300.0;
const STEPS: u32 = 12;
/// Voltages of the dc link relative to the nominal one: 230, 270 and 311 V.
const LINKS: [f64; 3] = [230.0 / 311.0, 270.0 / 311.0, 1.0];
/// Time under torque before the measurement, s, in which field weakening and its trim settle; and the time of the mean.
const SETTLING_S: f64 = 2.0;
const MEAN_S: f64 = 0.5;
/// Signs of the torque, and their names.
const SIGNS: [(f64, &str); 2] = [(1.0, "motoring"), (-1.0, "generating")];

/// A point of the curve.
#[derive(Clone, Copy)]
struct Point {
    rpm: f64,
    link: f64,
    /// 1 for motoring, -1 for generating.
    sign: f64,
}

/// Result of the measurement; none if the drive did not regulate to the end.
type Measured = Option<(f64, f64)>;

/// Runs the experiment, which is not in the source.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let config = for_the_range(context.config)?;
    let (drive, limit) = learned_limit(&config, context.seed)?;
    let curves = SIGNS.iter().flat_map(|&(sign, _)| LINKS.map(|link| (sign, link)));
    let rpm = || (0..=STEPS).map(|n| f64::from(n) * STEP_RPM);
    let points: Vec<_> =
        curves.flat_map(|(sign, link)| rpm().map(move |rpm| Point { rpm, link, sign })).collect();
    let measured = context.in_parallel("torque-envelope", &points, |number, &point| {
        measure(&config, &drive, point, context.seed.wrapping_add(number))
    })?;
    Ok(outcome(&config, &limit, &points.into_iter().zip(measured).collect::<Vec<_>>()))
}

/// Mean torque, Nm, in the commanded direction, and largest phase current, A.
fn measure(config: &Config, drive: &Drive, point: Point, seed: u64) -> Result<Measured, Error> {
    let mut bench = Bench::held(config, drive, point.rpm, seed)?;
    let volts = config.inverter.dc_link_v * point.link;
    bench.rig.plant.set_dc_link(volts).map_err(Error::refused)?;
    bench.command_torque(point.sign * config.amperes(BEYOND_A))?;
    bench.count_after(SETTLING_S);
    bench.watch(SETTLING_S + MEAN_S);
    Ok((!bench.has_ended).then(|| (point.sign * bench.torque.mean(), bench.rig.peak_a)))
}

fn outcome(config: &Config, limit: &TorqueLimit, measured: &[(Point, Measured)]) -> Outcome {
    let mut outcome = Outcome::default();
    let mut table = texts::table("torque-envelope", "largest");
    let mut figure = Figure::new("envelope", "Largest torque over the speed", "");
    let volts = |link: f64| format!("{:.0} V", link * config.inverter.dc_link_v);
    let at = |sign: f64, link: f64| {
        measured.iter().filter(move |(p, _)| p.sign == sign && p.link == link)
    };
    for (sign, word) in SIGNS {
        let mut panel = Panel::new("speed (rpm)", format!("torque, {word} (Nm)"));
        for link in LINKS {
            let curve = at(sign, link).filter_map(|(p, m)| Some((config.rpm(p.rpm), (*m)?.0)));
            panel = panel.with(Series::line(volts(link), curve.collect()));
        }
        let ends = [0.0, config.rpm(STEP_RPM * f64::from(STEPS))];
        let line = ends.map(|rpm| (rpm, limit.nm)).to_vec();
        figure = figure.panel(panel.with(Series::limit("torque limit at rest", line)));
    }
    for n in 0..=STEPS {
        let rpm = f64::from(n) * STEP_RPM;
        let mut row = vec![("speed (rpm)".to_owned(), Cell::fixed(config.rpm(rpm), 0))];
        for (sign, word) in SIGNS {
            for link in LINKS {
                let found = at(sign, link).find(|(p, _)| p.rpm == rpm).and_then(|(_, m)| *m);
                let cell =
                    |of, digits| Cell::or_dash(found.map(|(nm, _)| Cell::fixed(of * nm, digits)));
                row.push((format!("{word}, {} (Nm)", volts(link)), cell(1.0, 2)));
                if link == 1.0 {
                    row.push((format!("{word} (% of rated)"), cell(100.0 / config.rated_nm(), 0)));
                }
            }
        }
        table.record(row);
    }
    let m = &mut outcome.metrics;
    m.set("torque_limit_nm", limit.nm);
    m.set("torque_limit_pct_of_rated", limit.percent);
    m.set("torque_rated_nm", config.rated_nm());
    for (point, nm) in measured.iter().filter_map(|(p, m)| Some((p, (*m)?.0))) {
        let word = if point.sign > 0.0 { "motoring" } else { "generating" };
        let link = (point.link * config.inverter.dc_link_v).round();
        m.set(format!("torque_{word}_{link}_v_{}_rpm_nm", point.rpm), nm);
    }
    m.set("points_lost", measured.iter().filter(|(_, m)| m.is_none()).count() as f64);
    let peak = measured.iter().filter_map(|(_, m)| Some((*m)?.1)).fold(0.0, f64::max);
    m.set("current_peak_a", peak);
    outcome.tables.push(table);
    outcome.figures.push(figure);
    outcome.remarks = assumptions(config);
    outcome.remarks.push(limit.text(config));
    texts::add_remarks(&mut outcome, "torque-envelope", &[("i_d_a", config.amperes(I_D_A))]);
    outcome
}
