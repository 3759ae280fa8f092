//! One run, and its record.

use super::case::Case;
use crate::experiments::battery::{
    Bench, LONGEST_START_S, LoadTorque, Moment, Part, Refused, Shaft, Trial, bring_up, follow,
    nominal_limit_a,
};
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
    config: &'a Config,
    rpm: f64,
    i_q: f64,
    sign: f64,
    turn_deg: f64,
    off_s: f64,
    bench: Bench,
}

/// Reasons for an early end of a run.
enum End {
    /// The drive does not start.
    Refused(Refused),
    /// The drive no longer regulates.
    Stopped,
    Failed(Error),
}

impl From<Error> for End {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// Continues while the drive regulates.
fn still(regulates: bool) -> Result<(), End> {
    if regulates { Ok(()) } else { Err(End::Stopped) }
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
        let mut bench = Bench::new(config, drive, case.shaft(rpm).at_rest().0, seed)?;
        bench.trial = Trial { case: case.name(), rpm, i_q, ..bench.trial };
        bench.wrong_deg = LOST_DEG;
        Ok(Self { case, config, rpm, i_q, sign, turn_deg, off_s, bench })
    }

    /// Does the run; with `traced` it also returns the curves.
    ///
    /// # Errors
    /// If the plant is refused, or the drive refuses a reference.
    pub fn run(mut self, traced: bool) -> Result<(Trial, Vec<Moment>), Error> {
        self.bench.trace = traced.then(Vec::new);
        let still = match self.course() {
            Ok(()) => true,
            Err(End::Stopped) => false,
            Err(End::Refused(why)) => {
                self.bench.trial.refused = Some(why);
                true
            }
            Err(End::Failed(error)) => return Err(error),
        };
        Ok(self.bench.finish(still))
    }

    fn course(&mut self) -> Result<(), End> {
        let (rpm, i_q, sign) = (self.rpm, self.i_q, self.sign);
        let step = sign * STEP_A.min(nominal_limit_a(self.config) / self.config.amperes(1.0));
        let loaded = |nm: f64| Part { load: LoadTorque::Nm(nm), ..Part::constant(rpm, 1.0) };
        match self.case.kind {
            RangeKind::TurningStart => {}
            RangeKind::Ramps | RangeKind::HotRamps => self.start()?,
            _ => self.up_to_speed()?,
        }
        match self.case.kind {
            RangeKind::Constant | RangeKind::WrongParameters => {
                self.counted(0.5, &[Part::constant(i_q, 3.5)])?;
                let taken = f64::from(self.bench.rig.drive.telemetry().reference.q);
                self.bench.trial.torque_error = Some(self.bench.torque_error(self.config, taken));
                Ok(())
            }
            RangeKind::Reversals => {
                let steps = [step, -step, step, 0.0, -step].map(|a| Part::constant(a, 0.6));
                self.counted(0.5, &steps)
            }
            RangeKind::LoadSteps => {
                let nm = sign * LOAD_NM;
                self.counted(0.0, &[nm, 0.0, -nm, 0.0].map(loaded))
            }
            RangeKind::Ramps | RangeKind::HotRamps => self.ramps(),
            RangeKind::TurnedFlux => {
                let turned = Part { turn_deg: self.turn_deg, ..Part::constant(i_q, 3.0) };
                self.counted(0.5, &[Part::constant(i_q, 1.0), turned])
            }
            RangeKind::TurningStart => self.turning_start(),
            RangeKind::ResidualStart => {
                // A drive that has stopped itself refuses this command.
                let _ = self.bench.rig.command(&Command::Stop(Stop::Coast));
                self.bench.wait(LONGEST_START_S);
                self.bench.coast(self.off_s);
                self.turning_start()
            }
            RangeKind::Braking => self.braking(),
            RangeKind::Outage => {
                let nominal = self.config.inverter.dc_link_v;
                self.bench.counted_from = Some(self.bench.time());
                for (mains, seconds) in [(0.0, OUTAGE_S), (nominal, 2.0)] {
                    self.bench.rig.plant.set_mains(mains).map_err(Error::refused)?;
                    self.follow(&[Part::constant(rpm, seconds)])?;
                }
                Ok(())
            }
            RangeKind::Sag => self.sag(),
        }
    }

    /// Starts, and waits until the drive regulates.
    fn start(&mut self) -> Result<(), End> {
        self.bench.start(self.case.shaft(self.rpm).at_rest().1).map_err(End::Refused)
    }

    /// Starts at rest and brings the shaft up to speed, without torque or by the drive's regulation.
    fn up_to_speed(&mut self) -> Result<(), End> {
        self.start()?;
        let shaft = self.case.shaft(self.rpm);
        still(bring_up(&mut self.bench, shaft, self.config)?)?;
        if shaft != Shaft::Free {
            return Ok(());
        }
        let ramp = f64::from(self.config.drive.ramp_rpm_per_s());
        let seconds = self.config.rpm(self.rpm.abs()) / ramp + 1.5;
        self.follow(&[Part::constant(self.rpm, seconds)])
    }

    fn follow(&mut self, parts: &[Part]) -> Result<(), End> {
        still(follow(&mut self.bench, self.config, parts)?.is_some())
    }

    /// Follows the parts, and counts the error after this many seconds.
    fn counted(&mut self, after: f64, parts: &[Part]) -> Result<(), End> {
        self.bench.counted_from = Some(self.bench.time() + after);
        self.follow(parts)
    }

    /// Ramps through zero and back, with or without warming of the motor on the way.
    fn ramps(&mut self) -> Result<(), End> {
        let rate = f64::from(self.config.drive.ramp_rpm_per_s());
        let once = self.config.rpm(self.rpm.abs()) / rate;
        let rpm = self.rpm;
        self.counted(0.0, &[Part::constant(rpm, once + 0.7)])?;
        if self.case.kind == RangeKind::HotRamps {
            let machine = plant_settings(self.config).machine;
            let steps = 100;
            for n in 1..=steps {
                let share = f64::from(n) / f64::from(steps);
                let rs = machine.rs * (1.0 + RISE.0 * share);
                let rr = machine.rr * (1.0 + RISE.1 * share);
                self.bench.rig.plant.set_resistances(rs, rr).map_err(Error::refused)?;
                still(self.bench.watch(WARMING_S / f64::from(steps)))?;
            }
        }
        self.follow(&[Part::constant(-rpm, 2.0 * once + 0.7), Part::constant(0.0, once + 1.0)])
    }

    /// Starts while a dynamometer turns the shaft, then commands torque.
    fn turning_start(&mut self) -> Result<(), End> {
        let speed = self.config.rpm(self.rpm) * TAU / 60.0;
        self.bench.rig.set_load(Load::Speed { speed })?;
        let (from, i_q) = (self.bench.time(), self.sign * CAUGHT_A);
        self.bench.trial.peak_a = 0.0;
        self.start()?;
        // The error of the first samples belongs to the search for the flux.
        let before = self.bench.trial.largest_deg;
        loop {
            still(self.bench.watch(1.0 / 600.0))?;
            if self.bench.error_deg.abs() < CAUGHT_DEG {
                break;
            }
            if self.bench.time() - from > LONGEST_CATCH_S {
                return Ok(());
            }
        }
        self.bench.trial.largest_deg = before;
        self.bench.trial.took_s = Some(self.bench.time() - from);
        self.counted(0.1, &[Part::constant(i_q, 0.7)])
    }

    /// Brakes from full speed to standstill.
    fn braking(&mut self) -> Result<(), End> {
        let from = self.bench.time();
        self.bench.counted_from = Some(from);
        let stopped = self.config.rpm(STOPPED_RPM) * TAU / 60.0;
        while self.bench.rig.plant.mechanical_speed().abs() > stopped {
            self.follow(&[Part::constant(0.0, 0.02)])?;
            if self.bench.time() - from > LONGEST_STOP_S {
                return Ok(());
            }
        }
        self.bench.trial.took_s = Some(self.bench.time() - from);
        Ok(())
    }

    /// The voltage of a stiff dc link falls and returns under torque.
    fn sag(&mut self) -> Result<(), End> {
        self.counted(0.5, &[Part::constant(self.i_q, 1.0)])?;
        let nominal = self.config.inverter.dc_link_v;
        for (from, to) in [(1.0, SAG), (SAG, 1.0)] {
            let steps = 60;
            for n in 1..=steps {
                let share = from + (to - from) * f64::from(n) / f64::from(steps);
                self.bench.rig.plant.set_dc_link(nominal * share).map_err(Error::refused)?;
                still(self.bench.watch(SAG_RAMP_S / f64::from(steps)))?;
            }
            still(self.bench.watch(SAG_S))?;
        }
        Ok(())
    }
}
