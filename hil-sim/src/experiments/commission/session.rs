//! A commissioning on the bench.

use std::f64::consts::TAU;

use drive_core::commission::{Collector, Commissioning, Next, Refusal, Report, Step};
use drive_core::settings::{Motor, Settings};
use drive_core::{Command, Mode, Sample, State};

use crate::config::Config;
use crate::error::Error;
use crate::rig::{RATE_HZ, Rig};

/// Control periods from one poll of the main loop to the next.
const POLL: u32 = 6;
/// Longest session, s.
const LONGEST_S: f64 = 100.0;

/// A session: what was reported, and what happened to the motor.
pub struct Session {
    /// The bench.
    pub rig: Rig,
    /// The commissioning at its end.
    pub commissioning: Commissioning,
    /// The reports, with the time at which each came, s.
    pub reports: Vec<(f64, Report)>,
    /// Time until the drive was off, s.
    pub seconds: f64,
    /// Largest turn of the shaft, mechanical degrees.
    pub shaft_deg: f64,
    /// Largest phase current, A.
    pub largest_a: f64,
}

/// Where a session is stopped from outside.
#[derive(Clone, Copy, Debug, Default)]
pub struct Abort {
    /// The step.
    pub step: Option<Step>,
    /// Control periods within it.
    pub after: u32,
}

impl Session {
    /// Runs the steps from `first` to `last`; `sensors` changes what they say.
    ///
    /// # Errors
    /// When the drive refuses a command, or the session does not end.
    pub fn run(
        mut rig: Rig,
        mut commissioning: Commissioning,
        (first, last): (Step, Step),
        abort: Abort,
        sensors: fn(&mut Sample),
    ) -> Result<Self, Error> {
        commissioning.start(first, last);
        let mut sums = Collector::default();
        let (mut reports, mut shaft_deg, mut largest_a) = (Vec::new(), 0.0_f64, 0.0_f64);
        let (began, mut in_step) = (rig.time(), 0);
        let from = rig.plant.mechanical_angle();
        for period in 0..(LONGEST_S * RATE_HZ) as u32 {
            let mut sample = rig.plant.sample();
            sensors(&mut sample);
            rig.step_with(&sample);
            if rig.drive.excites() {
                let seen = rig.drive.telemetry();
                sums.push(seen.measured, seen.realised, seen.dc_link);
            }
            if rig.drive.state().regulates() {
                let seen = rig.drive.telemetry();
                sums.push_motion(seen.reference.q, seen.rotor_freq);
            }
            let turned = (rig.plant.mechanical_angle() - from) * 360.0 / TAU;
            shaft_deg = shaft_deg.max(turned.abs());
            largest_a = rig.plant.phase_currents().iter().fold(largest_a, |m, i| m.max(i.abs()));
            if abort.step == Some(commissioning.step()) && rig.drive.state() != State::Off {
                in_step += 1;
                if in_step == abort.after {
                    rig.command(&Command::Stop)?;
                }
            }
            if !period.is_multiple_of(POLL) {
                continue;
            }
            match commissioning.poll(&rig.drive.excited(), &mut sums) {
                Next::Wait => {}
                Next::Excite(excitation) => {
                    rig.command(&Command::Excite(excitation))?;
                }
                Next::Stop => {
                    rig.command(&Command::Stop)?;
                }
                Next::Start => {
                    rig.command(&Command::Start(Mode::Torque))?;
                }
                Next::Torque(i_q) => {
                    rig.command(&Command::Torque(i_q))?;
                }
                Next::Design => commissioning.design(),
                Next::Report(report) => reports.push((rig.time() - began, report)),
                Next::Done => {
                    let seconds = rig.time() - began;
                    return Ok(Self { rig, commissioning, reports, seconds, shaft_deg, largest_a });
                }
            }
        }
        Err(Error::Refused(format!("the commissioning does not end in {LONGEST_S} s")))
    }

    /// Time until the last report of a step up to this one, s.
    pub fn until(&self, step: Step) -> f64 {
        let earlier = self.reports.iter().filter(|(_, report)| report.step <= step);
        earlier.map(|(at, _)| *at).fold(0.0, f64::max)
    }

    /// Why it was refused.
    pub fn refusal(&self) -> Option<(Step, Refusal)> {
        let refused = |(_, report): &(f64, Report)| Some((report.step, report.refusal?));
        self.reports.iter().find_map(refused)
    }
}

/// The settings of a drive that knows its nameplate, but not its motor.
pub fn unaware(config: &Config) -> Settings {
    Settings { motor: Motor::default(), ..config.drive }
}
