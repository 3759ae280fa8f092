//! A drive and a plant in a run, with the quantities that are observed.

use super::kind::{nominal_limit_a, share_of_limit, torque_nm};
use super::trial::{CLASSES_PER_DEG, LARGEST_CLASS, Refused, Trial};
use crate::experiments::course::{Change, Part, Shaft};
use crate::plant::{Complex, Plant};
use crate::prelude::*;

/// Error beyond which the angle is wrong, degrees, unless the run sets another limit.
const WRONG_DEG: f64 = 30.0;
/// Limits of the flux relative to its nominal value: it is off below the first and above the second.
const FLUX_OFF: (f64, f64) = (0.5, 2.0);
/// Longest interruption over which a state is regarded as continuing, s: an angle that runs through is right now and then.
const GAP_S: f64 = 0.1;

/// Longest start, s.
pub const LONGEST_START_S: f64 = 30.0;
/// Step time and acceleration of the dynamometer that brings a shaft up to speed, s and rpm/s, and the time after it, s.
const PACE_S: f64 = 0.01;
const RAMP_RPM_PER_S: f64 = 600.0;
const AT_SPEED_S: f64 = 0.3;
/// Number of periods between two recorded moments: 5 ms.
const TRACE_EVERY: u64 = 30;

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

/// A recorded moment of a run.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time, s.
    pub t: f64,
    /// Angle error while the drive regulates, degrees.
    pub error_deg: f64,
    /// Speed of the shaft, rpm.
    pub rpm: f64,
    /// Torque of the motor, Nm.
    pub torque: f64,
    /// Magnitude of the stator current, A peak.
    pub current: f64,
    /// Rotor flux of the motor from phase a, Wb peak.
    pub flux: Complex,
    /// The dc link, V.
    pub dc_link: f64,
}

/// A drive and a plant, with the quantities that are observed.
pub struct Bench<'a> {
    /// Drive and plant.
    pub rig: Rig,
    /// Configuration of the plant, which scales currents, speeds and torques.
    pub config: &'a Config,
    shaft: Shaft,
    /// Quantity that the drive regulates.
    mode: Mode,
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
    /// The curves of the run, if requested.
    pub trace: Option<Vec<Moment>>,
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
        let (load, mode) = match shaft {
            Shaft::Locked => (Load::Locked, Mode::Torque),
            Shaft::Held(_) => (Load::Speed { speed: 0.0 }, Mode::Torque),
            Shaft::Free => (Load::Free { torque: 0.0 }, Mode::Speed),
        };
        settings.mechanics.load = load;
        let mut plant = Plant::new(&settings, seed).map_err(Error::refused)?;
        plant.set_open_phase(open_phase(config)).map_err(Error::refused)?;
        let dc_link_v = (settings.inverter.vdc, settings.inverter.vdc);
        Ok(Self {
            rig: Rig::of(plant, drive.clone()),
            config,
            shaft,
            mode,
            nominal_flux: settings.machine.lm * f64::from(config.drive.i_d()),
            counted_from: None,
            torque: Stats::default(),
            trial: Trial { seed, dc_link_v, ..Trial::default() },
            taken: 0.0,
            error_deg: 0.0,
            wrong_deg: WRONG_DEG,
            trace: None,
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
        bench.start();
        bench.bring_up()?;
        Ok(bench)
    }

    /// Time from the beginning, s.
    pub fn time(&self) -> f64 {
        self.rig.time()
    }

    /// Runs one period.
    fn step(&mut self) {
        let (t, is_recorded) = (self.time(), self.rig.periods().is_multiple_of(TRACE_EVERY));
        self.rig.step();
        let (plant, seen) = (&self.rig.plant, &mut self.trial);
        seen.peak_a = plant.phase_currents().iter().fold(seen.peak_a, |a, i| a.max(i.abs()));
        let (least, most) = seen.dc_link_v;
        let v = plant.dc_link();
        seen.dc_link_v = (least.min(v), most.max(v));
        if let Some(trace) = self.trace.as_mut().filter(|_| is_recorded) {
            let regulates = self.rig.drive.state().regulates();
            trace.push(Moment {
                t,
                error_deg: if regulates { self.error_deg } else { f64::NAN },
                rpm: self.rig.rpm(),
                torque: plant.torque(),
                current: plant.current().norm(),
                flux: plant.rotor_flux(),
                dc_link: v,
            });
        }
    }

    /// Runs for some seconds, whatever the drive does.
    pub fn coast(&mut self, seconds: f64) {
        (0..(seconds * RATE_HZ).round() as u64).for_each(|_| self.step());
    }

    /// Runs until the drive is off, stopped by a fault or regulating, or for this many seconds.
    pub fn wait(&mut self, seconds: f64) -> State {
        for _ in 0..(seconds * RATE_HZ) as u64 {
            self.step();
            let state = self.rig.drive.state();
            if state.regulates() || state.is_off() {
                break;
            }
        }
        self.rig.drive.state()
    }

    /// Starts, and waits until the drive regulates. If it does not, the run has ended.
    pub fn start(&mut self) {
        let refused = match self.rig.command(&Command::Start(self.mode)) {
            Err(why) => Refused::Otherwise(why.to_string()),
            Ok(_) => match self.wait(LONGEST_START_S) {
                state if state.regulates() => return,
                State::Fault(fault) => Refused::Start(fault.code()),
                other => Refused::Otherwise(format!("the drive is {other}")),
            },
        };
        (self.trial.refused, self.has_ended) = (Some(refused), true);
    }

    /// Brings a held shaft up to speed without torque.
    ///
    /// # Errors
    /// If the speed is out of range.
    pub fn bring_up(&mut self) -> Result<(), Error> {
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
        self.counted_from = Some(self.time() + seconds);
    }

    /// Runs the parts.
    ///
    /// # Errors
    /// If the plant refuses a change, or the drive a reference.
    pub fn follow(&mut self, parts: &[Part]) -> Result<(), Error> {
        for part in parts {
            if self.mode == Mode::Speed {
                self.rig.set_load(Load::Free { torque: part.load_nm })?;
            }
            let steps = f64::from(part.steps());
            for n in 1..=part.steps() {
                if self.has_ended {
                    return Ok(());
                }
                let n = f64::from(n);
                self.change(part.change, n, steps)?;
                if let Some(reference) = part.reference {
                    self.command(reference.after(n, steps))?;
                }
                self.watch(part.seconds / steps);
            }
        }
        Ok(())
    }

    /// Makes a change, as far as it is in this one of all steps.
    fn change(&mut self, change: Change, n: f64, steps: f64) -> Result<(), Error> {
        let (config, plant) = (self.config, &mut self.rig.plant);
        let done = match change {
            Change::Flux(degrees) if n == 1.0 => {
                // From now on the error is no longer counted, and the durations for which angle and flux are off start again.
                plant.turn_rotor_flux(degrees.to_radians());
                (self.turned, self.counted_from) = (true, None);
                self.lasting = Default::default();
                Ok(())
            }
            Change::Mains(volts) => plant.set_mains(volts),
            Change::Shaft(rpm) => {
                return self.rig.turn(config.rpm(rpm.after(n, steps)));
            }
            Change::DcLink(share) => {
                plant.set_dc_link(config.inverter.dc_link_v * share.after(n, steps))
            }
            Change::Warming(stator, rotor) => {
                let (machine, share) = (plant_settings(config).machine, n / steps);
                let warmer = |ohm: f64, rise: f64| ohm * (1.0 + rise * share);
                plant.set_resistances(warmer(machine.rs, stator), warmer(machine.rr, rotor))
            }
            Change::Nothing | Change::Flux(_) => Ok(()),
        };
        done.map_err(Error::refused)
    }

    /// Commands a reference of a part.
    fn command(&mut self, reference: f64) -> Result<(), Error> {
        match self.mode {
            Mode::Speed => {
                let rpm = self.config.rpm(reference) as f32;
                self.taken = rpm.into();
                self.rig.command(&Command::Speed(rpm)).map(drop)
            }
            _ => self.command_torque(share_of_limit(self.config, reference)),
        }
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
            let (t, plant) = (self.time(), &self.rig.plant);
            let (flux, torque) = (plant.rotor_flux(), plant.torque());
            self.step();
            let drive = &self.rig.drive;
            if !drive.state().regulates() {
                self.has_ended = true;
                return;
            }
            let estimate = f64::from(drive.telemetry().phi.to_turns());
            let error = wrapped_degrees(flux.arg() - estimate * TAU);
            let share = flux.norm() / self.nominal_flux;
            self.error_deg = error;
            let (wrong, flux_off) =
                (error.abs() > self.wrong_deg, share < FLUX_OFF.0 || share > FLUX_OFF.1);
            let states = [wrong, error.abs() > LOST_DEG, flux_off];
            self.lasting.iter_mut().zip(states).for_each(|(lasting, is)| lasting.push(t, is));
            self.is_off = wrong || flux_off;
            if !self.turned {
                self.trial.largest_deg = self.trial.largest_deg.max(error.abs());
            }
            if self.counted_from.is_some_and(|from| t >= from) {
                self.trial.error.push(error);
                self.torque.push(torque);
                self.counts[(error.abs() * CLASSES_PER_DEG) as usize] += 1;
            }
            self.was_off |= self.is_off && (self.turned || self.counted_from.is_some());
        }
    }

    /// Returns the result of the run, and its curves.
    pub fn finish(self) -> (Trial, Vec<Moment>) {
        let mut trial = self.trial;
        let stopped = self.has_ended && trial.refused.is_none();
        if let (true, State::Fault(fault)) = (stopped, self.rig.drive.state()) {
            trial.trip = Some(fault.code());
            trial.sound_stop = !self.was_off;
        }
        [trial.wrong_s, trial.lost_s, trial.flux_off_s] = self.lasting.map(|state| state.longest);
        trial.stuck = !stopped && self.is_off && trial.is_silent();
        let classes = (0..).zip(self.counts).filter(|(_, count)| *count > 0);
        trial.histogram = classes.collect();
        (trial, self.trace.unwrap_or_default())
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
