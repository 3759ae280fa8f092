//! The test rig: a drive, a plant, and the one PWM period between them.

use crate::config::{Config, LoadMode, built, check_model, open_phase, plant_settings};
use crate::error::Error;
use crate::plant::{Load, Plant, PlantSettings};
use crate::stats::Stats;
use drive_core::learned::Learned;
use drive_core::{
    Accepted, AngleSource, Command, Drive, Fault, FrontEndState, Mode, Sample, State, Stop,
};
use drive_settings::Settings;
use std::f64::consts::TAU;

/// Longest saliency self-commissioning, s.
const LONGEST_LEARNING_S: u32 = 1000;
/// Time at rest after a saliency self-commissioning, in rotor time constants.
const REST_T: f64 = 8.0;

/// Longest start, s.
const LONGEST_START_S: f64 = 30.0;
/// Number of periods between two recorded points: 5 ms.
const TRACE_EVERY: u64 = 30;

/// Control periods per second.
pub const RATE_HZ: f64 = 6000.0;

/// A drive connected to a simulated inverter, motor and load.
#[derive(Clone)]
pub struct Rig {
    /// The motor with everything around it.
    pub plant: Plant,
    /// The drive under test.
    pub drive: Drive,
    /// State of the firmware's interface around the drive.
    pub front_end: FrontEndState,
    periods: u64,
    /// Largest phase current at the end of a period so far, A.
    pub peak_a: f64,
    /// Lowest and highest voltage of the dc link so far, V.
    pub dc_link_v: (f64, f64),
    /// A point every 5 ms, if they are requested.
    pub trace: Option<Vec<Point>>,
    /// Duration of the last saliency self-commissioning, s, to a second.
    pub learning_s: f64,
}

/// True state of the plant and estimates of the drive at one sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct Point {
    /// Time, s.
    pub t: f64,
    /// Reference of the q-axis current, after its filter, A.
    pub iq_ref: f64,
    /// d-axis current in the estimated flux frame, as measured by the drive, A.
    pub id: f64,
    /// q-axis current in the estimated flux frame, as measured by the drive, A.
    pub iq: f64,
    /// Electromagnetic torque of the motor, Nm.
    pub torque: f64,
    /// Magnitude of the rotor flux, Wb peak.
    pub flux: f64,
    /// Magnitude of the stator current, A peak.
    pub current: f64,
    /// True minus estimated rotor-flux angle, electrical degrees, within ±180.
    pub angle_error_deg: f64,
    /// Current difference of the demodulation, A.
    pub delta_i: f64,
    /// Saliency q from the synchronous demodulation.
    pub saliency: f64,
    /// Injection current along the injection axis, A.
    pub carrier: f64,
    /// Saliency deficit: share of the flux-fixed saliency that the lock monitor finds missing.
    pub loss: f64,
    /// Speed of the rotor, rpm.
    pub speed_rpm: f64,
    /// Rotor speed as the drive estimates it, rpm.
    pub speed_estimate_rpm: f64,
    /// Torque per flux and q-axis current, 3/2 P L_m/L_r.
    pub torque_per_flux_ampere: f64,
    /// True angle of the rotor flux, electrical rad from phase a.
    pub phi: f64,
    /// Voltage of the dc link, V.
    pub dc_link: f64,
    /// Whether the drive regulates after this sample; otherwise it has no angle.
    pub regulates: bool,
    /// Position of the rotor, mechanical turns.
    pub turns: f64,
    /// Estimated position, mechanical turns from the start of the drive.
    pub turns_estimate: f64,
}

impl Point {
    /// Signal of the demodulation in use: a saliency with the synchronous demodulation, otherwise a current difference
    /// in A. The signal that is not in use is zero.
    pub fn signal(&self) -> f64 {
        self.delta_i + self.saliency
    }
}

impl Rig {
    /// Makes a drive that is off, connected to a motor at rest.
    ///
    /// # Errors
    /// [`Error::Refused`] with the setting that the plant or the drive refuses.
    pub fn new(plant: &PlantSettings, drive: &Settings, seed: u64) -> Result<Self, Error> {
        Ok(Self::of(Plant::new(plant, seed).map_err(Error::refused)?, Drive::new(built(drive)?)))
    }

    /// Connects a drive that is off to a motor at rest, both made by the caller.
    pub fn of(plant: Plant, drive: Drive) -> Self {
        let (front_end, trace, v) = (FrontEndState::default(), None, plant.dc_link());
        let (periods, peak_a, dc_link_v, learning_s) = (0, 0.0, (v, v), 0.0);
        Self { plant, drive, front_end, periods, peak_a, dc_link_v, trace, learning_s }
    }

    /// Makes the bench that the configuration describes. With `prepare.learn` a drive that tracks the saliency first
    /// runs the saliency self-commissioning with the shaft locked, and the time begins afterwards.
    ///
    /// # Errors
    /// As [`Rig::new`], [`Rig::learn`] and [`check_model`].
    pub fn from_config(config: &Config, seed: u64) -> Result<Self, Error> {
        check_model(config)?;
        let plant = plant_settings(config);
        let mut rig = Self::new(&plant, &config.drive, seed)?;
        rig.plant.set_open_phase(open_phase(config)).map_err(Error::refused)?;
        if config.prepare.learn && config.drive.tracks_synchronously() {
            rig.set_load(Load::Locked)?;
            rig.learn()?;
            // The flux decays.
            rig.wait(REST_T * f64::from(config.drive.motor.tau_r()));
            rig.set_load(plant.mechanics.load)?;
            rig.periods = 0;
        }
        Ok(rig)
    }

    /// Runs the saliency self-commissioning; the shaft must be locked. Afterwards the drive is off and uses the learned values.
    ///
    /// # Errors
    /// [`Error::Refused`] if the drive refuses the command, stops with a fault or does not finish.
    pub fn learn(&mut self) -> Result<Learned, Error> {
        let began = self.time();
        self.command(&Command::Start(Mode::Learning))?;
        for _ in 0..LONGEST_LEARNING_S {
            self.wait(1.0);
            match (self.drive.state(), self.drive.learned()) {
                (State::Off, Some(learned)) => {
                    self.learning_s = self.time() - began;
                    return Ok(*learned);
                }
                (State::Fault(fault), learned) => {
                    let found = learned.map_or(String::new(), |learned| format!(": {learned}"));
                    let why = format!("the drive does not learn: {fault}{found}");
                    return Err(Error::Refused(why));
                }
                _ => {}
            }
        }
        Err(Error::Refused(format!("the drive does not learn: it is {}", self.drive.state())))
    }

    /// Makes the bench that the configuration describes and starts the drive in `mode`.
    ///
    /// # Errors
    /// As [`Rig::from_config`] and [`Rig::start`].
    pub fn started(config: &Config, seed: u64, mode: Mode) -> Result<Self, Error> {
        let mut rig = Self::from_config(config, seed)?;
        rig.start(mode)?;
        Ok(rig)
    }

    /// Makes a bench with a locked shaft and a drive that is oriented by the encoder, with injection, and runs it for
    /// `seconds` at the q-axis current `iq`, A.
    ///
    /// # Errors
    /// As [`Rig::started`] and [`Rig::command`].
    pub fn oriented(config: &Config, seed: u64, iq: f64, seconds: f64) -> Result<Self, Error> {
        let mut config = config.clone();
        config.drive.angle_source = AngleSource::Encoder;
        config.drive.injection.beside_encoder = true;
        config.load.mode = LoadMode::Locked;
        let mut rig = Self::started(&config, seed, Mode::Torque)?;
        rig.settle(&Command::Torque(iq as f32), seconds)?;
        Ok(rig)
    }

    /// Returns the seconds since the beginning.
    pub fn time(&self) -> f64 {
        self.periods as f64 / RATE_HZ
    }

    /// Runs one PWM period.
    pub fn step(&mut self) {
        if self.trace.is_some() {
            self.point();
        } else {
            let sample = self.plant.sample();
            self.step_with(&sample);
        }
    }

    /// Runs one PWM period in which the drive gets `sample` instead of the sample of the plant. This is all that the
    /// control interrupt of the firmware does with a drive. Every experiment runs its drive here.
    #[inline(never)] // compiled once, not in every crate that runs a rig
    pub fn step_with(&mut self, sample: &Sample) {
        let (compare, output) = self.drive.period(&mut self.front_end, sample, &mut |_| {});
        self.plant.period(&compare, &output);
        self.periods += 1;
        self.peak_a = self.plant.phase_currents().iter().fold(self.peak_a, |a, i| a.max(i.abs()));
        let ((least, most), v) = (self.dc_link_v, self.plant.dc_link());
        self.dc_link_v = (least.min(v), most.max(v));
    }

    /// Runs for `seconds`. The true state of the plant, which no caller needs here, is not computed.
    pub fn wait(&mut self, seconds: f64) {
        for _ in 0..(seconds * RATE_HZ).round() as u64 {
            self.step();
        }
    }

    /// Runs until the drive is in a state that `is_reached` accepts, for one period or more and at most for `seconds`; returns
    /// the state.
    pub fn wait_until(&mut self, seconds: f64, is_reached: impl Fn(State) -> bool) -> State {
        for _ in 0..(seconds * RATE_HZ).round() as u64 {
            self.step();
            if is_reached(self.drive.state()) {
                break;
            }
        }
        self.drive.state()
    }

    /// Gives the command to start in `mode`, and runs until the drive regulates or is off; returns its state.
    ///
    /// # Errors
    /// If the drive refuses the command.
    pub fn begin(&mut self, mode: Mode) -> Result<State, Error> {
        self.command(&Command::Start(mode))?;
        let has_begun = |state: State| state == State::of_mode(mode) || state.is_off();
        Ok(self.wait_until(LONGEST_START_S, has_begun))
    }

    /// Runs for `seconds` and passes the point of every sample to `look`.
    pub fn run(&mut self, seconds: f64, mut look: impl FnMut(&Point)) {
        for _ in 0..(seconds * RATE_HZ).round() as u64 {
            look(&self.point());
        }
    }

    /// Runs one PWM period and returns the true state at the instant of its sample, with the drive's estimates from that sample.
    #[inline(never)] // compiled once, not with every closure that looks at points
    pub fn point(&mut self) -> Point {
        let (plant, phi) = (&self.plant, self.plant.rotor_flux_angle());
        let is_traced = self.periods.is_multiple_of(TRACE_EVERY);
        let mut point = Point {
            phi,
            dc_link: plant.dc_link(),
            t: self.time(),
            torque: plant.torque(),
            torque_per_flux_ampere: plant.torque_factor(),
            flux: plant.rotor_flux().norm(),
            current: plant.current().norm(),
            speed_rpm: plant.mechanical_speed() * 60.0 / TAU,
            turns: plant.mechanical_angle() / TAU,
            ..Point::default()
        };
        let sample = self.plant.sample();
        self.step_with(&sample);
        point.regulates = self.drive.state().regulates();
        let telemetry = self.drive.telemetry();
        let rpm = |step: f32| f64::from(step) * RATE_HZ * 60.0 / self.plant.pole_pairs();
        point.iq_ref = telemetry.reference.q.into();
        point.id = telemetry.current.d.into();
        point.iq = telemetry.current.q.into();
        point.delta_i = telemetry.delta_i.into();
        point.saliency = telemetry.saliency.into();
        point.loss = telemetry.saliency_loss.into();
        point.carrier = f64::from(telemetry.carrier_squared).sqrt();
        point.speed_estimate_rpm = rpm(telemetry.rotor_freq);
        point.turns_estimate = telemetry.turns.into();
        point.angle_error_deg = wrapped_degrees(phi - f64::from(telemetry.phi.to_turns()) * TAU);
        if let Some(trace) = self.trace.as_mut().filter(|_| is_traced) {
            trace.push(point);
        }
        point
    }

    /// Runs for `seconds` and returns the statistics of the values that `of` computes from each sample.
    pub fn stats<const N: usize>(
        &mut self,
        seconds: f64,
        of: impl Fn(&Point) -> [f64; N],
    ) -> [Stats; N] {
        let mut stats = [Stats::default(); N];
        self.run(seconds, |p| stats.iter_mut().zip(of(p)).for_each(|(one, value)| one.push(value)));
        stats
    }

    /// Starts in `mode` and runs until the drive regulates.
    ///
    /// # Errors
    /// If the drive refuses the command, or does not regulate within 30 s.
    pub fn start(&mut self, mode: Mode) -> Result<(), Error> {
        match self.begin(mode)? {
            state if state == State::of_mode(mode) => Ok(()),
            other => Err(Error::Refused(format!("the drive does not start: it is {other}"))),
        }
    }

    /// Gives the drive a command; returns whether the drive accepted it as given or limited it.
    ///
    /// # Errors
    /// If the drive refuses the command.
    pub fn command(&mut self, command: &Command) -> Result<Accepted, Error> {
        let refused = |e| Error::Refused(format!("the drive refuses {}: {e}", words(command)));
        self.drive.command(command).map_err(refused)
    }

    /// Gives the drive a command, and time to settle.
    ///
    /// # Errors
    /// If the drive refuses the command.
    pub fn settle(&mut self, command: &Command, seconds: f64) -> Result<(), Error> {
        self.command(command)?;
        self.wait(seconds);
        Ok(())
    }

    /// Returns the fault with which the drive has stopped itself, with its number.
    pub fn fault(&self) -> Option<String> {
        self.drive.state().fault().map(fault_text)
    }

    /// Returns the speed of the shaft, rpm.
    pub fn rpm(&self) -> f64 {
        self.plant.mechanical_speed() * 60.0 / TAU
    }

    /// Couples a dynamometer that holds a speed, rpm.
    ///
    /// # Errors
    /// If the speed is out of range.
    pub fn turn(&mut self, rpm: f64) -> Result<(), Error> {
        self.set_load(Load::Speed { speed: rpm * TAU / 60.0 })
    }

    /// Brings the shaft from rest to a speed, rpm, with a dynamometer, in equal steps of `pace_s`.
    ///
    /// # Errors
    /// As [`Rig::turn`].
    pub fn bring_to(&mut self, rpm: f64, steps: u32, pace_s: f64) -> Result<(), Error> {
        for n in 1..=steps {
            let speed = rpm * TAU / 60.0 * f64::from(n) / f64::from(steps);
            self.set_load(Load::Speed { speed })?;
            self.wait(pace_s);
        }
        Ok(())
    }

    /// Connects another load.
    ///
    /// # Errors
    /// If the load is out of range.
    pub fn set_load(&mut self, load: Load) -> Result<(), Error> {
        self.plant.set_load(load).map_err(Error::refused)
    }
}

/// Describes a fault in words, with its number.
pub fn fault_text(fault: Fault) -> String {
    format!("fault {}: {fault}", fault.code())
}

/// Describes a command in words.
fn words(command: &Command) -> String {
    match command {
        Command::Start(mode) => format!("to start in {} mode", mode_word(*mode)),
        Command::Relock => "to magnetise and verify the angle again".into(),
        Command::CheckWiring => "to check the wiring".into(),
        Command::Brake(seconds) => format!("to have a brake that closes in {seconds} s"),
        Command::Test(_) => "to excite the motor at rest".into(),
        Command::Stop(Stop::Coast) => "to stop".into(),
        Command::Stop(Stop::Ramp) => "to stop by the ramp".into(),
        Command::Stop(Stop::Quick) => "to stop quickly".into(),
        Command::Stop(Stop::Now) => "to stop at once".into(),
        Command::Clear => "to clear the fault".into(),
        Command::Torque(a) => format!("a q-axis current of {a} A"),
        Command::Speed(rpm) => format!("a speed of {rpm} rpm"),
        Command::Jog(rpm) => format!("to jog at {rpm} rpm"),
        Command::Position(turns) => format!("a position of {turns} turns"),
        Command::Press(rpm, a) => format!("to press on at {rpm} rpm with {a} A"),
        Command::Home(turns) => format!("to take the position {turns} for 0"),
        Command::Magnetising(a) => format!("a magnetising current of {a} A"),
        Command::TurnInjection(deg) => format!("to turn the injection axis by {deg}°"),
        Command::TestVoltage(v) => format!("a test voltage of {} V and {} V (d, q)", v.d, v.q),
        Command::RotorTimeConstant(s) => format!("a rotor time constant of {s} s"),
        Command::MotorTemperature(reading) => reading.map_or_else(
            |fault| format!("a motor sensor that is {fault}"),
            |c| format!("a motor of {c} degC"),
        ),
        Command::Configure(_) => "other settings".into(),
    }
}

fn mode_word(mode: Mode) -> &'static str {
    match mode {
        Mode::Torque => "torque",
        Mode::Speed => "speed",
        Mode::Position => "position",
        Mode::VoltsPerHertz => "voltage-and-frequency",
        Mode::Learning => "learning",
        Mode::Commissioning => "commissioning",
    }
}

/// Converts an angle in radians to degrees within ±180.
pub fn wrapped_degrees(radians: f64) -> f64 {
    let turns = radians / TAU;
    (turns - turns.round()) * 360.0
}
