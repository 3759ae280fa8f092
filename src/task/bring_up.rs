//! From reset to a running control interrupt.

use core::sync::atomic::Ordering;

use cortex_m::singleton;
use drive_core::identify::learning::Learned;
use drive_core::settings::SettingsError;
use drive_core::{Accepted, Coefficients, Command, Drive};
use heapless::spsc::Queue;
use stm32g4xx_hal::gpio::GpioExt;
use stm32g4xx_hal::pac;

use crate::chip::flash::Pages;
use crate::chip::serial::Port;
use crate::chip::watchdog::Watchdog;
use crate::chip::{adc, clocks, encoder, memory, over_voltage, pwm, stop, time};
use crate::task::control;
use crate::task::supervisor::{Chip, ControlLink, Supervisor};
use induction_drive::board;
use induction_drive::boards::SELECTED;
use induction_drive::link::mailbox::Mailbox;
use induction_drive::link::trace::Trace;
use induction_drive::link::{Answer, Status};
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::monitor::watchdog::{FeedRule, Verdict};
use induction_drive::rotor_tracking::{Observation, Tracking};
use induction_drive::settings::FirmwareSettings;
use induction_drive::store::codec::Rejected;
use induction_drive::store::{Loaded, Saved};

/// The parts that the main loop works with.
pub struct Board {
    /// The saved settings, or the defaults.
    pub settings: FirmwareSettings,
    /// The serial port of the console.
    pub port: Port,
    /// The drive.
    pub supervisor: Supervisor,
}

/// Reason why the drive was not started.
#[derive(Clone, Copy)]
pub enum StartError {
    /// The firmware started twice.
    Twice,
    /// The flash is set to one bank: a save would stop the control interrupt.
    OneBank,
    /// Supply or clock are not as they were set.
    Clock(clocks::ClockError),
    /// TIM2 or TIM5 has no clock.
    NoTimer,
    /// The over-voltage protection does not work.
    OverVoltage(over_voltage::SelfTestError),
    /// The design rules refuse the settings.
    Settings,
    /// A converter does not respond.
    Converter(adc::AdcError),
    /// Too many consecutive unintended resets; a power cycle or the reset pin tries again.
    Resets,
    /// The timer of the power stage does not work.
    Timer(pwm::PwmError),
    /// The control interrupt does not come at its rate: the timer does not trigger the converters.
    Interrupt,
}

impl StartError {
    /// The reason in words.
    const fn text(self) -> &'static str {
        use adc::AdcError as Converter;
        use clocks::ClockError as Clock;
        use over_voltage::SelfTestError as Protection;
        use pwm::PwmError as Timer;
        match self {
            Self::Twice => "started twice",
            Self::OneBank => "option bytes: the flash has one bank; set DBANK to 1",
            Self::Clock(Clock::PowerController) => "the power controller takes no writes",
            Self::Clock(Clock::Boost) => "the core voltage is not boosted, which 170 MHz need",
            Self::Clock(Clock::SupplyMonitor) => "the supply monitor does not read back",
            Self::Clock(Clock::WaitStates) => "too few wait states of the flash",
            Self::NoTimer => "a timer has no clock",
            Self::OverVoltage(Protection::NoClock) => "self-test: DAC3 or COMP1 has no clock",
            Self::OverVoltage(Protection::LevelNotReady) => "self-test: DAC3 is not ready",
            Self::OverVoltage(Protection::DoesNotTrip) => {
                "self-test: the over-voltage comparator does not trip at the level zero"
            }
            Self::OverVoltage(Protection::NoBreak) => {
                "self-test: the over-voltage comparator does not reach the break of TIM1"
            }
            Self::OverVoltage(Protection::AlwaysTrips) => {
                "self-test: the over-voltage comparator trips at its own level: dc link too high, its wire off, or no level"
            }
            Self::Settings => "the design rules refuse the settings",
            Self::Converter(Converter::NoClock) => "the converters have no clock",
            Self::Converter(Converter::Calibration) => "a converter does not calibrate",
            Self::Converter(Converter::Enabling) => "a converter does not start",
            Self::Resets => "too many unintended resets; switch the supply off and on",
            Self::Timer(Timer::WrongAddress) => "TIM1 is not where the fault handler expects it",
            Self::Timer(Timer::NoClock) => "TIM1 has no clock",
            Self::Timer(Timer::NotInStep) => "TIM1 does not run in step",
            Self::Timer(Timer::NotLocked) => {
                "dead time, polarity, break or lock of TIM1 do not read back"
            }
            Self::Interrupt => "the control interrupt does not come at its rate",
        }
    }
}

/// Sets everything up and starts the control interrupt. If the drive cannot be started, the outputs stay off, the log
/// states the reason, and the console answers that the control does not run.
///
/// # Errors
/// [`StartError::Twice`] on a second call.
pub fn bring_up() -> Result<Board, StartError> {
    let mut core = cortex_m::Peripherals::take().ok_or(StartError::Twice)?;
    let chip = pac::Peripherals::take().ok_or(StartError::Twice)?;
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
    // The cycle counter measures the control interrupt, while which the core does not sleep.
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();

    let mut start = load(Pages::new(chip.FLASH));
    let (dead_time_code, dead_time_s) = board::dead_time(start.settings.drive.inverter.dead_time_s);

    let a = chip.GPIOA.split(&mut rcc);
    let b = chip.GPIOB.split(&mut rcc);
    // Port C as well: its clock.
    let _ = chip.GPIOC.split(&mut rcc);
    // First, because the drivers are switched off from here on.
    let pwm = pwm::Pwm::new(chip.TIM1, &mut rcc, &chip.DBGMCU, &chip.SYSCFG, dead_time_code);
    let port = Port::new(chip.LPUART1, (a.pa2, a.pa3), &mut core.NVIC, &mut rcc)
        .ok_or(StartError::Twice)?;
    let encoder = encoder::Encoder::new(chip.TIM2, a.pa15, b.pb3, &mut rcc);
    let link = || -> Result<ControlLink, StartError> {
        let mut pwm = pwm.map_err(StartError::Timer)?;
        clocked.map_err(StartError::Clock)?;
        if !dual_bank {
            return Err(StartError::OneBank);
        }
        let encoder = encoder.filter(|_| timed).ok_or(StartError::NoTimer)?;
        let coefficients = start.build(dead_time_s);
        // After the design, which may have replaced refused settings by the defaults.
        let protection = board::protection(SELECTED, &start.settings.drive);
        over_voltage::watch(&chip.DAC3, &chip.COMP, &mut rcc, &mut pwm, protection.over_voltage)
            .map_err(StartError::OverVoltage)?;
        let (one, two) = (chip.ADC1, chip.ADC2);
        let adc = adc::Adc::new(one, two, &chip.ADC12_COMMON, &mut rcc, &protection);
        start_control(coefficients, pwm, adc.map_err(StartError::Converter)?, encoder, resets)
    }();
    if let Err(error) = &link {
        defmt::error!("the drive is not started, outputs stay off: {=str}", error.text());
    }
    // Only with a running control: without it the outputs stay off.
    let watchdog = link.is_ok().then(|| Watchdog::start(chip.IWDG, &chip.DBGMCU));
    let Start { saved, settings, rejected } = start;
    let tracking = singleton!(: Option<Tracking> = None).ok_or(StartError::Twice)?;
    *tracking = Tracking::new(&settings.drive);
    let not_started = link.as_ref().err().map(|error| error.text());
    let chip =
        Chip { cause, record, options, dual_bank, saved, rejected, dead_time_s, not_started };
    let supervisor = Supervisor::new(link.ok(), watchdog, chip, tracking, &settings.drive);
    Ok(Board { settings, port, supervisor })
}

/// Settings at start.
struct Start {
    saved: Saved<Pages>,
    settings: FirmwareSettings,
    /// Reason why the saved settings were rejected, if they were.
    rejected: Option<Rejected>,
}

/// The saved settings, or the defaults.
fn load(pages: Pages) -> Start {
    let defaults = FirmwareSettings::of_the_board();
    let (saved, loaded) = Saved::load(pages, &defaults);
    let (mut settings, mut rejected) = match loaded {
        Loaded::Settings(settings) => (settings, None),
        Loaded::Rejected(why) => (defaults, Some(why)),
        Loaded::Nothing => (defaults, None),
    };
    // Settings of the power stage first; the others take longer to check.
    if settings.check().is_err() {
        (settings, rejected) = (defaults, Some(Rejected::Refused));
    }
    Start { saved, settings, rejected }
}

impl Start {
    /// Computes the coefficients, which takes seconds, for the dead time of the timer, s. If the design rules refuse
    /// the saved settings, the defaults hold.
    fn build(&mut self, dead_time_s: f32) -> Result<Coefficients, SettingsError> {
        let built = self.settings.build_for(dead_time_s).or_else(|_| {
            (self.settings, self.rejected) =
                (FirmwareSettings::of_the_board(), Some(Rejected::Refused));
            self.settings.build_for(dead_time_s)
        });
        if let Some(why) = self.rejected {
            defmt::error!("{}", defmt::Display2Format(&why));
        }
        built
    }
}

/// Cause of the reset, record of the last run, and number of consecutive unintended resets.
fn last_run(rcc: &pac::RCC) -> (&'static str, Option<Record>, u32) {
    let flags = rcc.csr().read();
    // The most specific cause first: every reset pulls the reset pin as well.
    let cause = if flags.iwdgrstf().is_reset() {
        "watchdog"
    } else if flags.sftrstf().is_reset() {
        "software"
    } else if flags.oblrstf().is_reset() {
        "option bytes"
    } else if flags.lpwrrstf().is_reset() {
        "low-power"
    } else if flags.borrstf().is_reset() {
        "power-on"
    } else {
        "reset pin"
    };
    let record = stop::take_record();
    // A fault of the drive does not reset the chip: after it, a reset by software comes from the debug probe.
    let stopped = record.is_some_and(|record| record.reason != Reason::Drive);
    let unintended = flags.iwdgrstf().is_reset() || (flags.sftrstf().is_reset() && stopped);
    rcc.csr().modify(|_, w| w.rmvf().clear());
    (cause, record, stop::count_reset(unintended))
}

/// Waits until the control interrupt satisfies the rule of the watchdog, which is started then; `false` if it does not in
/// time. A watchdog over an interrupt that does not would reset the chip again and again.
fn comes_at_its_rate() -> bool {
    let now = || (time::now(), control::PERIODS.load(Ordering::Relaxed));
    let (began, periods) = now();
    let mut rule = FeedRule::new(began, periods);
    loop {
        let (cycles, periods) = now();
        match rule.judge(cycles, periods, false) {
            Verdict::Feed => return true,
            Verdict::Wait => {}
            Verdict::Refuse { .. } => rule = FeedRule::new(cycles, periods),
        }
        if cycles.wrapping_sub(began) > board::INTERRUPT_TIMEOUT_US * board::CYCLES_PER_US {
            return false;
        }
    }
}

/// Creates the drive and hands it to the control interrupt.
// Not inlined: it makes the drive on its stack, 6 KiB, which `main` would keep for ever.
#[inline(never)]
fn start_control(
    coefficients: Result<Coefficients, SettingsError>,
    mut pwm: pwm::Pwm,
    adc: adc::Adc,
    encoder: encoder::Encoder,
    resets: u32,
) -> Result<ControlLink, StartError> {
    if resets > board::MOST_RESETS {
        return Err(StartError::Resets);
    }
    let coefficients = coefficients.map_err(|error| {
        defmt::error!("settings: {}", defmt::Display2Format(&error));
        StartError::Settings
    })?;
    let status =
        singleton!(: Mailbox<Status> = Mailbox::new(Status::default())).ok_or(StartError::Twice)?;
    let commands =
        singleton!(: Mailbox<Command> = Mailbox::new(Command::Stop)).ok_or(StartError::Twice)?;
    let answers = singleton!(: Mailbox<Answer> = Mailbox::new(Ok(Accepted::AsGiven)))
        .ok_or(StartError::Twice)?;
    let learned =
        singleton!(: Mailbox<Option<Learned>> = Mailbox::new(None)).ok_or(StartError::Twice)?;
    // Named, so that `cargo xtask size` can tell it from the rest.
    static TRACE_MEMORY: Trace<{ board::TRACE_RECORDS }> = Trace::new();
    let (send_status, status) = status.split();
    let (commands, receive_commands) = commands.split();
    let (send_answers, answers) = answers.split();
    let (send_learned, learned) = learned.split();
    let (recorder, trace) = TRACE_MEMORY.take().ok_or(StartError::Twice)?;
    let observations = singleton!(: Queue<Observation, { board::OBSERVED_PERIODS }> = Queue::new());
    let (send_observations, observations) = observations.ok_or(StartError::Twice)?.split();

    pwm.start().map_err(StartError::Timer)?;
    let drive = Drive::new(coefficients);
    control::Control {
        drive,
        pwm,
        adc,
        encoder,
        status: send_status,
        commands: receive_commands,
        answers: send_answers,
        learned: send_learned,
        trace: recorder,
        observations: send_observations,
    }
    .run();
    if !comes_at_its_rate() {
        return Err(StartError::Interrupt);
    }
    Ok(ControlLink { status, commands, answers, learned, trace, observations })
}
