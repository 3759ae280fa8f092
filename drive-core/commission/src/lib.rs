//! Commissioning: from the nameplate to the parameters of the motor, at standstill, without a sensor on the shaft.
//!
//! [`Commissioning`] is a state machine for the main loop. It never touches the hardware. It asks for a
//! [`TestSignal`], which the drive applies in its interrupt; a [`Collector`] sums the measurements of the drive,
//! and the commissioning evaluates the sums, step by step.
//!
//! ```no_run
//! use induction_drive_commission::{Collector, Commissioning, Next, Step};
//! use induction_drive_core::{Command, Drive, Mode, Stop};
//! use induction_drive_settings::Settings;
//!
//! # fn one_period(drive: &mut Drive) {}
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = Settings::default();
//! let (mut drive, mut collector) = (Drive::new(settings.build()?), Collector::default());
//! let mut commissioning = Commissioning::new(&settings);
//! commissioning.start(Step::Nameplate, Step::Leakage);
//! loop {
//!     one_period(&mut drive); // in the interrupt: `Drive::step`
//!     if drive.is_testing() {
//!         let seen = drive.telemetry();
//!         collector.push(seen.measured, seen.realised, seen.dc_link);
//!     }
//!     match commissioning.poll(&drive.test_report(), &mut collector) {
//!         Next::Wait => {}
//!         Next::Excite(excitation) => drop(drive.command(&Command::Test(excitation))?),
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
//! The common gain error of the current sensors and the gain error of the dc link cannot be seen: resistances and
//! inductances are off by them. Two phases that are exchanged between sensors and motor cannot be seen either: such a
//! motor turns the other way.
#![cfg_attr(not(test), no_std)]

extern crate induction_drive_core as drive_core;
extern crate induction_drive_rotor_id as rotor_id;
extern crate induction_drive_settings as drive_settings;

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

use drive_core::{
    AlphaBeta, FirstOrder, PERIOD_S, Regulator, State, TestReport, TestSignal, periods,
};
use drive_settings::Settings;
use drive_settings::tuning::{CurrentLoopDesign, TuningError, design_current_loop, motor_plant};
use drive_settings::value::Words as _;
use num_complex::Complex32;

pub use collector::{BINS, Bin, Collector, Record};
pub use found::{Found, Leakage, Levels};
pub use plate::{check_motor, check_nameplate};
pub use report::{Meaning, Quantity, Refusal, Report, Step};

use fit::{Fitted, Search};
use inertia::Trial;
use plate::Plate;
use report::{SIZE, TIME};
use staircase::Staircase;
use steps::QUIET_S;

/// Share of the rough inductance for which the current controller is designed, the gain per inductance of the controller, and its
/// zero, rad/s.
const CAUTION: f32 = 0.75;
const GAIN_RAD_PER_S: f32 = 500.0;
const ZERO_RAD_PER_S: f32 = 167.0;

/// The next action that the commissioning asks for.
///
/// Exhaustive on purpose, since every action has to be carried out.
// The size does not matter, since a report is passed once a step.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Do nothing and poll again, after about a millisecond.
    Wait,
    /// Give the drive [`Command::Test`](drive_core::Command::Test).
    Excite(TestSignal),
    /// Give the drive [`Command::Stop`](drive_core::Command::Stop).
    Stop,
    /// Give the drive [`Command::Start`](drive_core::Command::Start) in torque mode: the shaft is going to turn.
    Start,
    /// Give the drive [`Command::Torque`](drive_core::Command::Torque), A.
    Torque(f32),
    /// Call [`design`](Commissioning::design). The drive is off.
    Design,
    /// A step has ended.
    Report(Report),
    /// All steps have ended, or one was refused. The drive is off.
    Done,
}

/// The next request of a step.
type Answer = Result<Next, Refusal>;

/// A part of a step: the kind of record, its time, s, and the test signal.
type Part = (Record, f32, TestSignal);

/// The commissioning: the present step with its state, and the results.
#[derive(Clone, Debug)]
pub struct Commissioning {
    plate: Plate,
    found: Found,
    /// Inductances along and across phase a at each bias of the step `leakage`, H, which the magnetising-curve test also needs.
    inductances: [[f32; 2]; 2],
    /// Present step, and last step to be done.
    step: Step,
    last: Step,
    state: StepState,
    progress: Progress,
    /// Whether the drive has left the state off, and the number of its starts before that.
    on: bool,
    starts: Option<u32>,
    /// Whether a step was refused since the last [`Commissioning::start`].
    refused: bool,
}

/// State of the present step. Every step begins with the default.
#[derive(Clone, Debug, Default)]
struct StepState {
    /// Next part of the step, and the number of samples that it waits for.
    part: usize,
    until: u32,
    search: Option<Search>,
    /// Current loop along and across phase a, once it is designed.
    design: Option<Result<[CurrentLoopDesign; 2], TuningError>>,
    /// Wiring: volt-seconds of the present train of pulses, V s, and number of the trains before it.
    volt_seconds: f32,
    trains: u32,
    /// Levels: fit to the first two levels.
    fitted: Fitted,
    /// Leakage: phasors of the injection along the present bias, and relative difference of the sensors' gains.
    along: [Complex32; 4],
    gains: Complex32,
    stairs: Staircase,
    /// Plants along and across phase a for which the current loop is to be designed.
    plants: [Option<FirstOrder>; 2],
    /// Inertia: the trial of the free shaft.
    trial: Trial,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Steps,
    /// The drive is to be stopped, then the current loop designed.
    StopToDesign,
    StoppingToDesign,
    /// Stop the drive.
    Stop,
    Stopping,
    Ended,
}

impl Commissioning {
    /// Creates the commissioning for the motor with the nameplate in these settings, on the board that they describe. No step is
    /// begun.
    pub fn new(settings: &Settings) -> Self {
        Self {
            plate: Plate::new(settings),
            found: Found::default(),
            inductances: [[0.0; 2]; 2],
            step: Step::Nameplate,
            last: Step::Nameplate,
            state: StepState::default(),
            progress: Progress::Ended,
            on: false,
            starts: None,
            refused: false,
        }
    }

    /// Begins the steps from `first` to `last`; the drive must be off. The results of earlier steps are kept until
    /// the steps are repeated.
    pub fn start(&mut self, first: Step, last: Step) {
        (self.step, self.last, self.state) = (first, last, StepState::default());
        (self.progress, self.on, self.starts) = (Progress::Steps, false, None);
        self.refused = false;
    }

    /// Whether steps are being done.
    pub fn is_running(&self) -> bool {
        self.progress != Progress::Ended
    }

    /// Whether all steps since the last [`start`](Self::start) have passed.
    pub fn is_sound(&self) -> bool {
        !self.refused
    }

    /// Returns the present step, or the last step that was done.
    pub fn step(&self) -> Step {
        self.step
    }

    /// Returns the results so far.
    pub fn found(&self) -> &Found {
        &self.found
    }

    /// Returns the settings with the results in them. They are equal to `settings` if there are no results, or if the last
    /// steps ended with a refusal.
    pub fn settings(&self, settings: &Settings) -> Settings {
        if self.refused { *settings } else { self.found.settings(settings, self.plate.pole_pairs) }
    }

    /// Continues the commissioning and returns its next request. `drive` is [`Drive::test_report`](drive_core::Drive::test_report).
    #[inline(never)] // inlined into `main`, it would lie in the flash bank of the interrupt's code
    pub fn poll(&mut self, drive: &TestReport, sums: &mut Collector) -> Next {
        let (progress, next) = match (self.progress, drive.state) {
            (Progress::Ended, _)
            | (Progress::Stop | Progress::Stopping, State::Off | State::Fault(_)) => {
                (Progress::Ended, Next::Done)
            }
            (Progress::Stop, _) => (Progress::Stopping, Next::Stop),
            (Progress::StopToDesign, _) => (Progress::StoppingToDesign, Next::Stop),
            (Progress::StoppingToDesign, State::Off) => (self.progress, Next::Design),
            (Progress::Stopping, _) | (Progress::StoppingToDesign, State::Exciting) => {
                (self.progress, Next::Wait)
            }
            (Progress::StoppingToDesign | Progress::Steps, _) => {
                let next = self.go_on(drive, sums);
                return next.unwrap_or_else(|refusal| Next::Report(self.refuse(refusal)));
            }
        };
        self.progress = progress;
        next
    }

    /// Designs the current loop for the motor that was found, or for the plants that the present step has identified. The
    /// drive must be off, since the design takes as long as [`Settings::build`], a second on the target.
    pub fn design(&mut self) {
        self.state.design = self.found.motor().map(|motor| {
            let period_s = f64::from(PERIOD_S);
            let plant = motor_plant(&motor.into(), period_s)?;
            let designed = |identified| design_current_loop(identified, plant, period_s);
            if let [Some(d), Some(q)] = self.state.plants {
                return Ok([designed(d)?, designed(q)?]);
            }
            designed(plant).map(|design| [design; 2])
        });
        (self.progress, self.on, self.starts) = (Progress::Steps, false, None);
    }

    /// Ends the present step with a refusal, and stops the drive.
    pub fn refuse(&mut self, refusal: Refusal) -> Report {
        (self.progress, self.refused) = (Progress::Stop, true);
        Report { refusal: Some(refusal), ..Report::new(self.step, &[]) }
    }

    /// Returns the next action of the present step, once the samples of its part have been taken.
    fn go_on(&mut self, drive: &TestReport, sums: &mut Collector) -> Answer {
        let before = *self.starts.get_or_insert(drive.starts);
        self.on |= drive.state != State::Off || drive.starts != before;
        let turns = self.step == Step::Inertia;
        let excites = match drive.state {
            State::Off => !self.on,
            State::Calibrating | State::Precharge | State::CheckingWiring => true,
            State::Exciting => !turns,
            State::FlyingStart | State::Magnetising | State::Verifying | State::Torque => turns,
            _ => false,
        };
        match self.step {
            _ if !excites => Err(Refusal::Drive(drive.state)),
            _ if sums.recorded.incomplete => Err(Refusal::SamplesLost),
            _ if sums.recorded.samples < self.state.until => Ok(Next::Wait),
            _ if let Some(entry) = self.plate.implausible => Err(Refusal::Plate(entry)),
            Step::Nameplate => self.report(&self.plate.values()),
            Step::Sensors => self.sensors(drive, sums),
            Step::Wiring => self.wiring(drive, sums),
            Step::Levels => self.levels(sums),
            Step::Leakage => self.leakage(sums),
            Step::Staircase => self.staircase(sums),
            Step::CurrentLoop => self.current_loop(sums),
            Step::Plant => self.plant(sums),
            Step::Inertia => self.inertia(drive, sums),
        }
    }

    /// Begins a part of the present step.
    fn begin(&mut self, sums: &mut Collector, (record, seconds, excitation): Part) -> Answer {
        sums.begin(record);
        self.state.until = periods(seconds);
        self.state.part += 1;
        Ok(Next::Excite(excitation))
    }

    /// Ends the present step with these values.
    fn report(&mut self, values: &[Quantity]) -> Answer {
        let report = Report::new(self.step, values);
        if self.step < self.last {
            let saturates = self.found.levels.is_some_and(|levels| levels.saturates);
            self.step = match self.step {
                Step::Leakage if !saturates => Step::CurrentLoop,
                Step::CurrentLoop if self.last != Step::Plant => Step::Inertia,
                step => Step::at(step.place() + 1),
            };
            self.state = StepState::default();
        } else {
            self.progress = Progress::Stop;
        }
        Ok(Next::Report(report))
    }

    /// Makes one fit to the recorded bins, which began with the flux of the current `steady`, A. Returns the result after the last
    /// fit.
    fn search(&mut self, sums: &mut Collector, steady: f32) -> Result<Option<Fitted>, Refusal> {
        if let Some(search) = &mut self.state.search {
            return search.step(sums);
        }
        sums.begin(Record::Nothing);
        (self.state.search, self.state.until) =
            (Some(Search::new(steady, self.step == Step::Staircase)), 0);
        Ok(None)
    }

    /// Returns the current loop along and across phase a; none while the drive has to stop for the design.
    fn designed(&mut self) -> Result<Option<[CurrentLoopDesign; 2]>, Refusal> {
        if self.state.design.is_none() {
            self.progress = Progress::StopToDesign;
        }
        self.state.design.transpose().map_err(Refusal::Design)
    }

    /// Returns the transient inductance from the pulses, H, reduced for safety.
    fn rough(&self) -> Result<f32, Refusal> {
        Ok(CAUTION * self.found.rough.ok_or(Refusal::Needs(Step::Wiring))?)
    }

    /// Returns a cautious current controller.
    fn regulator(&self) -> Result<Regulator, Refusal> {
        let (k_c, z_c) = (GAIN_RAD_PER_S * self.rough()?, 1.0 - ZERO_RAD_PER_S * PERIOD_S);
        Ok(Regulator { k_c, z_c, ..Regulator::default() })
    }

    /// Returns the test signal for a share of the test current along phase a.
    fn along(&self, share: f32, regulator: Regulator) -> TestSignal {
        let (amperes, carrier) = (share * self.plate.amperes, AlphaBeta::ZERO);
        TestSignal::Current { amperes, regulator, carrier, binary: false }
    }
}
