//! The endurance test: the torque limit at zero stator frequency for minutes, and a slow reversal of the speed under the same torque.

mod held;

use self::held::{Held, Standstill, reversing};
use super::course::allowed_a;
use super::steady::{bring_up, prepared};
use super::torque_limit::{BEYOND_A, TorqueLimit};
use crate::prelude::*;

/// Time after the torque command that is not judged, s: flux, angle and dynamometer settle.
const SETTLING_S: f64 = 12.0;
/// Initial speed of the reversal, rpm on four poles; the final speed is its opposite.
const REVERSAL_RPM: f64 = 150.0;

/// A test at the torque limit.
#[derive(PartialEq)]
struct Test {
    key: &'static str,
    name: &'static str,
}

const STANDSTILL: Test = Test { key: "hold", name: "zero stator frequency" };
const REVERSAL: Test = Test { key: "reversal", name: "reversal of the speed" };
/// All tests, each with either sign.
const TESTS: [(Test, f64); 4] =
    [(STANDSTILL, 1.0), (STANDSTILL, -1.0), (REVERSAL, 1.0), (REVERSAL, -1.0)];

/// Runs the experiment, which is not in the source.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut config = context.config.clone();
    config.prepare.learn = true;
    let mut rig = prepared(&config, context.seed)?;
    let after = config.after_learning()?;
    if plant_settings(&after) != plant_settings(&config) {
        // The drive is off, and the motor at rest without flux: another motor replaces it.
        rig.plant = Plant::new(&plant_settings(&after), context.seed).map_err(Error::refused)?;
        rig.plant.set_open_phase(open_phase(&after)).map_err(Error::refused)?;
    }
    let torque = TorqueLimit::new(&config, allowed_a(&rig.drive, config.amperes(BEYOND_A))?)
        .at_most(config.record.torque_pct);
    let limit = torque.i_q;
    let held = context.in_parallel("record", &TESTS, |_, (test, sign)| {
        hold(&after, rig.clone(), test, sign * limit)
    })?;
    let mut outcome = Outcome::default();
    let m = &mut outcome.metrics;
    m.set("limit_a", limit);
    m.set("limit_nm", torque.nm);
    m.set("torque_rated_nm", config.rated_nm());
    m.set("limit_pct_of_rated_torque", torque.percent);
    for test in [STANDSTILL, REVERSAL] {
        let of = || TESTS.iter().zip(&held).filter(|((known, _), _)| *known == test);
        let worst = |value: &dyn Fn(&Held) -> f64| {
            of().map(|(_, held)| value(held).abs()).fold(0.0, f64::max)
        };
        let key = test.key;
        m.set(format!("{key}_error_mean_deg"), worst(&|held| held.error.mean()));
        m.set(format!("{key}_error_rms_deg"), worst(&|held| held.error.rms()));
        m.set(format!("{key}_error_max_deg"), worst(&|held| held.error.largest()));
        if test == STANDSTILL {
            m.set("hold_drift_deg", worst(&Held::drift_deg));
            m.set("hold_speed_rpm", worst(&|held| held.speed.mean()));
            m.set("hold_stator_hz", worst(&|held| held.stator_hz));
            m.set("hold_flux_travel_deg", worst(&|held| held.travel_deg));
        }
        let lost = of().any(|(_, held)| held.is_lost());
        m.set(format!("{key}_lost"), f64::from(u8::from(lost)));
    }
    for ((test, sign), held) in TESTS.iter().zip(&held) {
        let why = held.fault.as_deref().or(held.is_lost().then_some("angle lost"));
        let text = |why| format!("{} at {:+.2} Nm: {why}", test.name, torque.nm * sign);
        outcome.faults.extend(why.map(text));
    }
    outcome.tables.push(held_table(&held, &torque));
    for test in [STANDSTILL, REVERSAL] {
        outcome.figures.push(held_figure(&test, &held));
    }
    outcome.remarks = assumptions(&config);
    outcome.remarks.push(torque.text(&config));
    Ok(outcome)
}

/// Starts the drive, commands its torque, and watches.
fn hold(config: &Config, mut rig: Rig, test: &Test, i_q: f64) -> Result<Held, Error> {
    let reverses = *test == REVERSAL;
    let rpm = if reverses { config.rpm(REVERSAL_RPM) } else { 0.0 };
    bring_up(&mut rig, rpm)?;
    if rig.fault().is_none() {
        rig.command(&Command::Torque(i_q as f32))?;
    }
    if reverses {
        let seconds = config.record.reversal_s;
        Held::watch(&mut rig, SETTLING_S, 0.0, |_, plant| reversing(rpm, seconds)(0.0, plant))?;
        return Held::watch(&mut rig, seconds, 0.0, reversing(rpm, seconds));
    }
    let mut dynamometer = Standstill::new(config);
    let at = dynamometer.at;
    let mut speed = |_: f64, plant: &_| dynamometer.speed(plant);
    Held::watch(&mut rig, SETTLING_S, at, &mut speed)?;
    Held::watch(&mut rig, 60.0 * config.record.minutes, at, speed)
}

fn held_table(all: &[Held], torque: &TorqueLimit) -> Table {
    let degrees = |value: f64| Cell::fixed(value, 2);
    let columns = columns![|n, held: &Held|
        "course" => Cell::from(TESTS[n].0.name);
        "torque (Nm)" => Cell::fixed(TESTS[n].1 * torque.nm, 2);
        "of rated (%)" => Cell::fixed(TESTS[n].1 * torque.percent, 0);
        "mean error (°)" => degrees(held.error.mean());
        "first (°)" => degrees(held.first.mean());
        "last (°)" => degrees(held.last.mean());
        "rms (°)" => degrees(held.error.rms());
        "largest (°)" => degrees(held.error.largest());
        "torque of the command (%)" =>
            Cell::fixed(100.0 * held.torque.mean() / (TESTS[n].1 * torque.nm), 2);
        "speed (rpm)" => Cell::fixed(held.speed.mean(), 2);
        "end" => Cell::from(held.fault.as_deref().unwrap_or("regulates"));
    ];
    Table::of(texts::table("record", "held"), &columns, all.iter().enumerate())
}

fn held_figure(test: &Test, all: &[Held]) -> Figure {
    let x = "time (s)";
    let labels = ["angle error (° electrical)", "torque (Nm)", "speed (rpm)"];
    let mut figure = Figure::new(test.key, format!("The torque limit, {}", test.name), "");
    for (n, label) in labels.into_iter().enumerate() {
        let of = TESTS.iter().zip(all).filter(|((known, _), _)| known == test);
        let panel = of.fold(Panel::new(x, label), |panel, ((_, sign), held)| {
            let name = format!("{:+.0} % of the limit", 100.0 * sign);
            panel.with(Series::line(name, held.lines[n].clone()))
        });
        figure = figure.panel(panel);
    }
    figure
}
