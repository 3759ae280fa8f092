//! A commissioning on the bench.

use drive_commission::{Collector, Commissioning, Next, Refusal, Report, Step};
use drive_core::{AlphaBeta, Motor, Sample, TestSignal};

use crate::experiments::drawn_machine::Circuit;
use crate::plant::Complex;
use crate::prelude::*;

/// Number of control periods between two polls of the main loop.
const POLL: u32 = 6;
/// Longest session, s.
const LONGEST_S: f64 = 100.0;

/// A session: its reports, and the effects on the motor.
pub struct Session {
    /// The bench.
    pub rig: Rig,
    /// The commissioning at its end.
    pub commissioning: Commissioning,
    /// The reports, each with its time, s.
    pub reports: Vec<(f64, Report)>,
    /// Time until the drive was off, s.
    pub seconds: f64,
    /// Largest rotation of the shaft, mechanical degrees.
    pub shaft_deg: f64,
    /// Transient inductance of a motor with saturation at the operating points of the injection, mean along and across it, H.
    pub leakage: Option<f64>,
}

/// Transient inductance of a motor at its present currents, along and across phase a, H.
fn transient(plant: &Plant) -> [f64; 2] {
    let rest = plant.current_rate(Complex::ZERO);
    let along = plant.current_rate(Complex::ONE) - rest;
    let across = plant.current_rate(Complex::I) - rest;
    [1.0 / along.re, 1.0 / across.im]
}

/// Influences on a session from outside.
pub struct Outside {
    /// Changes the bench before the session.
    pub on_bench: fn(&mut Rig),
    /// Changes the sensor readings.
    pub sensors: fn(&mut Sample),
    /// Step in which the session is stopped, and the control periods from the beginning of the step to the stop.
    pub abort: Option<(Step, u32)>,
}

impl Outside {
    /// No influence.
    pub const NONE: Self = Self { on_bench: |_| {}, sensors: |_| {}, abort: None };
}

impl Session {
    /// Runs all steps at standstill for the motor of this configuration, with a drive that knows its nameplate.
    ///
    /// # Errors
    /// If the plant is refused, the drive refuses a command, or the session does not end.
    pub fn run(config: &Config, seed: u64, outside: &Outside) -> Result<Self, Error> {
        let settings = unaware(config);
        let mut unlearned = Config { drive: settings, ..config.clone() };
        unlearned.prepare.learn = false;
        let mut rig = Rig::from_config(&unlearned, seed)?;
        (outside.on_bench)(&mut rig);
        let mut commissioning = Commissioning::new(&settings);
        commissioning.start(Step::Nameplate, Step::LAST);
        let mut sums = Collector::default();
        let (mut reports, mut shaft_deg) = (Vec::new(), 0.0_f64);
        let (began, mut in_step) = (rig.time(), 0);
        let from = rig.plant.mechanical_angle();
        let mut carrier_on = AlphaBeta::ZERO;
        let mut leakage = [Stats::default(); 2];
        let order = |rig: &mut Rig, command| rig.command(&command).map(|_| ());
        for period in 0..(LONGEST_S * RATE_HZ) as u32 {
            let mut sample = rig.plant.sample();
            (outside.sensors)(&mut sample);
            rig.step_with(&sample);
            let seen = rig.drive.telemetry();
            if rig.drive.is_testing() {
                sums.push(seen.measured, seen.realised, seen.dc_link);
            }
            if rig.drive.state().regulates() {
                sums.push_motion(seen.reference.q, seen.rotor_freq);
            }
            let turned = (rig.plant.mechanical_angle() - from) * 360.0 / TAU;
            shaft_deg = shaft_deg.max(turned.abs());
            let aborted = outside.abort.filter(|(step, _)| *step == commissioning.step());
            if let Some((_, after)) = aborted.filter(|_| rig.drive.state() != State::Off) {
                in_step += 1;
                if in_step == after {
                    order(&mut rig, Command::Stop(Stop::Coast))?;
                }
            }
            if commissioning.step() == Step::Leakage && carrier_on != AlphaBeta::ZERO {
                let axis = usize::from(carrier_on.beta != 0.0);
                leakage[axis].push(transient(&rig.plant)[axis]);
            }
            if !period.is_multiple_of(POLL) {
                continue;
            }
            match commissioning.poll(&rig.drive.test_report(), &mut sums) {
                Next::Wait => {}
                Next::Excite(excitation) => {
                    if let TestSignal::Current { carrier, .. } = excitation {
                        carrier_on = carrier;
                    }
                    order(&mut rig, Command::Test(excitation))?;
                }
                Next::Stop => order(&mut rig, Command::Stop(Stop::Coast))?,
                Next::Start => order(&mut rig, Command::Start(Mode::Torque))?,
                Next::Torque(i_q) => order(&mut rig, Command::Torque(i_q))?,
                Next::Design => commissioning.design(),
                Next::Report(report) => reports.push((rig.time() - began, report)),
                Next::Done => break,
            }
        }
        if commissioning.is_running() {
            return Err(Error::Refused(format!("the commissioning does not end in {LONGEST_S} s")));
        }
        let seconds = rig.time() - began;
        let [along, across] = leakage.map(|axis| axis.mean());
        let leakage = rig.plant.energy_model().map(|_| 0.5 * (along + across));
        Ok(Self { rig, commissioning, reports, seconds, shaft_deg, leakage })
    }

    /// Returns the time until the last report of a step up to this one, s.
    pub fn until(&self, step: Step) -> f64 {
        let earlier = self.reports.iter().filter(|(_, report)| report.step <= step);
        earlier.map(|(at, _)| *at).fold(0.0, f64::max)
    }

    /// Returns the circuit in these settings, which the session has found, and the true one. With saturation the measured leakage is
    /// the incremental one at the bias.
    pub fn circuits(&self, config: &Config, settings: &Settings) -> [Circuit; 2] {
        let m = &settings.motor;
        let mut found = Circuit::of([m.r_s, m.r_r, m.l_ls, m.l_lr, m.l_m].map(f64::from));
        let mut truth = Circuit::at(config, settings.i_d().into());
        let measured = self.commissioning.found().leakage;
        if let (Some(incremental), Some(measured)) = (self.leakage, measured) {
            (truth.leakage, found.leakage) = (incremental, f64::from(measured.inductance));
        }
        [found, truth]
    }

    /// Returns the reason why the session was refused.
    pub fn refusal(&self) -> Option<(Step, Refusal)> {
        let refused = |(_, report): &(f64, Report)| Some((report.step, report.refusal?));
        self.reports.iter().find_map(refused)
    }
}

/// Returns the settings of a drive that knows its nameplate, but not its motor.
pub fn unaware(config: &Config) -> Settings {
    Settings { motor: Motor::default(), inertia: None, ..config.drive }
}
