//! The control interrupt: samples in, [`Drive::period`], compare values out, 6000 times a second.
//!
//! It starts when both ADCs have finished, [`board::SAMPLES_READY_TICKS`] (2.3 us) after the sampling of the currents at a top of TIM1,
//! and must have written the compare values before the next update, one control period later. It never logs, formats, waits, or takes a
//! lock.

pub mod addresses;

use core::cell::UnsafeCell;
use core::mem::{MaybeUninit, offset_of};
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use cortex_m::asm;
use cortex_m::peripheral::{DWT, NVIC};
use drive_core::flux::FilterLoop;
use drive_core::learned::Learned;
use drive_core::{Command, Drive, FrontEndState, Hardware, Limiting, Sample, State, Stop};
use stm32g4xx_hal::pac::Interrupt;
use stm32g4xx_hal::stm32::interrupt;

use induction_drive::board;
use induction_drive::chip::stage::Stage;
use induction_drive::link::mailbox::{Receiver, Sender};
use induction_drive::link::{Answer, Status};
use induction_drive::monitor::memory_check::MemoryRange;
use induction_drive::recording::ring::{self, Writer};
use induction_drive::recording::trace::{Recorder, Sampled};

/// The drive and its surroundings, owned by the interrupt.
#[repr(C)] // keeps the references to the memory shared with the main loop together
pub struct Control {
    /// The drive.
    pub drive: Drive,
    /// The peripherals.
    pub stage: Stage,
    /// Reports to the main loop.
    pub status: Sender<'static, Status>,
    /// Commands to the drive.
    pub commands: Receiver<'static, Command>,
    /// Answers of the drive.
    pub answers: Sender<'static, Answer>,
    /// Results of a self-commissioning.
    pub learned: Sender<'static, Option<Learned>>,
    /// The trace.
    pub trace: Recorder<'static, { board::TRACE_RECORDS }>,
    /// Signals for the report, the stream, the identification of the rotor time constant, and the commissioning.
    pub signals: Writer<'static, { ring::PERIODS }>,
}

// The drive is copied at a start and by tools. (The loop of the dissertation takes more.)
const _: () = assert!(size_of::<Drive<FilterLoop>>() <= 4096);

/// Control periods since the start, wrapping.
pub static PERIODS: AtomicU32 = AtomicU32::new(0);
/// Stage of the drive: [`OFF`] if it is off or in fault, where the outputs stay off until the next command, [`STOPPING`] if it stops with
/// the outputs on, else 0.
pub static STAGE: AtomicU8 = AtomicU8::new(OFF);
pub const OFF: u8 = 1;
pub const STOPPING: u8 = 2;
/// Whether the commissioning observes the drive while it regulates.
pub static RECORD_FOR_MAIN: AtomicBool = AtomicBool::new(false);
/// Control periods from one record of the stream to the next; 0: none.
pub static STREAM_DIVIDER: AtomicU32 = AtomicU32::new(0);
/// Bits from the main loop: [`WINDOW_ON`], and the errors that it has found, as bits of [`Hardware`].
pub static FAULTS_FROM_MAIN: AtomicU8 = AtomicU8::new(0);
/// The window watchdog is fed; the first feeding starts it, once the interrupt has come at its rate.
pub const WINDOW_ON: u8 = 1 << 7;
const _: () = assert!(Hardware::all().bits() & WINDOW_ON == 0);
/// Word of the phase of a drive whose state has a flipped bit; 0: none. The outputs are off, and the main loop ends the run.
pub static BROKEN: AtomicU32 = AtomicU32::new(0);
/// Whether a deadline was ever missed.
pub static MISSED: AtomicBool = AtomicBool::new(false);

impl Control {
    /// Hands everything over to the interrupt and enables it. Only the first call has an effect.
    pub fn run(self) {
        static STARTED: AtomicBool = AtomicBool::new(false);
        if STARTED.swap(true, Ordering::AcqRel) {
            return;
        }
        let running = Running {
            control: self,
            front_end: FrontEndState::default(),
            worst_cycles: [0; 2],
            worst_latency: 0,
            unreported: Hardware::empty(),
            phase: <Drive>::PHASES[0],
            reported: None,
            report_left: 0,
            report_late: 0,
            stream_due: false,
        };
        // SAFETY: the only writer, once (STARTED), and the only reader is the interrupt, which is
        // still masked.
        unsafe { (*RUNNING.0.get()).write(running) };
        // SAFETY: no critical section relies on this mask; the data of the interrupt are initialised.
        unsafe { NVIC::unmask(Interrupt::ADC1_2) };
    }
}

/// The data that the interrupt writes only when its drive counts a change, and the address of that count. The data are the coefficients
/// and the references to the memory shared with the main loop.
pub fn constants() -> ([MemoryRange; 2], u32) {
    let control = RUNNING.0.get() as usize + offset_of!(Running, control);
    let range = |at: usize, bytes: usize| MemoryRange {
        address: (control + at) as u32,
        words: (bytes / size_of::<u32>()) as u32,
    };
    let drive = offset_of!(Control, drive);
    let references = offset_of!(Control, status);
    let constants = [
        range(drive + <Drive>::COEFFICIENTS.start, <Drive>::COEFFICIENTS.len()),
        range(references, size_of::<Control>() - references),
    ];
    (constants, (control + drive + <Drive>::CHANGES) as u32)
}

/// The word of the drive's phase in memory: one of [`Drive::PHASES`], unless a bit has flipped.
fn phase(drive: &Drive) -> u32 {
    let drive = &raw const *drive;
    // SAFETY: a word within the drive. It is read as a plain number, not as the tag of an enum.
    unsafe { drive.cast::<u32>().byte_add(<Drive>::PHASE).read_volatile() }
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<MaybeUninit<Running>>);

// SAFETY: never accessed by two contexts at a time: `Control::run` writes it before it unmasks the interrupt, and after that only the
// interrupt accesses it, which cannot interrupt itself. (The check of the memory reads words of it, without a reference; see
// `memory::word`.)
unsafe impl Sync for Owned {}

// SAFETY: a section of memory.x for data without initialisation, which `MaybeUninit` allows for.
#[unsafe(link_section = ".control_data")]
static RUNNING: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

struct Running {
    control: Control,
    front_end: FrontEndState,
    /// Most cycles of periods without a command, and with one.
    worst_cycles: [u32; 2],
    worst_latency: u32,
    /// Events since the last report.
    unreported: Hardware,
    /// Word of the drive's phase at the end of the last period.
    phase: u32,
    /// State in the last report.
    reported: Option<State>,
    /// Parts of a report that are still to be sent.
    report_left: u8,
    /// Number of periods for which a part has waited.
    report_late: u8,
    stream_due: bool,
}

#[interrupt]
fn ADC1_2() {
    // SAFETY: see `Owned`; written before the interrupt was unmasked, and the reference ends with this
    // function.
    unsafe { (*RUNNING.0.get()).assume_init_mut() }.period();
    // The requests are cleared before the return: a write still on its way would raise the interrupt again (Arm erratum
    // 838869).
    asm::dsb();
}

impl Running {
    fn period(&mut self) {
        let began = DWT::cycle_count();
        let Control { drive, stage, commands, answers, trace, signals, .. } = &mut self.control;
        let told = FAULTS_FROM_MAIN.load(Ordering::Relaxed);
        let (watched, told) = (told & WINDOW_ON != 0, Hardware::from_bits_truncate(told));
        let Some(mut period) = stage.begin(watched, told) else { return };
        // Checked before any decision depends on it: if a bit of the phase has flipped, the state of the drive is unknown.
        let phase = phase(drive);
        if phase != self.phase {
            stage.pwm.trip();
            return BROKEN.store(phase | 1, Ordering::Relaxed);
        }
        let was_off = <Drive>::is_off_in(phase);
        let sample = stage.sample(&mut period, was_off);

        let put_out = &mut |compare| {
            if !stage.pwm.apply(compare) {
                BROKEN.store(phase, Ordering::Relaxed);
            }
        };
        let (_, output) = drive.period(&mut self.front_end, &sample, put_out);

        let (latency, missed) = stage.end(&period, was_off, &output);
        self.worst_latency = self.worst_latency.max(latency);
        if missed {
            MISSED.store(true, Ordering::Relaxed);
        }

        // Commands are taken between two steps: a command acts from the next step on. There is space for the answer, because the main
        // loop takes the last one before it sends a command.
        let has_time = drive.has_time();
        let commanded = commands
            .take_if(
                |command| has_time || matches!(command, Command::Stop(Stop::Now)),
                |command| {
                    // If a start is refused, the drive stays off, which disarms again.
                    if matches!(command, Command::Start(_) | Command::Test(_)) {
                        stage.pwm.arm();
                    }
                    answers.send_with(|answer| *answer = drive.command(command));
                    stage.adc.convert_both(drive.front_end().both_zero_vectors);
                    // A command that was taken is never carried out again.
                    *command = Command::Stop(Stop::Now);
                },
            )
            .is_some();
        self.phase = self::phase(drive);
        let is_off = <Drive>::is_off_in(self.phase);
        if is_off {
            // A stop at once does not wait for the next period.
            stage.pwm.trip();
            stage.pwm.disarm();
        }
        let (state, limiting) = (drive.state(), drive.limiting());
        // Both are never true.
        let told = OFF * u8::from(is_off) + STOPPING * u8::from(state.is_stopping());
        STAGE.store(told, Ordering::Relaxed);
        let sampled = Sampled::new(&sample, state, limiting);
        let traced = trace.step(&sampled, drive.telemetry());

        self.unreported |= period.hardware;
        stage.periods = stage.periods.wrapping_add(1);
        let periods = stage.periods;
        // A report is sent in two periods: its signals, then the rest. A part is not sent in the period of a command. It also waits, for
        // two periods at most, for a record of trace or stream, because each of these takes long enough.
        let due = self.reported != Some(state) || periods.is_multiple_of(board::PERIODS_PER_STATUS);
        if due && self.report_left == 0 {
            self.report_left = 2;
        }
        // A sample of the stream waits as well, while it is still distinguishable from the next one.
        let every = STREAM_DIVIDER.load(Ordering::Relaxed);
        let since = periods.checked_rem(every);
        self.stream_due |= since == Some(0);
        let hurries = every < 3 || since == Some(2);
        let streamed = self.stream_due && (hurries || !(commanded || traced));
        self.stream_due &= !streamed;
        let busy = (traced || streamed) && self.report_late < 2;
        let waits = self.report_left > 0 && (commanded || busy);
        self.report_late = if waits { self.report_late.saturating_add(1) } else { 0 };
        let part = if waits { 0 } else { self.report_left };
        self.report_left -= u8::from(part > 0);
        let commissioned = RECORD_FOR_MAIN.load(Ordering::Relaxed) && state.regulates();
        let observed = drive.tracks_rotor() || drive.is_testing() || commissioned;
        if observed || streamed || part == 2 {
            signals.write(|record| {
                (record.period, record.sampled) = (periods, sampled);
                (record.observed, record.streamed) = (observed, streamed);
                record.set(drive.telemetry());
            });
        }
        stage.adc.close();
        PERIODS.store(periods, Ordering::Relaxed);
        let cycles = DWT::cycle_count().wrapping_sub(began);
        let [without, with] = &mut self.worst_cycles;
        let worst = if commanded { with } else { without };
        *worst = cycles.max(*worst);
        if part == 1 {
            self.report(state, limiting, sample, cycles);
        }
    }

    /// Reports to the main loop. If the main loop is slow or hangs, this report is lost, but not its events.
    fn report(&mut self, state: State, limiting: Limiting, sample: Sample, cycles: u32) {
        let Control { drive, stage, status, learned, .. } = &mut self.control;
        if self.reported == Some(State::Learning)
            && let Some(result) = drive.learned()
        {
            // There is space: the main loop takes it at once, and the next result comes a minute later.
            learned.send(Some(*result));
        }
        let sent = status.send_with(|report| {
            report.periods = stage.periods;
            report.state = state;
            report.sample = sample;
            report.worst_cycles = self.worst_cycles;
            report.last_cycles = cycles;
            report.worst_latency = self.worst_latency;
            report.hardware = self.unreported;
            report.learning = drive.learning_progress();
            report.limiting = limiting;
            report.torque_limits = drive.torque_limits();
            report.stator_resistance = drive.stator_resistance();
            // The part for the commissioning does not change while the drive regulates.
            if !(state.regulates() && self.reported == Some(state)) {
                report.test_report = drive.test_report();
            }
        });
        if sent {
            self.unreported = Hardware::empty();
            self.reported = Some(state);
        }
    }
}
