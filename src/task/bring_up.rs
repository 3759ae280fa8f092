//! From reset to a running control interrupt.

use core::mem::MaybeUninit;
use core::sync::atomic::Ordering;

use cortex_m::{asm, singleton};
use drive_core::learned::Learned;
use drive_core::{Accepted, Coefficients, Command, Drive, Stop};
use drive_settings::SettingsError;
use stm32g4xx_hal::gpio::GpioExt;
use stm32g4xx_hal::pac;

use crate::task::control;
use crate::task::sources::Sources;
use crate::task::supervisor::{Chip, ControlLink, Supervisor};
use induction_drive::board;
use induction_drive::boards::SELECTED;
use induction_drive::chip::StartError;
use induction_drive::chip::flash::Pages;
use induction_drive::chip::stage::Stage;
use induction_drive::chip::watchdog::Watchdog;
use induction_drive::chip::window::Window;
use induction_drive::chip::{adc, clocks, dc_link, encoder, memory, over_voltage, pwm, stop, time};
use induction_drive::commissioning::Session;
use induction_drive::console::Lpuart;
use induction_drive::front::Front;
use induction_drive::history::Hours;
use induction_drive::link::mailbox::Mailbox;
use induction_drive::link::{Answer, Status};
use induction_drive::modbus;
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::monitor::watchdog::{FeedRule, Verdict, WINDOW_CYCLES};
use induction_drive::recording::ring::{self, Ring};
use induction_drive::recording::trace::Trace;
use induction_drive::settings::FirmwareSettings;
use induction_drive::store::Saved;
use induction_drive::store::codec::Rejected;
use induction_drive::terminals;

/// The parts that the main loop works with.
pub struct Board<'a> {
    /// Command arbiter, console and field bus, with the saved settings, or the defaults.
    pub front: &'static mut Front,
    /// The serial port of the console.
    pub port: Lpuart,
    /// The port of the field bus, if the board has one.
    pub line: Option<modbus::Usart>,
    /// The terminals, with the slow analog inputs.
    pub contacts: terminals::Pins,
    /// The drive.
    pub supervisor: &'a mut Supervisor,
}

const TWICE: StartError = "started twice";

/// Sets everything up and starts the control interrupt. If the drive cannot be started, the outputs stay off, the log
/// states the reason, and the console answers that the control does not run.
///
/// # Errors
/// On a second call.
#[inline(never)] // like the functions that it calls, so that their stacks share memory
pub fn bring_up(supervisor: &mut MaybeUninit<Supervisor>) -> Result<Board<'_>, StartError> {
    let mut core = cortex_m::Peripherals::take().ok_or(TWICE)?;
    let chip = pac::Peripherals::take().ok_or(TWICE)?;
    let (cause, record, resets) = last_run(&chip.RCC);
    let options = chip.FLASH.optr().read();
    let (options, dual_bank) = (options.bits(), options.dbank().is_dual_bank_mode());
    defmt::info!(
        "build {=[u8]:02x}, reset by {}, {} unintended in a row; option bytes {:08x}, {} bank(s)",
        memory::build_id(),
        cause,
        resets,
        options,
        if dual_bank { 2 } else { 1 },
    );
    if let Some(record) = &record {
        defmt::error!("the last run ended with {}", defmt::Display2Format(record));
    }
    memory::guard_stack(&mut core.MPU);
    let (mut rcc, source, clocked) = clocks::start(chip.RCC, chip.PWR, &chip.FLASH);
    if source == clocks::Source::Internal {
        defmt::warn!("the crystal does not start: on the internal oscillator, 1 % accurate");
    }
    let timed = time::start(chip.TIM5, &mut rcc, &chip.DBGMCU);
    // The cycle counter measures the control interrupt, during which the core does not sleep.
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();

    let mut start = load(Pages::new(chip.FLASH), dual_bank);
    start.settings.boot_pin_counts = board::boot_pin_counts(options);
    let timer = board::Timer::of(&start.settings.drive.inverter);

    // Enables the clocks of the ports; `pins` does the rest.
    chip.GPIOA.split(&mut rcc);
    chip.GPIOB.split(&mut rcc);
    chip.GPIOC.split(&mut rcc);
    // The power stage comes first, because the drivers are switched off from here on. Its pins are connected only if the user has
    // confirmed that the image is for this board.
    let pwm = pwm::Pwm::new(chip.TIM1, &mut rcc, &chip.DBGMCU, &chip.SYSCFG, &timer);
    let connected = pwm.is_ok() && start.settings.board_is_confirmed();
    if connected {
        pwm::connect_gates();
    }
    let dc_link = dc_link::DcLink::new(chip.TIM8, &mut rcc, &chip.DBGMCU);
    let clock_hz = if clocked.is_ok() { board::CLOCK_HZ } else { board::HSI_HZ };
    let port = Lpuart::new(chip.LPUART1, &mut core.NVIC, &mut rcc, clock_hz).ok_or(TWICE)?;
    let line = SELECTED
        .bus
        .and_then(|wires| modbus::Usart::new(chip.USART3, &wires, &mut core.NVIC, &mut rcc));
    let contacts = terminals::Pins::new(chip.ADC3, chip.ADC4, &chip.ADC345_COMMON, &mut rcc);
    let encoder = encoder::Encoder::new(chip.TIM2, &mut rcc);
    // Made before the control runs, because these are made with the interrupts masked.
    let front = singleton!(: MaybeUninit<Front> = MaybeUninit::uninit()).ok_or(TWICE)?;
    let commissioning = singleton!(: MaybeUninit<Session> = MaybeUninit::uninit()).ok_or(TWICE)?;
    let commissioning = make(commissioning, || Session::new(&start.settings.drive));
    let window = Window::new(chip.WWDG, &mut rcc);
    let link = apart(|| -> Result<ControlLink, StartError> {
        let mut pwm = pwm?;
        clocked?;
        board::check_options(options)?;
        timed?;
        let coefficients = start.build(&timer);
        if let Some(why) = &start.rejected {
            defmt::error!("{}", defmt::Display2Format(why));
        }
        // Computed after the design, which may have replaced refused settings by the defaults.
        let protection = board::protection(SELECTED, &start.settings.drive);
        over_voltage::watch(&chip.DAC3, &chip.COMP, &mut rcc, &mut pwm, protection.over_voltage)?;
        let (one, two) = (chip.ADC1, chip.ADC2);
        let adc = adc::Adc::new(one, two, &chip.ADC12_COMMON, &mut rcc, &protection);
        if resets > board::MOST_RESETS {
            return Err("too many unintended resets; switch the supply off and on");
        }
        start_control(coefficients, pwm, dc_link?, adc?, encoder?, window?, source)
    });
    if let Err(error) = &link {
        defmt::error!("the drive is not started, outputs stay off: {=str}", error);
    }
    // Only with a running control: without it the outputs stay off.
    let watchdog = link.is_ok().then(|| Watchdog::start(chip.IWDG, chip.DBGMCU, &control::PERIODS));
    let front = make(front, || Front::new(start.settings));
    let Start { saved, hours, ref settings, rejected } = start;
    commissioning.configured(&settings.drive);
    let not_started = link.as_ref().err().copied();
    if let Some(Rejected::Board(theirs)) = rejected {
        front.desk.saved_on = Some(theirs);
    }
    let chip =
        Chip { cause, record, options, dual_bank, saved, rejected, timer, not_started, connected };
    let link = link.ok();
    let drive = &settings.drive;
    let supervisor = Supervisor::new(supervisor, link, watchdog, chip, hours, commissioning, drive);
    Ok(Board { front, port, line, contacts, supervisor })
}

/// Calls a function whose stack shares memory with those of other functions.
#[inline(never)]
fn apart<T>(call: impl FnOnce() -> T) -> T {
    call()
}

/// Makes a value in its place, with a stack that shares memory with those of other functions.
#[inline(never)]
fn make<T>(place: &'static mut MaybeUninit<T>, value: impl FnOnce() -> T) -> &'static mut T {
    place.write(value())
}

/// The stored pages at start. All of them are read before an error of the flash triggers the break, because a power failure may have torn
/// any of them.
struct Start {
    saved: Saved<Pages>,
    hours: Hours,
    settings: FirmwareSettings,
    /// Reason why the saved settings were rejected, if they were.
    rejected: Option<Rejected>,
}

/// The saved settings, or the defaults.
#[inline(never)]
fn load(pages: Pages, dual_bank: bool) -> Start {
    let defaults = FirmwareSettings::of_the_board();
    let (mut saved, loaded) = Saved::load(pages, &defaults);
    let hours = Hours::load(saved.flash(), dual_bank);
    let (mut settings, mut rejected) = match loaded {
        Ok(found) => (found.unwrap_or(defaults), None),
        Err(why) => (defaults, Some(why)),
    };
    // The settings of the power stage are checked first; the others take longer.
    if settings.check().is_err() {
        (settings, rejected) = (defaults, Some(Rejected::Refused));
    }
    Start { saved, hours, settings, rejected }
}

impl Start {
    /// Computes the coefficients, which takes seconds, for the timer. If the design rules refuse the saved settings, the defaults apply.
    #[inline(never)]
    fn build(&mut self, timer: &board::Timer) -> Result<Coefficients, SettingsError> {
        let built = self.settings.build_for(timer);
        if built.is_ok() {
            return built;
        }
        self.refuse();
        self.settings.build_for(timer)
    }

    /// Replaces the settings by the defaults.
    #[inline(never)]
    fn refuse(&mut self) {
        self.settings = FirmwareSettings::of_the_board();
        self.rejected = Some(Rejected::Refused);
    }
}

/// Cause of the reset, record of the last run, and number of consecutive unintended resets.
fn last_run(rcc: &pac::RCC) -> (&'static str, Option<Record>, u32) {
    let flags = rcc.csr().read();
    // The most specific cause comes first, because every reset pulls the reset pin as well.
    let causes = [
        (flags.wwdgrstf().is_reset(), "window watchdog"),
        (flags.iwdgrstf().is_reset(), "watchdog"),
        (flags.sftrstf().is_reset(), "software"),
        (flags.oblrstf().is_reset(), "option bytes"),
        (flags.lpwrrstf().is_reset(), "low-power"),
        (flags.borrstf().is_reset(), "power-on"),
    ];
    let cause = causes.iter().find(|cause| cause.0).map_or("reset pin", |cause| cause.1);
    let record = stop::take_record();
    // A fault of the drive does not reset the chip: a software reset after it comes from the debug probe.
    let stopped = record.is_some_and(|record| record.reason != Reason::Drive);
    let watchdog = flags.wwdgrstf().is_reset() || flags.iwdgrstf().is_reset();
    let unintended = watchdog || (flags.sftrstf().is_reset() && stopped);
    rcc.csr().modify(|_, w| w.rmvf().clear());
    (cause, record, stop::count_reset(unintended))
}

/// Waits until the control interrupt satisfies the rule of the watchdog, which is started then; `false` if it does not in time. If the
/// watchdog were started over an interrupt that does not satisfy it, it would reset the chip again and again.
fn comes_at_its_rate() -> bool {
    let now = || (time::now(), control::PERIODS.load(Ordering::Relaxed));
    let (began, periods) = now();
    let mut rule = FeedRule::new(began, periods);
    loop {
        asm::delay(WINDOW_CYCLES);
        let (cycles, periods) = now();
        if rule.judge(cycles, periods, false) == Verdict::Feed {
            return true;
        }
        rule = FeedRule::new(cycles, periods);
        if cycles.wrapping_sub(began) > board::INTERRUPT_TIMEOUT_US * board::CYCLES_PER_US {
            return false;
        }
    }
}

/// Creates the drive and hands it to the control interrupt.
// Not inlined: it builds the drive on its stack, 6 KiB, which `main` would otherwise keep forever.
#[inline(never)]
fn start_control(
    coefficients: Result<Coefficients, SettingsError>,
    mut pwm: pwm::Pwm,
    dc_link: dc_link::DcLink,
    mut adc: adc::Adc,
    encoder: encoder::Encoder,
    window: Window,
    source: clocks::Source,
) -> Result<ControlLink, StartError> {
    let coefficients = coefficients.map_err(|error| {
        defmt::error!("settings: {}", defmt::Display2Format(&error));
        "the design rules refuse the settings"
    })?;
    let status = singleton!(: Mailbox<Status> = Mailbox::new(Status::default())).ok_or(TWICE)?;
    let commands =
        singleton!(: Mailbox<Command> = Mailbox::new(Command::Stop(Stop::Coast))).ok_or(TWICE)?;
    let answers =
        singleton!(: Mailbox<Answer> = Mailbox::new(Ok(Accepted::AsGiven))).ok_or(TWICE)?;
    let learned = singleton!(: Mailbox<Option<Learned>> = Mailbox::new(None)).ok_or(TWICE)?;
    // The memory has a name, so that `cargo xtask size` can tell it from the rest.
    static TRACE_MEMORY: Trace<{ board::TRACE_RECORDS }> = Trace::new();
    let (send_status, status) = status.split();
    let (commands, receive_commands) = commands.split();
    let (send_answers, answers) = answers.split();
    let (send_learned, learned) = learned.split();
    let (recorder, trace) = TRACE_MEMORY.take().ok_or(TWICE)?;
    let ring = singleton!(: Ring<{ ring::PERIODS }> = Ring::new()).ok_or(TWICE)?;
    let (signals, reported) = ring.split();

    adc.convert_both(coefficients.front_end.both_zero_vectors);
    pwm.start()?;
    let drive = Drive::new(coefficients);
    control::Control {
        drive,
        stage: Stage::new(pwm, dc_link, adc, encoder, window),
        status: send_status,
        commands: receive_commands,
        answers: send_answers,
        learned: send_learned,
        trace: recorder,
        signals,
    }
    .run();
    if !comes_at_its_rate() {
        return Err("the control interrupt does not come at its rate");
    }
    let sources = Sources::new(source)?;
    control::FAULTS_FROM_MAIN.store(control::WINDOW_ON, Ordering::Relaxed);
    asm::delay(1000 * board::CYCLES_PER_US);
    Window::close();
    let (streamed, observed) = (reported.clone(), reported.clone());
    Ok(ControlLink {
        status,
        commands,
        answers,
        learned,
        trace,
        streamed,
        observed,
        reported,
        sources,
    })
}
