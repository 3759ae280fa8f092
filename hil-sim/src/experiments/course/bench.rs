//! A drive and a plant in a run, with the quantities that are observed.

use super::limits::{nominal_limit_a, share_of_limit, torque_nm};
use super::trial::{CLASSES_PER_DEG, LARGEST_CLASS, Refused, Trial};
use super::{Change, Part, Shaft};
use crate::prelude::*;

/// Error beyond which the angle is wrong, degrees, unless the run sets another limit.
const WRONG_DEG: f64 = 30.0;
/// Limits of the flux relative to its nominal value: it is off below the first and above the second.
const FLUX_OFF: (f64, f64) = (0.5, 2.0);
/// Longest interruption over which a state is regarded as continuing, s: an angle that runs through is right now and then.
const GAP_S: f64 = 0.1;

/// Error within which a flying start has found the flux, degrees, the longest time for it, s, and the time between two looks, s.
const CAUGHT_DEG: f64 = 15.0;
const LONGEST_CATCH_S: f64 = 3.0;
const LOOK_S: f64 = 1.0 / 600.0;
/// Longest stop without torque, and longest stop by braking, s.
const LONGEST_COAST_S: f64 = 30.0;
const LONGEST_STOP_S: f64 = 60.0;
/// Speed below which the shaft counts as stopped, rpm on four poles, and the time between two looks, s.
const STOPPED_RPM: f64 = 30.0;
const BRAKED_S: f64 = 0.02;

/// Step time and acceleration of the dynamometer that brings a shaft up to speed, s and rpm/s, and the time after it, s.
const PACE_S: f64 = 0.01;
const RAMP_RPM_PER_S: f64 = 600.0;
const AT_SPEED_S: f64 = 0.3;

/// Longest duration of a state.
#[derive(Default)]
pub struct Lasting {
    since: Option<f64>,
    last: f64,
    longest: f64,
}

impl Lasting {
    fn push(&mut self, t: f64, is: bool) {
        if is {
            let since = *self.since.get_or_insert(t);
            (self.last, self.longest) = (t, self.longest.max(t - since));
        } else if t - self.last > GAP_S {
            self.since = None;
        }
    }
}

/// A drive and a plant, with the quantities that are observed.
pub struct Bench<'a> {
    /// Drive and plant.
    pub rig: Rig,
    /// Configuration of the plant, which scales currents, speeds and torques.
    pub config: &'a Config,
    shaft: Shaft,
    /// Flux of the magnetising current, Wb.
    nominal_flux: f64,
    /// Time from which the error is counted, s; unset before the first reference, and after the flux was rotated.
    counted_from: Option<f64>,
    /// Torque of the motor over the same time, Nm.
    pub torque: Stats,
    /// The run so far.
    pub trial: Trial,
    /// The last reference as the drive accepted it, A or rpm.
    pub taken: f64,
    /// Angle error at the last sample, degrees.
    pub error_deg: f64,
    /// Error beyond which the angle is wrong, degrees.
    pub wrong_deg: f64,
    counts: Vec<u32>,
    /// Durations for which the angle is wrong and lost, and the flux off.
    lasting: [Lasting; 3],
    /// Whether angle or flux was off at any time since the first reference, and whether one of them is off now.
    was_off: bool,
    is_off: bool,
    /// Whether the flux was rotated.
    turned: bool,
    /// Whether the drive did not start, or no longer regulates.
    pub has_ended: bool,
}

impl<'a> Bench<'a> {
    /// Copies a drive that is off, and makes the plant with this shaft at rest.
    ///
    /// # Errors
    /// If the plant is refused.
    pub fn new(config: &'a Config, drive: &Drive, shaft: Shaft, seed: u64) -> Result<Self, Error> {
        let mut settings = plant_settings(config);
        settings.mechanics.load = match shaft {
            Shaft::Locked => Load::Locked,
            Shaft::Held(_) => Load::Speed { speed: 0.0 },
            Shaft::Free => Load::Free { torque: 0.0 },
        };
        let mut plant = Plant::new(&settings, seed).map_err(Error::refused)?;
        plant.set_open_phase(open_phase(config)).map_err(Error::refused)?;
        Ok(Self {
            rig: Rig::of(plant, drive.clone()),
            config,
            shaft,
            nominal_flux: settings.machine.lm * f64::from(config.drive.i_d()),
            counted_from: None,
            torque: Stats::default(),
            trial: Trial { seed, ..Trial::default() },
            taken: 0.0,
            error_deg: 0.0,
            wrong_deg: WRONG_DEG,
            counts: vec![0; LARGEST_CLASS + 1],
            lasting: Default::default(),
            was_off: false,
            is_off: false,
            turned: false,
            has_ended: false,
        })
    }

    /// Makes a bench whose drive regulates torque while a dynamometer holds this speed, rpm, if it gets there.
    ///
    /// # Errors
    /// If the plant is refused.
    pub fn held(config: &'a Config, drive: &Drive, rpm: f64, seed: u64) -> Result<Self, Error> {
        let mut bench = Self::new(config, drive, Shaft::Held(rpm), seed)?;
        bench.bring_up()?;
        Ok(bench)
    }

    /// Starts, and waits until the drive regulates. If it does not, the run has ended.
    pub fn start(&mut self) {
        let mode = if self.shaft == Shaft::Free { Mode::Speed } else { Mode::Torque };
        self.trial.refused = match self.rig.begin(mode) {
            Ok(state) if state.regulates() => None,
            Ok(State::Fault(fault)) => Some(Refused::Start(fault.code())),
            Ok(other) => Some(Refused::Otherwise(format!("the drive is {other}"))),
            Err(why) => Some(Refused::Otherwise(why.to_string())),
        };
        self.has_ended = self.trial.refused.is_some();
    }

    /// Starts at rest, and brings a held shaft up to speed without torque.
    ///
    /// # Errors
    /// If the speed is out of range.
    pub fn bring_up(&mut self) -> Result<(), Error> {
        self.start();
        let Shaft::Held(rpm) = self.shaft else { return Ok(()) };
        let speed = self.config.rpm(rpm) * TAU / 60.0;
        let steps = (rpm.abs() / RAMP_RPM_PER_S / PACE_S).ceil() as u32;
        for n in 1..=steps {
            self.rig.set_load(Load::Speed { speed: speed * f64::from(n) / f64::from(steps) })?;
            self.watch(PACE_S);
        }
        self.watch(AT_SPEED_S);
        Ok(())
    }

    /// Counts the error after this many seconds.
    pub fn count_after(&mut self, seconds: f64) {
        self.counted_from = Some(self.rig.time() + seconds);
    }

    /// Runs the parts.
    ///
    /// # Errors
    /// If the plant refuses a change, or the drive a reference.
    pub fn follow(&mut self, parts: &[Part]) -> Result<(), Error> {
        let turns = |part: &Part| matches!(part.change, Change::Flux(_));
        self.trial.turns_flux |= parts.iter().any(turns);
        for part in parts {
            if self.shaft == Shaft::Free {
                self.rig.set_load(Load::Free { torque: part.load_nm })?;
            }
            let steps = f64::from(part.steps());
            for n in 1..=part.steps() {
                if self.has_ended {
                    return Ok(());
                }
                let n = f64::from(n);
                if !self.change(part.change, n, steps)? {
                    return Ok(());
                }
                if let Some(reference) = part.reference {
                    self.command(reference.after(n, steps))?;
                }
                self.watch(part.seconds / steps);
            }
        }
        Ok(())
    }

    /// Makes a change, as far as it is in this one of all steps; returns whether the course goes on.
    fn change(&mut self, change: Change, n: f64, steps: f64) -> Result<bool, Error> {
        let (config, plant) = (self.config, &mut self.rig.plant);
        match change {
            Change::Flux(degrees) if n == 1.0 => {
                // From now on the error is no longer counted, and the durations for which angle and flux are off start again.
                plant.turn_rotor_flux(degrees.to_radians());
                (self.turned, self.counted_from) = (true, None);
                self.lasting = Default::default();
            }
            Change::Mains(volts) => plant.set_mains(volts).map_err(Error::refused)?,
            Change::Shaft(rpm) => self.rig.turn(config.rpm(rpm.after(n, steps)))?,
            Change::DcLink(share) => {
                let volts = config.inverter.dc_link_v * share.after(n, steps);
                plant.set_dc_link(volts).map_err(Error::refused)?;
            }
            Change::Warming(stator, rotor) => {
                let (machine, share) = (plant_settings(config).machine, n / steps);
                let warmer = |ohm: f64, rise: f64| ohm * (1.0 + rise * share);
                let (stator, rotor) = (warmer(machine.rs, stator), warmer(machine.rr, rotor));
                plant.set_resistances(stator, rotor).map_err(Error::refused)?;
            }
            Change::Start => self.bring_up()?,
            Change::FlyingStart(rpm) => return self.flying_start(config.rpm(rpm)),
            Change::Coast(seconds) => {
                // A drive that has stopped itself refuses this command.
                let _ = self.rig.command(&Command::Stop(Stop::Coast));
                self.rig.wait_until(LONGEST_COAST_S, State::is_off);
                self.rig.wait(seconds);
            }
            Change::Brake => return self.brake(),
            Change::Count(seconds) => self.count_after(seconds),
            Change::Asymmetry(asymmetry) => {
                let mut changed = config.clone();
                asymmetry.add(&mut changed);
                plant.set_asymmetry(&plant_settings(&changed)).map_err(Error::refused)?;
            }
            Change::Nothing | Change::Flux(_) => {}
        }
        Ok(true)
    }

    /// Starts while a dynamometer turns the shaft, rpm; returns whether the drive has found the flux.
    fn flying_start(&mut self, rpm: f64) -> Result<bool, Error> {
        self.rig.turn(rpm)?;
        let from = self.rig.time();
        self.rig.peak_a = 0.0;
        self.start();
        // The error of the first samples belongs to the search for the flux.
        let before = self.trial.largest_deg;
        self.watch(LOOK_S);
        while self.has_ended || self.error_deg.abs() >= CAUGHT_DEG {
            if self.has_ended || self.rig.time() - from > LONGEST_CATCH_S {
                return Ok(false);
            }
            self.watch(LOOK_S);
        }
        self.trial.largest_deg = before;
        self.trial.took_s = Some(self.rig.time() - from);
        Ok(true)
    }

    /// Brakes to standstill; returns whether the shaft has stopped.
    fn brake(&mut self) -> Result<bool, Error> {
        let from = self.rig.time();
        let stopped = self.config.rpm(STOPPED_RPM) * TAU / 60.0;
        self.command(0.0)?;
        while self.rig.plant.mechanical_speed().abs() > stopped {
            self.watch(BRAKED_S);
            if self.has_ended || self.rig.time() - from > LONGEST_STOP_S {
                return Ok(false);
            }
        }
        self.trial.took_s = Some(self.rig.time() - from);
        Ok(true)
    }

    /// Commands a reference of a part.
    fn command(&mut self, reference: f64) -> Result<(), Error> {
        if self.shaft != Shaft::Free {
            return self.command_torque(share_of_limit(self.config, reference));
        }
        let rpm = self.config.rpm(reference) as f32;
        self.taken = rpm.into();
        self.rig.command(&Command::Speed(rpm)).map(drop)
    }

    /// Commands a q-axis current, A peak, which the drive may limit, unless the run has ended.
    ///
    /// # Errors
    /// If the drive refuses it.
    pub fn command_torque(&mut self, i_q: f64) -> Result<(), Error> {
        if self.has_ended {
            return Ok(());
        }
        let i_q = i_q as f32;
        self.taken = match self.rig.command(&Command::Torque(i_q))? {
            Accepted::Limited(taken) => taken.into(),
            Accepted::AsGiven => i_q.into(),
        };
        Ok(())
    }

    /// Returns the mean torque minus that of the accepted q-axis current, A, in the direction of the current and
    /// relative to the torque at the nominal limit.
    pub fn torque_error(&self, i_q: f64) -> f64 {
        let error = (self.torque.mean() - torque_nm(self.config, i_q)) * i_q.signum();
        error / torque_nm(self.config, nominal_limit_a(self.config))
    }

    /// Runs for some seconds, unless the run has ended. It ends as soon as the drive no longer regulates.
    pub fn watch(&mut self, seconds: f64) {
        for _ in 0..(seconds * RATE_HZ).round() as u64 {
            if self.has_ended {
                return;
            }
            let point = self.rig.point();
            if point.regulates {
                self.look(&point);
            } else {
                self.has_ended = true;
            }
        }
    }

    /// Judges a sample.
    fn look(&mut self, point: &Point) {
        let (error, share) = (point.angle_error_deg, point.flux / self.nominal_flux);
        self.error_deg = error;
        let wrong = error.abs() > self.wrong_deg;
        let flux_off = share < FLUX_OFF.0 || share > FLUX_OFF.1;
        let states = [wrong, error.abs() > LOST_DEG, flux_off];
        self.lasting.iter_mut().zip(states).for_each(|(lasting, is)| lasting.push(point.t, is));
        self.is_off = wrong || flux_off;
        if !self.turned {
            self.trial.largest_deg = self.trial.largest_deg.max(error.abs());
        }
        if self.counted_from.is_some_and(|from| point.t >= from) {
            self.trial.error.push(error);
            self.torque.push(point.torque);
            self.counts[(error.abs() * CLASSES_PER_DEG) as usize] += 1;
        }
        self.was_off |= self.is_off && (self.turned || self.counted_from.is_some());
    }

    /// Returns the result of the run, and its curves.
    pub fn finish(self) -> (Trial, Vec<Point>) {
        let (peak_a, dc_link_v) = (self.rig.peak_a, self.rig.dc_link_v);
        let mut trial = Trial { peak_a, dc_link_v, ..self.trial };
        let stopped = self.has_ended && trial.refused.is_none();
        if let (true, State::Fault(fault)) = (stopped, self.rig.drive.state()) {
            trial.trip = Some(fault.code());
            trial.sound_stop = !self.was_off;
        }
        [trial.wrong_s, trial.lost_s, trial.flux_off_s] = self.lasting.map(|state| state.longest);
        trial.stuck = !stopped && self.is_off && trial.is_silent();
        let classes = (0..).zip(self.counts).filter(|(_, count)| *count > 0);
        trial.histogram = classes.collect();
        (trial, self.rig.trace.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_lasts_over_short_interruptions_only() {
        let mut lasting = Lasting::default();
        let mut at = |from: f64, to: f64, is: bool| {
            (0..((to - from) * 1e3).round() as u32)
                .for_each(|n| lasting.push(from + f64::from(n) * 1e-3, is));
            lasting.longest
        };
        assert!((at(0.0, 0.2, true) - 0.199).abs() < 1e-9);
        at(0.2, 0.29, false);
        // Interrupted for 0.09 s: one stretch from 0 on.
        assert!((at(0.29, 0.4, true) - 0.399).abs() < 1e-9);
        at(0.4, 0.6, false);
        // Interrupted for 0.2 s: a new stretch, which is shorter.
        assert!((at(0.6, 0.9, true) - 0.399).abs() < 1e-9);
        assert!((at(0.9, 1.2, true) - 0.599).abs() < 1e-9);
    }
}
