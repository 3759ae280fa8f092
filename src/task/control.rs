//! The control interrupt: samples in, [`Drive::step`], compare values out, 6000 times a second.
//!
//! It starts when both converters have finished, [`board::SAMPLES_READY_TICKS`] (2.3 us) after the
//! low sides came on, and must have written the compare values before they do again, one period
//! later. It never logs, formats, waits, or takes a lock.

mod addresses;

use core::cell::UnsafeCell;
use core::mem::{MaybeUninit, offset_of};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::{DWT, NVIC};
use drive_core::identify::learning::Learned;
use drive_core::{Command, Drive, Hardware, Sample, State};
use stm32g4xx_hal::pac::Interrupt;
use stm32g4xx_hal::stm32::interrupt;

use crate::chip::adc::Adc;
use crate::chip::encoder::Encoder;
use crate::chip::pwm::Pwm;
use induction_drive::board;
use induction_drive::link::mailbox::{Receiver, Sender};
use induction_drive::link::ring::Writer;
use induction_drive::link::trace::Recorder;
use induction_drive::link::{Answer, Status};
use induction_drive::monitor::memory_check::Part;
use induction_drive::rotor_tracking::Seen;

/// FirmwareSettings the interrupt works with.
pub struct Control {
    /// The drive.
    pub drive: Drive,
    /// The power stage.
    pub pwm: Pwm,
    /// The converters.
    pub adc: Adc,
    /// The encoder.
    pub encoder: Encoder,
    /// The way to the main loop.
    pub status: Sender<'static, Status>,
    /// What the console wants of the drive.
    pub orders: Receiver<'static, Command>,
    /// What the drive makes of it.
    pub answers: Sender<'static, Answer>,
    /// What a learning found.
    pub learned: Sender<'static, Option<Learned>>,
    /// The trace.
    pub trace: Recorder<'static, { board::TRACE_RECORDS }>,
    /// What the identification sees.
    pub seen: Writer<'static, Seen, { board::SEEN_PERIODS }>,
}

/// Control periods since the start, wrapping.
pub static PERIODS: AtomicU32 = AtomicU32::new(0);
/// Whether the drive is off or in fault: the outputs are off, and stay off until the next order.
pub static IS_OFF: AtomicBool = AtomicBool::new(true);
/// Whether a deadline was ever missed.
pub static MISSED: AtomicBool = AtomicBool::new(false);

impl Control {
    /// Hands everything over to the interrupt and lets it run. Only the first call does.
    pub fn run(self) {
        static STARTED: AtomicBool = AtomicBool::new(false);
        if STARTED.swap(true, Ordering::AcqRel) {
            return;
        }
        let running = Running {
            control: self,
            periods: 0,
            worst_cycles: 0,
            worst_latency: 0,
            late: Hardware::empty(),
            over: Hardware::empty(),
            seen: Hardware::empty(),
            began: 0,
            reported: None,
        };
        // SAFETY: the only writer, once (STARTED), and the only reader is the interrupt, which is
        // still masked.
        unsafe { (*RUNNING.0.get()).write(running) };
        // SAFETY: no critical section relies on this mask; what the interrupt needs stands.
        unsafe { NVIC::unmask(Interrupt::ADC1_2) };
    }
}

/// What the interrupt reads and does not write, unless its drive counts a change: the coefficients, and
/// where the ends of the ways to the main loop are.
pub fn constants() -> ([Part; 5], u32) {
    let control = RUNNING.0.get() as usize + offset_of!(Running, control);
    let part = |at: usize, bytes: usize| Part {
        address: (control + at) as u32,
        words: (bytes / size_of::<u32>()) as u32,
    };
    let drive = offset_of!(Control, drive);
    let constants = [
        part(drive + Drive::COEFFICIENTS.start, Drive::COEFFICIENTS.len()),
        part(offset_of!(Control, status), size_of::<Sender<'static, Status>>()),
        part(offset_of!(Control, orders), size_of::<Receiver<'static, Command>>()),
        part(offset_of!(Control, answers), size_of::<Sender<'static, Answer>>()),
        part(offset_of!(Control, trace), size_of::<Recorder<'static, { board::TRACE_RECORDS }>>()),
    ];
    (constants, (control + drive + Drive::CHANGES) as u32)
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<MaybeUninit<Running>>);

// SAFETY: shared between contexts, but not at one time: `Control::run` writes it before it unmasks
// the interrupt, and after that only the interrupt touches it, which cannot interrupt itself. (The check of
// the memory looks at words of it, without a reference; see `memory::word`.)
unsafe impl Sync for Owned {}

// SAFETY: a section of memory.x for data that nobody initialises, which `MaybeUninit` allows for.
#[unsafe(link_section = ".ccm_data")]
static RUNNING: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

struct Running {
    control: Control,
    periods: u32,
    worst_cycles: u32,
    worst_latency: u32,
    /// Whether the period before took too long.
    late: Hardware,
    /// Whether an analog watchdog has seen an over-current since the period before.
    over: Hardware,
    seen: Hardware,
    /// Cycle count at the start of the period before.
    began: u32,
    /// The state that was last reported.
    reported: Option<State>,
}

#[interrupt]
fn ADC1_2() {
    // SAFETY: see `Owned`; written before the interrupt was unmasked, and the reference ends with this
    // function.
    unsafe { (*RUNNING.0.get()).assume_init_mut() }.period();
}

// Not inlined: the interrupt would have to save registers for it in every period.
#[inline(never)]
fn take_order(
    drive: &mut Drive,
    orders: &mut Receiver<'static, Command>,
    answers: &mut Sender<'static, Answer>,
) {
    if let Some(answer) = orders.take_with(|order| drive.command(order)) {
        // There is room: the main loop takes the last answer before it sends an order.
        answers.send(answer);
    }
}

/// Whether the outputs are off, and stay off until the next order.
fn is_off(drive: &Drive) -> bool {
    matches!(drive.state(), State::Off | State::Fault(_))
}

impl Running {
    fn period(&mut self) {
        let began = DWT::cycle_count();
        let Control { drive, pwm, adc, encoder, orders, answers, trace, seen, .. } =
            &mut self.control;

        // Over-current first: the outputs are off before anything is computed. The analog watchdogs ask
        // when the current is converted, before the sequence has ended.
        let converters = adc.look();
        if converters.over_current {
            pwm.trip();
            self.over = Hardware::ANALOG_WATCHDOG;
        }
        if !converters.ended {
            return;
        }

        // The timer counts down since it was at the top, where the sampling ended and an update came; one
        // period ago it was there before. Anything else is a period that was skipped, or came late.
        let timer = pwm.look();
        let since_top = pwm.since_top();
        let since_last = began.wrapping_sub(core::mem::replace(&mut self.began, began));
        // (The first has waited for the interrupt to be let run.)
        if self.periods > 0
            && (!timer.updated
                || since_top > u32::from(board::PWM_TOP)
                || since_last > 3 * u32::from(board::PWM_TOP))
        {
            self.late = Hardware::DEADLINE_MISS;
        }
        let mut hardware = self.late | self.over;
        self.over = Hardware::empty();
        if timer.pulled {
            hardware |= Hardware::BREAK;
        }
        if !converters.complete {
            hardware |= Hardware::CONVERTER_OVERRUN;
        }
        let codes = adc.read();
        let sample = Sample {
            current_a: codes.current_a,
            current_b: codes.current_b,
            dc_link: codes.dc_link,
            heat_sink: codes.heat_sink,
            encoder: encoder.count(),
            hardware,
        };

        let was_off = is_off(drive);
        pwm.apply(drive.step(&sample));

        // The timer was at its top again before all compare values were written.
        self.late = Hardware::empty();
        if pwm.updated() {
            self.late = Hardware::DEADLINE_MISS;
        }
        let latency = since_top.saturating_sub(board::SAMPLES_READY_TICKS);
        if self.periods > 0 && latency > self.worst_latency {
            self.worst_latency = latency;
        }
        // With the outputs off a miss harms nobody, and is only told.
        let missed = (hardware | self.late).contains(Hardware::DEADLINE_MISS);
        if missed && !was_off {
            pwm.trip();
            MISSED.store(true, Ordering::Relaxed);
        }

        // An order comes between two steps: it acts from the next one on.
        if orders.is_waiting() {
            take_order(drive, orders, answers);
        }
        IS_OFF.store(is_off(drive), Ordering::Relaxed);
        trace.step(|| drive.telemetry());
        if drive.tracks_rotor() {
            // Without room it is missing, which the main loop sees.
            seen.push(Seen::new(self.periods, &drive.telemetry()));
        }

        self.seen |= hardware;
        self.periods = self.periods.wrapping_add(1);
        PERIODS.store(self.periods, Ordering::Relaxed);
        let cycles = DWT::cycle_count().wrapping_sub(began);
        if cycles > self.worst_cycles {
            self.worst_cycles = cycles;
        }
        // A new state is reported at once.
        if self.reported != Some(self.control.drive.state())
            || self.periods.is_multiple_of(board::PERIODS_PER_STATUS)
        {
            self.report(sample, cycles);
        }
    }

    /// Reports to the main loop. It may be slow or hang; then this status is lost, but not its events.
    // Not inlined: the interrupt would have to save registers for it in every period.
    #[inline(never)]
    fn report(&mut self, sample: Sample, cycles: u32) {
        let Control { drive, status, learned, .. } = &mut self.control;
        let state = drive.state();
        if self.reported == Some(State::Learning)
            && let Some(found) = drive.learned()
        {
            // There is room: the main loop takes it at once, the next comes a minute later.
            learned.send(Some(*found));
        }
        let sent = status.send_with(|report| {
            report.periods = self.periods;
            report.state = state;
            report.sample = sample;
            report.telemetry = drive.telemetry();
            report.worst_cycles = self.worst_cycles;
            report.last_cycles = cycles;
            report.worst_latency = self.worst_latency;
            report.hardware = self.seen;
        });
        if sent {
            self.seen = Hardware::empty();
            self.reported = Some(state);
        }
    }
}
