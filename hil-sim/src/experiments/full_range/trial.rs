//! The course of a run, and its result.

use super::case::Case;
use crate::experiments::course::nominal_limit_a;
use crate::experiments::course::{Bench, Change, Course, Part, Ramp, Shaft, Trial};
use crate::prelude::*;

/// Smallest and largest constant q-axis current, relative to the current limit.
const TORQUE: (f64, f64) = (1.0 / 7.0, 6.0 / 7.0);
/// q-axis current of the steps and of the time after a flying start, A on the dissertation's motor.
const STEP_A: f64 = 3.0;
const CAUGHT_A: f64 = 2.0;
/// Load step, Nm on the dissertation's motor.
const LOAD_NM: f64 = 0.97;
/// Rotation of the flux, degrees.
const TURN_DEG: (f64, f64) = (90.0, 180.0);
/// Relative rise of the resistances of stator and rotor on a hot ramp, and its duration, s.
const RISE: (f64, f64) = (0.2, 0.3);
const WARMING_S: f64 = 3.0;
/// Time without current before a start with residual flux, s.
const OFF_S: (f64, f64) = (0.02, 0.3);
/// Inertia of the braked shaft relative to the motor's, and its ramp, rpm/s on four poles.
const HEAVY: f64 = 5.0;
const HEAVY_RAMP_RPM_PER_S: f64 = 300.0;
/// The dc link of braking and outage: capacitor, resistance of the mains, other load.
const CAPACITOR_F: f64 = 470e-6;
const SOURCE_OHM: f64 = 2.0;
const OTHERS_W: f64 = 5.0;
const OUTAGE_S: f64 = 1.0;
/// The sag: share of the dc-link voltage that remains, times in which it falls and returns, and duration.
const SAG: f64 = 230.0 / 311.0;
const SAG_RAMP_S: f64 = 0.01;
const SAG_S: f64 = 1.0;

/// Adds the shaft and the dc link of a case to a configuration.
pub fn set_up(case: Case, config: &mut Config) {
    if case.kind == RangeKind::Braking {
        config.motor.inertia *= HEAVY;
        config.drive.inertia = Some(config.drive.inertia() * HEAVY as f32);
        config.drive.speed.ramp_rpm_per_s = Some(config.rpm(HEAVY_RAMP_RPM_PER_S) as f32);
    }
    if matches!(case.kind, RangeKind::Braking | RangeKind::Outage) {
        let link = &mut config.dc_link;
        (link.capacitor_f, link.source, link.load_w) = (CAPACITOR_F, SOURCE_OHM, OTHERS_W);
        link.pulses = 0;
    }
}

/// Draws a run of a case: its speed, rpm on four poles, its q-axis current, A on the dissertation's motor, and its
/// course. The configuration comes from [`set_up`].
fn drawn(case: Case, config: &Config, seed: u64) -> (f64, f64, Course) {
    let mut random = seeded(seed);
    let rpm = case.speed(&mut random);
    let per_a = config.amperes(1.0);
    let most = nominal_limit_a(config) / per_a;
    let limit = f64::from(config.drive.current_limit_a()) / per_a;
    let share = random.random_range(TORQUE.0..=TORQUE.1);
    let i_q = sign(&mut random) * most.min(share * limit);
    let sign = sign(&mut random);
    let turn_deg = sign * random.random_range(TURN_DEG.0..=TURN_DEG.1);
    let off_s = random.random_range(OFF_S.0..=OFF_S.1);

    let at = Part::constant;
    let ramp_s = config.rpm(rpm.abs()) / f64::from(config.drive.ramp_rpm_per_s());
    let (held, free) = (Shaft::Held(rpm), Shaft::Free);
    let torque = |parts: &[Part]| Course::from_rest(held, &[], 0.5, parts);
    let speed = |parts: &[Part]| Course::from_rest(free, &[at(rpm, ramp_s + 1.5)], 0.0, parts);
    let [start, coast, catch, count] =
        [Change::Start, Change::Coast(off_s), Change::FlyingStart(rpm), Change::Count(0.1)]
            .map(Part::event);
    let caught = at(sign * CAUGHT_A, 0.7);
    let course = match case.kind {
        RangeKind::All | RangeKind::Constant | RangeKind::WrongParameters => {
            torque(&[at(i_q, 3.5)])
        }
        RangeKind::Reversals => {
            let step = sign * STEP_A.min(most);
            torque(&[step, -step, step, 0.0, -step].map(|a| at(a, 0.6)))
        }
        RangeKind::LoadSteps => {
            let nm = sign * LOAD_NM;
            let loaded = |nm| Part { load_nm: config.newton_metres(nm), ..at(rpm, 1.0) };
            speed(&[nm, 0.0, -nm, 0.0].map(loaded))
        }
        RangeKind::Ramps | RangeKind::HotRamps => {
            // Through zero and back, with or without warming of the motor on the way.
            let warming = Part::unchanged(Change::Warming(RISE.0, RISE.1), WARMING_S);
            let warms = (case.kind == RangeKind::HotRamps).then_some(warming);
            let back = [at(-rpm, 2.0 * ramp_s + 0.7), at(0.0, ramp_s + 1.0)];
            let parts = [&[at(rpm, ramp_s + 0.7)], warms.as_slice(), &back].concat();
            Course::from_rest(free, &[], 0.0, &parts)
        }
        RangeKind::TurnedFlux => {
            let change = Change::Flux(turn_deg);
            torque(&[at(i_q, 1.0), Part { change, ..at(i_q, 3.0) }])
        }
        RangeKind::TurningStart => Course { shaft: held, parts: vec![catch, count, caught] },
        RangeKind::ResidualStart => {
            Course { shaft: held, parts: vec![start, coast, catch, count, caught] }
        }
        RangeKind::Braking => speed(&[Part::event(Change::Brake)]),
        RangeKind::Outage => {
            let mains = |volts, s| Part { change: Change::Mains(volts), ..at(rpm, s) };
            speed(&[mains(0.0, OUTAGE_S), mains(config.inverter.dc_link_v, 2.0)])
        }
        RangeKind::Sag => {
            // The voltage of a stiff dc link falls and returns under torque.
            let sag = |from, to| Part::unchanged(Change::DcLink(Ramp(from, to)), SAG_RAMP_S);
            let low = Part::unchanged(Change::Nothing, SAG_S);
            torque(&[at(i_q, 1.0), sag(1.0, SAG), low, sag(SAG, 1.0), low])
        }
    };
    (rpm, i_q, course)
}

/// Does a run with a copy of a drive that is off; with `traced` it also returns the curves.
///
/// # Errors
/// If the plant is refused, or the drive refuses a reference.
pub fn trial(
    case: Case,
    config: &Config,
    drive: &Drive,
    seed: u64,
    traced: bool,
) -> Result<(Trial, Vec<Point>), Error> {
    let (rpm, i_q, course) = drawn(case, config, seed);
    let mut bench = Bench::new(config, drive, course.shaft, seed)?;
    bench.trial = Trial { case: case.name(), rpm, i_q, ..bench.trial };
    bench.wrong_deg = LOST_DEG;
    bench.rig.trace = traced.then(Vec::new);
    bench.follow(&course.parts)?;
    let is_constant = matches!(case.kind, RangeKind::Constant | RangeKind::WrongParameters);
    if is_constant && !bench.has_ended {
        let taken = f64::from(bench.rig.drive.telemetry().reference.q);
        bench.trial.torque_error = Some(bench.torque_error(taken));
    }
    Ok(bench.finish())
}
