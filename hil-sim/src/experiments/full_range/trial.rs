//! One run, and its record.

use super::case::Case;
use crate::experiments::battery::{Bench, LONGEST_START_S, Moment, Trial, nominal_limit_a};
use crate::experiments::course::{Change, Part, Ramp, Shaft};
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
/// Error within which a flying start has found the flux, degrees, and the longest time for it, s.
const CAUGHT_DEG: f64 = 15.0;
const LONGEST_CATCH_S: f64 = 3.0;
/// Time without current before a start with residual flux, s.
const OFF_S: (f64, f64) = (0.02, 0.3);
/// Inertia of the braked shaft relative to the motor's, its ramp, rpm/s on four poles, and the longest stop, s.
const HEAVY: f64 = 5.0;
const HEAVY_RAMP_RPM_PER_S: f64 = 300.0;
const LONGEST_STOP_S: f64 = 60.0;
/// Speed below which the shaft counts as stopped, rpm on four poles.
const STOPPED_RPM: f64 = 30.0;
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

/// A run: the bench, and its random values.
pub struct Run<'a> {
    case: Case,
    rpm: f64,
    i_q: f64,
    sign: f64,
    turn_deg: f64,
    off_s: f64,
    bench: Bench<'a>,
}

impl<'a> Run<'a> {
    /// Makes a run with a copy of a drive that is off; the configuration comes from [`set_up`].
    ///
    /// # Errors
    /// If the plant is refused.
    pub fn new(case: Case, config: &'a Config, drive: &Drive, seed: u64) -> Result<Self, Error> {
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
        let mut bench = Bench::new(config, drive, case.shaft(rpm), seed)?;
        bench.trial = Trial { case: case.name(), rpm, i_q, ..bench.trial };
        bench.wrong_deg = LOST_DEG;
        Ok(Self { case, rpm, i_q, sign, turn_deg, off_s, bench })
    }

    /// Does the run; with `traced` it also returns the curves.
    ///
    /// # Errors
    /// If the plant is refused, or the drive refuses a reference.
    pub fn run(mut self, traced: bool) -> Result<(Trial, Vec<Moment>), Error> {
        self.bench.trace = traced.then(Vec::new);
        self.course()?;
        Ok(self.bench.finish())
    }

    fn course(&mut self) -> Result<(), Error> {
        match self.case.kind {
            RangeKind::TurningStart => {}
            RangeKind::Ramps | RangeKind::HotRamps => self.bench.start(),
            _ => self.up_to_speed()?,
        }
        if self.bench.has_ended {
            return Ok(());
        }
        match self.case.kind {
            RangeKind::TurningStart => return self.turning_start(),
            RangeKind::ResidualStart => {
                // A drive that has stopped itself refuses this command.
                let _ = self.bench.rig.command(&Command::Stop(Stop::Coast));
                self.bench.wait(LONGEST_START_S);
                self.bench.coast(self.off_s);
                return self.turning_start();
            }
            RangeKind::LoadSteps | RangeKind::Ramps | RangeKind::HotRamps | RangeKind::Outage => {
                self.bench.count_after(0.0);
            }
            RangeKind::Braking => return self.braking(),
            _ => self.bench.count_after(0.5),
        }
        self.bench.follow(&self.parts())?;
        let is_constant =
            matches!(self.case.kind, RangeKind::Constant | RangeKind::WrongParameters);
        if is_constant && !self.bench.has_ended {
            let taken = f64::from(self.bench.rig.drive.telemetry().reference.q);
            self.bench.trial.torque_error = Some(self.bench.torque_error(taken));
        }
        Ok(())
    }

    /// Starts at rest and brings the shaft up to speed, without torque or by the drive's regulation.
    fn up_to_speed(&mut self) -> Result<(), Error> {
        self.bench.start();
        if self.case.shaft(self.rpm) != Shaft::Free {
            return self.bench.bring_up();
        }
        self.bench.follow(&[Part::constant(self.rpm, self.ramp_s() + 1.5)])
    }

    /// Time of the ramp to the speed of the run, s.
    fn ramp_s(&self) -> f64 {
        let config = self.bench.config;
        config.rpm(self.rpm.abs()) / f64::from(config.drive.ramp_rpm_per_s())
    }

    /// Returns the parts of a run that consists of nothing else.
    fn parts(&self) -> Vec<Part> {
        let (rpm, i_q, config) = (self.rpm, self.i_q, self.bench.config);
        let at = |value: f64, seconds| Part::constant(value, seconds);
        match self.case.kind {
            RangeKind::Reversals => {
                let step = self.sign * STEP_A.min(nominal_limit_a(config) / config.amperes(1.0));
                [step, -step, step, 0.0, -step].map(|a| at(a, 0.6)).to_vec()
            }
            RangeKind::LoadSteps => {
                let nm = self.sign * LOAD_NM;
                let loaded = |nm| Part { load_nm: config.newton_metres(nm), ..at(rpm, 1.0) };
                [nm, 0.0, -nm, 0.0].map(loaded).to_vec()
            }
            RangeKind::Ramps | RangeKind::HotRamps => {
                // Through zero and back, with or without warming of the motor on the way.
                let once = self.ramp_s();
                let warming = Part::unchanged(Change::Warming(RISE.0, RISE.1), WARMING_S);
                let warms = (self.case.kind == RangeKind::HotRamps).then_some(warming);
                let back = [at(-rpm, 2.0 * once + 0.7), at(0.0, once + 1.0)];
                [at(rpm, once + 0.7)].into_iter().chain(warms).chain(back).collect()
            }
            RangeKind::TurnedFlux => {
                let change = Change::Flux(self.turn_deg);
                vec![at(i_q, 1.0), Part { change, ..at(i_q, 3.0) }]
            }
            RangeKind::Outage => {
                let mains = |volts, s| Part { change: Change::Mains(volts), ..at(rpm, s) };
                vec![mains(0.0, OUTAGE_S), mains(config.inverter.dc_link_v, 2.0)]
            }
            RangeKind::Sag => {
                // The voltage of a stiff dc link falls and returns under torque.
                let sag = |from, to| Part::unchanged(Change::DcLink(Ramp(from, to)), SAG_RAMP_S);
                let held = Part::unchanged(Change::Nothing, SAG_S);
                vec![at(i_q, 1.0), sag(1.0, SAG), held, sag(SAG, 1.0), held]
            }
            _ => vec![at(i_q, 3.5)],
        }
    }

    /// Starts while a dynamometer turns the shaft, then commands torque.
    fn turning_start(&mut self) -> Result<(), Error> {
        let bench = &mut self.bench;
        bench.rig.turn(bench.config.rpm(self.rpm))?;
        let from = bench.time();
        bench.trial.peak_a = 0.0;
        bench.start();
        // The error of the first samples belongs to the search for the flux.
        let before = bench.trial.largest_deg;
        loop {
            bench.watch(1.0 / 600.0);
            if !bench.has_ended && bench.error_deg.abs() < CAUGHT_DEG {
                break;
            }
            if bench.has_ended || bench.time() - from > LONGEST_CATCH_S {
                return Ok(());
            }
        }
        bench.trial.largest_deg = before;
        bench.trial.took_s = Some(bench.time() - from);
        bench.count_after(0.1);
        bench.follow(&[Part::constant(self.sign * CAUGHT_A, 0.7)])
    }

    /// Brakes from full speed to standstill.
    fn braking(&mut self) -> Result<(), Error> {
        let bench = &mut self.bench;
        let from = bench.time();
        bench.count_after(0.0);
        let stopped = bench.config.rpm(STOPPED_RPM) * TAU / 60.0;
        while bench.rig.plant.mechanical_speed().abs() > stopped {
            bench.follow(&[Part::constant(0.0, 0.02)])?;
            if bench.has_ended || bench.time() - from > LONGEST_STOP_S {
                return Ok(());
            }
        }
        bench.trial.took_s = Some(bench.time() - from);
        Ok(())
    }
}
