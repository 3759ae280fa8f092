//! Commissioning: from the nameplate to the parameters of the motor, at standstill, without a sensor on the shaft.
//!
//! [`Commissioning`] is a state machine for the main loop. It never touches the hardware: it asks for an
//! [`Excitation`], the drive applies it in its interrupt, a [`Collector`] keeps sums of what the drive saw, and the
//! commissioning evaluates them, step by step.
//!
//! ```no_run
//! use drive_core::commission::{Collector, Commissioning, Next, Step};
//! use drive_core::{Command, Drive, Mode, Settings, Stop};
//!
//! # fn one_period(drive: &mut Drive) {}
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = Settings::default();
//! let (mut drive, mut collector) = (Drive::new(settings.build()?), Collector::default());
//! let mut commissioning = Commissioning::new(&settings);
//! commissioning.start(Step::Nameplate, Step::Leakage);
//! loop {
//!     one_period(&mut drive); // in the interrupt: `Drive::step`
//!     if drive.excites() {
//!         let seen = drive.telemetry();
//!         collector.push(seen.measured, seen.realised, seen.dc_link);
//!     }
//!     match commissioning.poll(&drive.excited(), &mut collector) {
//!         Next::Wait => {}
//!         Next::Excite(excitation) => drop(drive.command(&Command::Excite(excitation))?),
//!         Next::Stop => drop(drive.command(&Command::Stop(Stop::Coast))?),
//!         Next::Start => drop(drive.command(&Command::Start(Mode::Torque))?),
//!         Next::Torque(i_q) => drop(drive.command(&Command::Torque(i_q))?),
//!         Next::Design => commissioning.design(), // takes long
//!         Next::Report(report) => report.values.iter().flatten().for_each(|value| println!("{value}")),
//!         Next::Done => break,
//!     }
//! }
//! let found = commissioning.settings(&settings); // for `Command::Configure`
//! # Ok(()) }
//! ```
//!
//! The sensors' common gain error and that of the dc link cannot be seen: resistances and inductances carry them. Nor can
//! two phases that are exchanged between sensors and motor: such a motor turns the other way.

mod collector;
mod fit;
mod found;
mod inertia;
mod leakage;
mod levels;
mod loop_check;
mod motion;
mod plant;
mod plant_fit;
mod plate;
mod report;
mod staircase;
mod steps;
#[cfg(test)]
mod tests;

use crate::drive::{Excitation, Excited, State};
use crate::io::PERIOD_S;
use crate::settings::{Motor, Settings};
use crate::tuning::{CurrentLoopDesign, FirstOrder, TuningError, design_current_loop, motor_plant};

pub use collector::{BINS, Bin, Collector, Record};
pub use found::{Found, Iron, Leakage, Levels};
pub use report::{Meaning, Quantity, Refusal, Report, Step};

use fit::{Fitted, Search};
use inertia::Swings;
use plate::Plate;
use staircase::Staircase;

/// The next action that the commissioning asks for.
// A report is passed once a step.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Nothing: poll again, after a millisecond or so.
    Wait,
    /// Give the drive [`Command::Excite`](crate::Command::Excite).
    Excite(Excitation),
    /// Give the drive [`Command::Stop`](crate::Command::Stop).
    Stop,
    /// Give the drive [`Command::Start`](crate::Command::Start) in torque mode: the shaft is going to turn.
    Start,
    /// Give the drive [`Command::Torque`](crate::Command::Torque), A.
    Torque(f32),
    /// Call [`design`](Commissioning::design). The drive is off.
    Design,
    /// A step has ended.
    Report(Report),
    /// All steps have ended, or one was refused. The drive is off.
    Done,
}

/// The commissioning: what it does, and what it has found.
#[derive(Clone, Debug)]
pub struct Commissioning {
    setup: Setup,
    found: Found,
    /// The present step, and the last.
    step: Step,
    last: Step,
    /// Part of the step, and the samples that it waits for.
    part: u8,
    until: u32,
    progress: Progress,
    /// Whether the drive has left the state off, and its starts before that.
    on: bool,
    starts: Option<u32>,
    /// Whether a step was refused since the last start of steps.
    refused: bool,
    /// Pulses of the present train, and trains before it.
    pulses: (f32, u32),
    search: Option<Search>,
    /// Fit of the levels, gain mismatch, and misfit, until the third level confirms them.
    fitted: (Fitted, f32, Option<Quantity>),
    /// The current loop along and across, once it is designed in its step, and the plants it is to be designed for.
    design: Option<Result<[CurrentLoopDesign; 2], TuningError>>,
    plants: [FirstOrder; 2],
    stairs: Staircase,
    swings: Swings,
    /// Inductances along and across at each bias, H.
    inductances: [[f32; 2]; 2],
}

/// Values from the settings.
#[derive(Clone, Copy, Debug)]
struct Setup {
    plate: Result<Plate, Refusal>,
    /// Time constant of the analog filter of the currents, control periods.
    filter: f32,
    /// Margin for noise of the pulses, A, and their largest voltage, V.
    pulse_noise: f32,
    pulse_v: f32,
    /// Dead time as a share of the control period.
    dead_time: f32,
    /// Nominal dc link, V.
    dc_link: f32,
    /// Rated current, and limit of the torque current, A peak.
    rated: f32,
    i_q_limit: f32,
    /// Torque per torque current, Nm/A, and pole pairs, in force.
    torque_per_ampere: f32,
    pole_pairs: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Steps,
    /// Stop the drive, then design the current loop.
    StopToDesign,
    StoppingToDesign,
    /// Stop the drive.
    Stop,
    Stopping,
    Ended,
}

impl Commissioning {
    /// A commissioning of the motor with the nameplate, on the board, of these settings. Nothing is begun.
    pub fn new(settings: &Settings) -> Self {
        Self {
            setup: Setup {
                plate: Plate::new(settings),
                filter: settings.scales.current_delay_s / PERIOD_S,
                pulse_noise: settings.share_of_range(0.05),
                pulse_v: settings.share_of_dc_link(60.0),
                dead_time: settings.inverter.dead_time_s / PERIOD_S,
                dc_link: settings.inverter.dc_link_v,
                rated: settings.rated_a(),
                i_q_limit: settings.i_q_limit_a(),
                torque_per_ampere: settings.motor.torque_per_ampere(settings.i_d()),
                pole_pairs: f32::from(settings.motor.pole_pairs),
            },
            found: Found::default(),
            step: Step::Nameplate,
            last: Step::Nameplate,
            part: 0,
            until: 0,
            progress: Progress::Ended,
            on: false,
            starts: None,
            refused: false,
            pulses: (0.0, 0),
            search: None,
            fitted: (Fitted::default(), 0.0, None),
            design: None,
            plants: [FirstOrder { k: 0.0, p: 0.0 }; 2],
            stairs: Staircase::default(),
            swings: Swings::default(),
            inductances: [[0.0; 2]; 2],
        }
    }

    /// Begins the steps from `first` to `last`; the drive must be off. What earlier steps have found is kept until
    /// they are repeated.
    pub fn start(&mut self, first: Step, last: Step) {
        (self.step, self.last, self.progress, self.on) = (first, last, Progress::Steps, false);
        (self.part, self.until, self.design) = (0, 0, None);
        (self.starts, self.refused) = (None, false);
    }

    /// Whether steps are being done.
    pub fn is_running(&self) -> bool {
        self.progress != Progress::Ended
    }

    /// Whether no step was refused since the last [`start`](Self::start).
    pub fn is_sound(&self) -> bool {
        !self.refused
    }

    /// The present step, or the last that was done.
    pub fn step(&self) -> Step {
        self.step
    }

    /// The results so far.
    pub fn found(&self) -> &Found {
        &self.found
    }

    /// The settings with what has been found in them; equal to `settings` where nothing has, or where the last steps ended
    /// with a refusal.
    pub fn settings(&self, settings: &Settings) -> Settings {
        if self.refused {
            return *settings;
        }
        let pole_pairs = self.setup.plate.map(|plate| plate.pole_pairs);
        self.found.settings(settings, pole_pairs.unwrap_or(settings.motor.pole_pairs))
    }

    /// Goes on. `drive` is what the drive says of itself, [`Drive::excited`](crate::Drive::excited).
    pub fn poll(&mut self, drive: &Excited, sums: &mut Collector) -> Next {
        match self.progress {
            Progress::Ended => return Next::Done,
            Progress::Stop | Progress::Stopping => {
                if matches!(drive.state, State::Off | State::Fault(_)) {
                    self.progress = Progress::Ended;
                    return Next::Done;
                }
                let first = self.progress == Progress::Stop;
                self.progress = Progress::Stopping;
                return if first { Next::Stop } else { Next::Wait };
            }
            Progress::StopToDesign => {
                self.progress = Progress::StoppingToDesign;
                return Next::Stop;
            }
            Progress::StoppingToDesign if drive.state == State::Off => return Next::Design,
            Progress::StoppingToDesign if drive.state == State::Exciting => return Next::Wait,
            Progress::StoppingToDesign | Progress::Steps => {}
        }
        let before = *self.starts.get_or_insert(drive.starts);
        self.on |= drive.state != State::Off || drive.starts != before;
        let excites = match drive.state {
            State::Off => !self.on,
            State::Calibrating | State::Precharge | State::CheckingWiring => true,
            State::Exciting => self.step != Step::Inertia,
            State::Catching | State::Magnetising | State::Verifying | State::Torque => {
                self.step == Step::Inertia
            }
            _ => false,
        };
        let result = if !excites {
            Err(Refusal::Drive(drive.state))
        } else if sums.is_incomplete() {
            Err(Refusal::SamplesLost)
        } else if sums.samples() < self.until {
            return Next::Wait;
        } else {
            self.go_on(drive, sums)
        };
        match result {
            Ok(Next::Report(report)) => {
                if self.step < self.last {
                    self.next_step();
                } else {
                    self.progress = Progress::Stop;
                }
                Next::Report(report)
            }
            Ok(next) => next,
            Err(refusal) => Next::Report(self.refuse(refusal)),
        }
    }

    /// Designs the current loop for the motor that was found, or for the plants that the present step has identified. It takes
    /// as long as [`Settings::build`]: a second on the target, so the drive must be off.
    pub fn design(&mut self) {
        self.design = self.found.motor(&Motor::default()).map(|motor| {
            let period_s = f64::from(PERIOD_S);
            let plant = motor_plant(&motor.circuit(), period_s)?;
            let designed = |identified| design_current_loop(identified, plant, period_s);
            if self.step == Step::Plant {
                let [d, q] = self.plants;
                return Ok([designed(d)?, designed(q)?]);
            }
            designed(plant).map(|design| [design; 2])
        });
        (self.progress, self.on, self.starts) = (Progress::Steps, false, None);
    }

    /// Ends the present step, which is refused, and stops the drive.
    pub fn refuse(&mut self, refusal: Refusal) -> Report {
        (self.progress, self.refused) = (Progress::Stop, true);
        Report { refusal: Some(refusal), ..Report::new(self.step, []) }
    }

    fn next_step(&mut self) {
        self.step = match self.step {
            Step::Nameplate => Step::Sensors,
            Step::Sensors => Step::Wiring,
            Step::Wiring => Step::Levels,
            Step::Levels => Step::Leakage,
            Step::Leakage if self.found.levels.is_some_and(|levels| levels.saturates) => {
                Step::Staircase
            }
            Step::Leakage => Step::CurrentLoop,
            Step::Staircase => Step::CurrentLoop,
            Step::CurrentLoop if self.last == Step::Plant => Step::Plant,
            Step::CurrentLoop | Step::Plant | Step::Inertia => Step::Inertia,
        };
        (self.part, self.until, self.design) = (0, 0, None);
    }
}
