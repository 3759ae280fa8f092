//! The whole drive: one step per PWM period.

mod allowed;
mod axes;
mod brake;
mod coefficients;
mod command;
mod commands;
mod field;
mod flying_start;
mod fundamental;
mod learn;
mod limits;
mod power;
mod prepare;
mod protect;
mod scalar;
mod slow_tasks;
mod standstill_test;
mod state;
mod stopping;
mod telemetry;
mod test_signal;
#[cfg(test)]
mod tests;
mod trust;

use core::hint::black_box;
use core::mem::offset_of;
use core::ops::Range;

use crate::blocks::{Position, Vf};
use crate::carrier::Asymmetry;
use crate::carrier::at_start::AtStartState;
use crate::carrier::injection::Carrier;
use crate::current::inverter_drop::InverterDropState;
use crate::current::pi::{DqPiState, ReferenceState};
use crate::fault::Fault;
use crate::filter::dissertation::LpfState;
use crate::flux::catch::{CatchState, Try};
use crate::flux::estimator::EstimatorState;
use crate::flux::hand_over::HandOver;
use crate::flux::indirect::IndirectState;
use crate::flux::observer::{Induced, ObserverState, Resistance};
use crate::flux::{AngleLoop, FilterLoop};
use crate::front_end::{FrontEnd, FrontEndState};
use crate::identify::learning::{Learned, LearningState};
use crate::io::{Compare, Measured, Output, Sample};
use crate::math::angle::{Angle, UnitVector};
use crate::math::frames::Dq;
use crate::motion::{MotionState, RotorCount};
use crate::protect::lock_monitor::LockMonitorState;
use crate::protect::noise_watch::NoiseWatchState;
use crate::protect::plausibility::{CarrierWatch, PredictionState};
use crate::protect::saliency_check::SaliencyCheckState;
use crate::protect::thermal::{Thermal, ThermalLoads};
use crate::protect::travel_watch::TravelWatchState;
use crate::supply::RelayState;

use axes::Axes;
pub use coefficients::{Coefficients, DcLimit, DefaultLoop, PowerLimit, Protection, SequenceSteps};
pub use command::{Accepted, Command, Refused, Stop};
use flying_start::Residual;
use limits::Limits;
use prepare::Prepare;
use scalar::Scalar;
use slow_tasks::COMMANDS_BEHIND;
use standstill_test::StandstillTest;
pub use state::{Mode, Stage, State};
pub use stopping::COAST_S;
pub use telemetry::{Telemetry, TorqueLimits};
pub use test_signal::{Regulator, TestReport, TestSignal};

/// The drive: coefficients, state of the present phase, and state that outlives a phase.
///
/// ```
/// use induction_drive_core::{AngleSource, Command, Drive, FrontEndState, Mode, Sample, State};
/// use induction_drive_settings::Settings;
///
/// // Without an encoder the drive would have to learn its motor first.
/// let settings = Settings { angle_source: AngleSource::Encoder, ..Settings::default() };
/// let mut drive = Drive::new(settings.build()?);
/// let mut front_end = FrontEndState::default();
/// drive.command(&Command::Start(Mode::Torque))?;
/// // One period, with the ADC counts of zero current, 311 V and 25 °C.
/// let sample = Sample { current_a: 2022, current_b: 2015, dc_link: 2827, heat_sink: 1309, ..Sample::default() };
/// let (compare, _) = drive.period(&mut front_end, &sample, &mut |_| {});
/// assert!(!compare.enabled); // the offsets are calibrated first, with the outputs off
/// assert_eq!(drive.state(), State::Calibrating);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Drive<L: AngleLoop = DefaultLoop> {
    c: Coefficients<L>,
    /// Number of changes of `c`, wrapping.
    changes: u32,
    kept: Common,
    phase: Phase<L::State>,
}

/// State that every phase uses or that outlives a run.
#[derive(Clone, Debug, Default)]
#[repr(C)]
struct Common {
    /// Control periods spent in the present state.
    elapsed: u32,
    /// Offsets of the current sensors a, b and c that the last start has measured, A.
    offsets: [f32; 3],
    /// Telemetry of the last step with the outputs on.
    seen: Telemetry,
    rotor_count: u32,
    references: References,
    limits: Limits,
    /// Whether the next start checks the wiring.
    wiring_unchecked: bool,
    /// Number of starts so far, wrapping.
    starts: u32,
    /// Count of the encoder at position 0, if that was set.
    home: Option<u32>,
    thermal: ThermalLoads,
    relay: RelayState,
    learned: Option<Learned>,
    /// Control periods that the motor's brake needs to close; 0 if there is no brake.
    brake: u32,
}

/// References that every goal has; reset at every start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct References {
    /// Current, A. Its q component is that of the goal, or was commanded.
    current: Dq,
    /// Voltage that is added to the output of the current loop, V.
    test_voltage: Dq,
    /// Injection axis in the flux frame.
    injection_axis: UnitVector,
}

/// The phase of a drive. A phase owns the state that only it uses.
///
/// The words of the phases ([`Drive::PHASES`]) differ from each other, and from 0, in 16 bits, so that flipped bits do not turn one
/// phase into another.
// The large variant is the important one, and the others share its memory.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
#[repr(u32)] // a separate word, so that a state is not copied around a single byte
enum Phase<S> {
    Off(CarryOver) = <Drive>::PHASES[0],
    Fault(Fault, CarryOver) = <Drive>::PHASES[1],
    /// Preparation of one of the next three phases.
    Prepare(Prepare) = <Drive>::PHASES[2],
    /// A test signal to the motor at rest.
    Test(StandstillTest) = <Drive>::PHASES[3],
    /// V/f control.
    Scalar(Scalar) = <Drive>::PHASES[4],
    /// Current control in the flux frame.
    Field(Field<S>) = <Drive>::PHASES[5],
}

/// The work that a drive was started for.
#[derive(Clone, Copy, Debug)]
enum Start {
    Field(Goal),
    Scalar {
        /// Speed reference, mechanical turns/s.
        speed: f32,
        built: Vf,
    },
    Test(TestSignal),
}

impl Start {
    /// Returns the start in this mode; `None` in a build without it.
    pub fn of_mode(mode: Mode) -> Option<Self> {
        Some(match mode {
            Mode::Torque => Self::Field(Goal::Torque),
            Mode::Speed => Self::Field(Goal::SPEED),
            Mode::Position => Self::Field(Goal::position(Position::IN_BUILD?)),
            Mode::Learning => Self::Field(Goal::Learn),
            Mode::VoltsPerHertz => Self::Scalar { speed: 0.0, built: Vf::IN_BUILD? },
            Mode::Commissioning => Self::Test(TestSignal::Rest),
        })
    }

    pub fn mode(&self) -> Mode {
        match self {
            Self::Field(goal) => goal.mode(),
            Self::Scalar { .. } => Mode::VoltsPerHertz,
            Self::Test(_) => Mode::Commissioning,
        }
    }
}

/// A drive that regulates the current in the flux frame.
// The order matters: the fields that every step uses lie within the 1020 bytes that a floating-point load
// of the core reaches from one base address. Otherwise every sixth instruction of a step would compute an
// address.
#[derive(Clone, Debug, Default)]
#[repr(C)]
struct Field<S> {
    pub frame: Frame,
    pub low_pass: LpfState,
    pub indirect: IndirectState,
    pub observer: ObserverState,
    pub hand_over: HandOver,
    /// Voltage induced by flux and leakage, and the observer's share in the angle, which weights its feed-forward.
    pub induced: Induced,
    pub induced_share: f32,
    pub carrier: Carrier,
    pub axes: Axes,
    pub reference: [ReferenceState; 2],
    pub current_loop: DqPiState,
    pub rotor: RotorCount,
    pub prediction: PredictionState,
    pub motion: MotionState,
    pub noise: NoiseWatchState,
    pub inverter_drop: InverterDropState,
    /// Angle by which the flux leads the frame, also as a unit vector: 0 except during self-commissioning.
    pub lead: Angle,
    pub lead_axis: UnitVector,
    pub goal: Goal,
    /// Large, since it contains the state of the alternative demodulators.
    pub estimator: EstimatorState<S>,
    /// Large during the search of a flying start.
    pub flux: FluxPhase,
    /// Asymmetry that was measured before there was current or flux, beyond the known asymmetry.
    pub at_start: Option<Asymmetry>,
    /// Results of the run before. The residual flux is kept until the speed of the shaft is found.
    pub carried: CarryOver,
    pub carrier_watch: CarrierWatch,
    pub saliency_check: SaliencyCheckState,
    pub lock: LockMonitorState,
}

/// The source of the angle of the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Frame {
    /// The counted angle of the rotor and the slip.
    #[default]
    Encoder,
    /// The slip alone, since a drive that learns has a locked shaft.
    LockedShaft,
    /// Injection and back-EMF observer.
    Tracked,
}

impl Frame {
    /// Whether the flux angle is the counted rotor angle plus the slip.
    pub fn is_counted(self) -> bool {
        match self {
            Self::Encoder | Self::LockedShaft => true,
            Self::Tracked => false,
        }
    }
}

/// Phase of the flux.
// See `Phase`. With its tag in a byte of a part, the compiler would copy all of it at each change.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, Default)]
#[repr(u32)]
enum FluxPhase {
    /// Search of a flying start. The frame is fixed, and no check is active.
    Search(CatchState),
    /// The shaft is at rest. A residual flux decays, then the asymmetry of sensors and stator is measured.
    Asymmetry(AtStartState),
    /// The flux of a rotating rotor builds up from this period on.
    Build { from: u32, at: Try },
    /// The frame is fixed along phase a until the flux is established; then the saliency is checked.
    #[default]
    Hold,
    /// Tracking without torque, to verify that the flux is tracked.
    Verify,
    /// Proof of the torque against the closed brake.
    Prove,
    /// Ready. The sensors are watched while the injection is off.
    Ready(TravelWatchState),
    /// Ready, and the self-commissioning measures.
    Learn(LearningState),
}

impl FluxPhase {
    #[inline(always)] // a constant would be copied with the memory that it shares
    pub fn ready() -> Self {
        Self::Ready(TravelWatchState::default())
    }

    /// Whether the angle of the flux is known.
    pub fn is_known(&self) -> bool {
        matches!(self, Self::Ready(_) | Self::Learn(_))
    }
}

/// Goal of the current control, with its reference. The reference of the torque is the q-axis current itself.
#[derive(Clone, Copy, Debug, Default)]
enum Goal {
    #[default]
    Torque,
    Speed {
        /// Speed, mechanical turns/s.
        speed: f32,
        /// Periods for which the speed of a jog is still valid; 0 if there is no jog.
        jog: u32,
    },
    Position {
        /// Position, mechanical turns; `None` for the position at the start.
        turns: Option<f32>,
        /// Instead of the position: a speed, mechanical turns/s, to press against a stop with at most this q-axis current, A.
        press: Option<(f32, f32)>,
        _built: Position,
    },
    Learn,
    /// Brakes to rest.
    Brake {
        quick: bool,
    },
    /// Stays at rest for so many periods, until the brake has closed.
    Hold {
        left: u32,
    },
    /// Reduces the torque to zero and switches off.
    Release,
}

impl Goal {
    /// Whether torque, speed or position is regulated as commanded.
    pub fn regulates(&self) -> bool {
        match self {
            Self::Torque | Self::Speed { .. } | Self::Position { .. } => true,
            Self::Learn | Self::Brake { .. } | Self::Hold { .. } | Self::Release => false,
        }
    }

    /// Returns the mode that has this goal. The mode of a drive that stops is never used.
    pub fn mode(&self) -> Mode {
        match self {
            Self::Torque | Self::Brake { .. } | Self::Hold { .. } | Self::Release => Mode::Torque,
            Self::Speed { .. } => Mode::Speed,
            Self::Position { .. } => Mode::Position,
            Self::Learn => Mode::Learning,
        }
    }

    /// Speed mode with speed 0.
    pub const SPEED: Self = Self::Speed { speed: 0.0, jog: 0 };

    /// Returns the position mode at the position where the drive is started.
    pub const fn position(built: Position) -> Self {
        Self::Position { turns: None, press: None, _built: built }
    }

    /// Whether the references of the goal are finite numbers.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Speed { speed, .. } => speed.is_finite(),
            Self::Position { turns, press, .. } => {
                turns.is_none_or(f32::is_finite) && press.is_none_or(|(speed, _)| speed.is_finite())
            }
            Self::Torque | Self::Learn => true,
            Self::Brake { .. } | Self::Hold { .. } | Self::Release => true,
        }
    }
}

/// Reason why the outputs are switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Stopped,
    /// The self-commissioning has measured all its points.
    Measured,
    Fault(Fault),
}

impl From<Fault> for End {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// Quantities that a run has measured and the next run may not measure again.
#[derive(Clone, Copy, Debug, Default)]
struct CarryOver {
    /// Stator resistance.
    resistance: Resistance,
    /// Inverter voltage error per phase beyond the dead time, V.
    inverter_drop: f32,
    /// Asymmetry of sensors and stator beyond the learned one.
    asymmetry: Asymmetry,
    /// Residual flux in the motor; `None` before the first run.
    residual: Option<Residual>,
    /// Speed of the rotor at the end of that run, electrical turns per period; `None` if it is unknown.
    rotor_freq: Option<f32>,
}

impl<L: AngleLoop> Drive<L> {
    /// Position of the coefficients in a drive, bytes, for a check of its memory from outside. They
    /// change only when the count at [`Self::CHANGES`] changes.
    #[doc(hidden)]
    pub const COEFFICIENTS: Range<usize> =
        offset_of!(Self, c)..offset_of!(Self, c) + size_of::<Coefficients<L>>();
    /// Position in a drive of the count of these changes, a `u32`.
    #[doc(hidden)]
    pub const CHANGES: usize = offset_of!(Self, changes);

    /// Position of the word of the phase in a drive, bytes, for a check from outside before each step.
    #[doc(hidden)]
    pub const PHASE: usize = offset_of!(Self, phase);
    /// Values that the word at [`PHASE`](Self::PHASE) can have: rows of a Hadamard matrix that the core can compare in one
    /// instruction.
    #[doc(hidden)]
    pub const PHASES: [u32; 6] =
        [0x5555_5555, 0x3333_3333, 0x6666_6666, 0x0f0f_0f0f, 0x00ff_00ff, 0xff00_ff00];

    /// Whether a drive whose phase has this word [is off](Self::is_off).
    #[doc(hidden)]
    pub const fn is_off_in(phase: u32) -> bool {
        phase == Self::PHASES[0] || phase == Self::PHASES[1]
    }

    /// Creates a drive that is off.
    pub fn new(coefficients: Coefficients<L>) -> Self {
        let phase = Phase::Off(CarryOver::default());
        let limits = Limits { motor_fault: coefficients.no_motor_reading(), ..Limits::default() };
        let kept = Common { seen: Telemetry::still(), limits, ..Common::default() };
        Self { c: coefficients, changes: 0, kept, phase }
    }

    /// Returns the present state, for what runs from the flash.
    #[cold]
    fn present_state(&self) -> State {
        self.state_now()
    }

    #[inline(always)] // into `state` of the compiled drives; generic, each crate would have a copy of its own
    fn state_now(&self) -> State {
        match &self.phase {
            Phase::Off(_) => State::Off,
            Phase::Fault(fault, _) => State::Fault(*fault),
            Phase::Prepare(prepare) => prepare.state(),
            Phase::Test(test) => test.state(),
            Phase::Scalar(scalar) => scalar.state(),
            Phase::Field(field) => field.state(),
        }
    }

    /// Whether the last period leaves time for a command. One period of an injection period does, so that the longest interrupt has
    /// no command.
    pub fn has_time(&self) -> bool {
        match &self.phase {
            Phase::Field(field) => field.carrier.is_behind(COMMANDS_BEHIND),
            _ => true,
        }
    }

    /// Whether the measurements of the last step are to be passed to `online`.
    pub fn tracks_rotor(&self) -> bool {
        self.c.track_rotor && matches!(&self.phase, Phase::Field(field) if field.regulates())
    }

    /// Whether the outputs are off and stay off until the next command.
    pub fn is_off(&self) -> bool {
        matches!(self.phase, Phase::Off(_) | Phase::Fault(..))
    }

    /// Whether the outputs drive a current for any purpose; the pulses of a wiring check do not count.
    fn is_energised(&self) -> bool {
        match &self.phase {
            Phase::Off(_) | Phase::Fault(..) | Phase::Prepare(_) => false,
            Phase::Test(test) => test.state() == State::Exciting,
            Phase::Scalar(_) | Phase::Field(_) => true,
        }
    }

    /// Returns the coefficients of the front end.
    pub fn front_end(&self) -> &FrontEnd {
        &self.c.front_end
    }

    /// Returns the offsets of the current sensors a, b and c, A, which the present or the last start has measured; 0 before.
    pub fn offsets(&self) -> [f32; 3] {
        self.kept.offsets
    }

    /// Runs one PWM period, see [`Drive::period`].
    #[doc(hidden)]
    pub fn run_period(
        &mut self,
        front_end: &mut FrontEndState,
        sample: &Sample,
        put_out: &mut dyn FnMut(Compare),
    ) -> (Compare, Output) {
        let measured = self.c.front_end.measure(front_end, sample, self.kept.offsets);
        let regulated = matches!(self.phase, Phase::Field(_));
        let output = self.run_step(&measured, put_out);
        let compare = self.c.front_end.put_out(front_end, &output);
        if !(regulated && compare.enabled) {
            put_out(compare);
        }
        (compare, output)
    }

    /// Runs one step, see [`Drive::step`], and passes the compare values to `put_out` early, if the phase computes them early.
    #[doc(hidden)]
    pub fn run_step(&mut self, measured: &Measured, put_out: &mut dyn FnMut(Compare)) -> Output {
        let checked = self.c.protect(measured);
        let result = match &mut self.phase {
            Phase::Field(field) => {
                // The drive is a static. If the compiler knew its address, it would compute the address of each field
                // instead of using one of three base addresses within reach.
                let (field, c, kept) = black_box((field, &self.c, &mut self.kept));
                match checked {
                    Ok(()) => c.step_field(field, kept, measured, put_out).map(Some),
                    Err(fault) => Err(fault.into()),
                }
            }
            _ => self.step_without_flux(measured, checked),
        };
        self.kept.elapsed = self.kept.elapsed.wrapping_add(1);
        let duties = result.unwrap_or_else(|end| {
            self.end(end);
            None
        });
        if let Some(relay) = &self.c.relay {
            relay.step(&mut self.kept.relay, measured.dc_link);
        }
        let chopper = if self.is_energised() { self.kept.limits.now.chopper } else { 0.0 };
        Output { duties, chopper, relay: self.kept.relay.closed }
    }

    /// Runs a step of a phase without current control in the flux frame.
    #[cold]
    fn step_without_flux(
        &mut self,
        measured: &Measured,
        checked: Result<(), Fault>,
    ) -> Result<Option<[f32; 3]>, End> {
        let (is_off, is_energised) = (self.is_off(), self.is_energised());
        let (c, k) = (&self.c, &mut self.kept);
        if k.elapsed % Thermal::EVERY == Thermal::EVERY - 1 {
            c.load(k, measured, is_energised)?;
        }
        if is_off {
            return Ok(None);
        }
        checked?;
        match &mut self.phase {
            Phase::Prepare(_) => Ok(self.prepare(measured)?),
            Phase::Test(test) => Ok(Some(c.step_test(test, k, measured)?)),
            Phase::Scalar(scalar) => c.step_scalar(scalar, k, measured).map(Some),
            Phase::Off(_) | Phase::Fault(..) | Phase::Field(_) => Ok(None),
        }
    }

    /// Continues in this phase.
    #[inline(always)] // writes the small phase only, not the memory that it shares
    fn enter(&mut self, phase: Phase<L::State>) {
        self.phase = phase;
        self.kept.elapsed = 0;
    }

    /// Switches the outputs off.
    #[cold]
    fn end(&mut self, end: End) {
        if let Phase::Field(field) = &self.phase {
            self.c.show(field, &mut self.kept);
        }
        let fault = match (end, &self.phase) {
            (End::Stopped, _) => None,
            (End::Measured, _) => self.evaluate_learning(),
            (End::Fault(fault), Phase::Field(field)) => Some(field.as_catch_failure(fault)),
            (End::Fault(fault), _) => Some(fault),
        };
        let left = self.carry_over();
        match fault {
            None => self.enter(Phase::Off(left)),
            Some(fault) => self.enter(Phase::Fault(fault, left)),
        }
    }

    /// Returns the quantities that a run passes on to the next run.
    #[cold]
    fn carry_over(&self) -> CarryOver {
        match &self.phase {
            Phase::Off(carried) | Phase::Fault(_, carried) => *carried,
            Phase::Prepare(Prepare { carried, .. })
            | Phase::Test(StandstillTest { carried, .. }) => {
                CarryOver { residual: carried.residual.or(Some(Residual::of(0.0))), ..*carried }
            }
            Phase::Scalar(scalar) => {
                let volts = self.kept.seen.voltage.q.abs();
                let rotor_freq = Some(self.kept.seen.rotor_freq);
                CarryOver { residual: Some(Residual::of(volts)), rotor_freq, ..scalar.carried }
            }
            Phase::Field(field) => field.carry_over(),
        }
    }
}

/// Functions of a drive with this loop that are compiled in this crate, at its level of optimisation. Compiled in the crate that calls
/// them, as a generic function is, they would take over the level of that crate: with the firmware's, 350 cycles more in the median.
macro_rules! compiled_here {
    ($angle_loop:ty) => {
        impl Drive<$angle_loop> {
            /// Runs one PWM period from the ADCs to the timer: front end, [`step`](Self::step), front end.
            ///
            /// `put_out` gets the compare values as soon as they are known. Checks and slow tasks follow. If one of them switches the
            /// outputs off, `put_out` is called again before the next period, so that the first values never act.
            #[inline(never)]
            pub fn period(
                &mut self,
                front_end: &mut FrontEndState,
                sample: &Sample,
                put_out: &mut dyn FnMut(Compare),
            ) -> (Compare, Output) {
                self.run_period(front_end, sample, put_out)
            }

            /// Runs one PWM period, from the measurement at the instant `k T` to the duties of the period that begins at `(k + 1) T`.
            ///
            /// It never panics. Any error of the input or of the state becomes a latched fault, with the
            /// outputs off in the same step.
            pub fn step(&mut self, measured: &Measured) -> Output {
                self.run_step(measured, &mut |_| {})
            }

            /// Returns the present state.
            #[inline(never)] // one copy for all callers: 120 bytes less
            pub fn state(&self) -> State {
                self.state_now()
            }

            /// Executes a command. Call it between two steps, not from within [`step`](Self::step).
            ///
            /// References are accepted from the start command on. A start sets them to zero, so that references
            /// of an earlier run move nothing.
            ///
            /// # Errors
            /// The reason of the refusal. A refused command changes nothing.
            // It is not inlined, so that it stays in the flash.
            #[inline(never)]
            pub fn command(&mut self, command: &Command<$angle_loop>) -> Result<Accepted, Refused> {
                self.execute(command)
            }
        }
    };
}

compiled_here!(FilterLoop);
#[cfg(feature = "printed")]
compiled_here!(crate::printed::ComparedLoop);
