//! From reset to a running control interrupt.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::DWT;
use cortex_m::singleton;
use drive_core::identify::learning::Learned;
use drive_core::settings::SettingsError;
use drive_core::{Accepted, Coefficients, Command, Drive};
use stm32g4xx_hal::gpio::GpioExt;
use stm32g4xx_hal::pac;

use crate::chip::flash::Pages;
use crate::chip::serial::Port;
use crate::chip::{adc, clocks, encoder, memory, over_voltage, pwm, stop};
use crate::task::control;
use crate::task::supervisor::{Chip, Ends, Supervisor};
use induction_drive::board;
use induction_drive::console::keys::FirmwareSettings;
use induction_drive::link::mailbox::Mailbox;
use induction_drive::link::ring::Ring;
use induction_drive::link::trace::Trace;
use induction_drive::link::{Answer, Status};
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::monitor::watchdog::{Rule, Verdict, Watchdog};
use induction_drive::rotor_tracking::{Seen, Tracking};
use induction_drive::store::{Loaded, NotUsed, Saved};

/// What the main loop works with.
pub struct Board {
    /// What is set: what was saved, or the defaults.
    pub settings: FirmwareSettings,
    /// The serial port of the console.
    pub port: Port,
    /// The drive.
    pub supervisor: Supervisor,
}

/// Why the drive was not started.
#[derive(Clone, Copy, defmt::Format)]
enum NotStarted {
    /// The firmware started twice.
    Twice,
    /// The settings make no drive.
    Settings,
    /// A converter.
    Converter(adc::Stuck),
    /// Too many resets in a row; a power cycle or the reset pin tries again.
    Resets,
    /// The timer of the power stage.
    Timer(pwm::NotInStep),
    /// The control interrupt does not come as it should: the timer does not trigger the converters.
    Interrupt,
}

/// Sets everything up and starts the control interrupt. If something is wrong with the drive, the
/// outputs stay off and the console says so.
pub fn bring_up() -> Board {
    match (cortex_m::Peripherals::take(), pac::Peripherals::take()) {
        (Some(core), Some(chip)) => with(core, chip),
        _ => unreachable!("main runs once"),
    }
}

fn with(mut core: cortex_m::Peripherals, chip: pac::Peripherals) -> Board {
    let (cause, record, resets) = last_run(&chip.RCC);
    let options = chip.FLASH.optr().read();
    let (options, dual_bank) = (options.bits(), options.dbank().is_dual_bank_mode());
    defmt::info!(
        "build {=[u8]:02x}, reset by {}, {} unwished in a row; option bytes {:08x}, {} bank(s)",
        memory::build_id(),
        cause,
        resets,
        options,
        if dual_bank { 2 } else { 1 },
    );
    if let Some(record) = &record {
        defmt::error!("the last run ended with {}", defmt::Display2Format(record));
    }
    let (mut rcc, source) = clocks::start(chip.RCC, chip.PWR, &chip.FLASH);
    if source == clocks::Source::Internal {
        defmt::warn!("the crystal does not start: on the internal oscillator, 1 % accurate");
    }
    // Keep the debug port alive while the core sleeps.
    chip.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    // The cycle counter measures the control interrupt and is the main loop's clock.
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();

    let mut start = load(Pages::new(chip.FLASH));
    let (dead_time_code, dead_time_s) = board::dead_time(start.settings.drive.inverter.dead_time_s);

    let a = chip.GPIOA.split(&mut rcc);
    let b = chip.GPIOB.split(&mut rcc);
    let c = chip.GPIOC.split(&mut rcc);
    let pwm_pins =
        pwm::Pins { high: (a.pa8, a.pa9, a.pa10), low: (a.pa7, b.pb0, b.pb1), fault: a.pa6 };
    let adc_pins =
        adc::Pins { current_a: a.pa0, current_b: c.pc1, dc_link: a.pa1, heat_sink: c.pc2 };

    // First of all: the gates are driven low from here on.
    over_voltage::watch(&chip.DAC3, &chip.COMP, &mut rcc);
    let pwm =
        pwm::Pwm::new(chip.TIM1, pwm_pins, &mut rcc, &chip.DBGMCU, &chip.SYSCFG, dead_time_code);
    let Some(port) = Port::new(chip.LPUART1, (a.pa2, a.pa3), &mut core.NVIC, &mut rcc) else {
        unreachable!("main runs once")
    };
    let encoder = encoder::Encoder::new(chip.TIM2, a.pa15, b.pb3, &mut rcc);
    let ends = adc::Adc::new(chip.ADC1, chip.ADC2, &chip.ADC12_COMMON, adc_pins, &mut rcc)
        .map_err(NotStarted::Converter)
        .and_then(|adc| start_control(start.build(dead_time_s), pwm, adc, encoder, resets));
    if let Err(error) = &ends {
        defmt::error!("the drive is not started, outputs stay off: {}", error);
    }
    // Only over a control that runs: without it the outputs stay off.
    let watchdog = ends.is_ok().then(|| Watchdog::start(chip.IWDG, &chip.DBGMCU));
    let Start { saved, settings, not_used } = start;
    let Some(tracking) = singleton!(: Option<Tracking> = None) else {
        unreachable!("main runs once")
    };
    *tracking = Tracking::new(&settings.drive);
    let chip = Chip { cause, record, options, dual_bank, saved, not_used, dead_time_s };
    Board { settings, port, supervisor: Supervisor::new(ends.ok(), watchdog, chip, tracking) }
}

/// What the drive starts with.
struct Start {
    saved: Saved<Pages>,
    settings: FirmwareSettings,
    /// Why what was saved is not used, if it is not.
    not_used: Option<NotUsed>,
}

/// The settings that were saved, or the defaults and why.
fn load(pages: Pages) -> Start {
    let defaults = FirmwareSettings::of_the_board();
    let (saved, loaded) = Saved::load(pages, &defaults);
    let (mut settings, mut not_used) = match loaded {
        Loaded::Settings(settings) => (settings, None),
        Loaded::NotUsed(why) => (defaults, Some(why)),
        Loaded::Nothing => (defaults, None),
    };
    // What the power stage needs to know first; the rest takes longer to check.
    if settings.check().is_err() {
        (settings, not_used) = (defaults, Some(NotUsed::Refused));
    }
    Start { saved, settings, not_used }
}

impl Start {
    /// Runs the design rules, which takes a while, for the dead time that the timer makes, s. If they do
    /// not take what was saved, the defaults hold.
    fn build(&mut self, dead_time_s: f32) -> Result<Coefficients, SettingsError> {
        let built = self.settings.build_for(dead_time_s).or_else(|_| {
            (self.settings, self.not_used) =
                (FirmwareSettings::of_the_board(), Some(NotUsed::Refused));
            self.settings.build_for(dead_time_s)
        });
        if let Some(why) = self.not_used {
            defmt::error!("{}", defmt::Display2Format(&why));
        }
        built
    }
}

/// What reset the chip, what the firmware wrote before, and how many in a row ended so that nobody
/// wished.
fn last_run(rcc: &pac::RCC) -> (&'static str, Option<Record>, u32) {
    let flags = rcc.csr().read();
    // The cause first that says most: every reset pulls the reset pin as well.
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
    // A fault of the drive resets nothing: after it, a reset by software is the debug probe's.
    let stopped = record.is_some_and(|record| record.reason != Reason::Drive);
    let unwished = flags.iwdgrstf().is_reset() || (flags.sftrstf().is_reset() && stopped);
    rcc.csr().modify(|_, w| w.rmvf().clear());
    (cause, record, stop::count_reset(unwished))
}

/// Waits for the control interrupt to satisfy the rule of the watchdog, which is started then: without
/// it there would be one reset after the other.
fn comes_as_it_should() -> bool {
    let now = || (DWT::cycle_count(), control::PERIODS.load(Ordering::Relaxed));
    let (began, periods) = now();
    let mut rule = Rule::new(began, periods);
    loop {
        let (cycles, periods) = now();
        match rule.judge(cycles, periods, false) {
            Verdict::Feed => return true,
            Verdict::Wait => {}
            Verdict::Refuse { .. } => rule = Rule::new(cycles, periods),
        }
        if cycles.wrapping_sub(began) > board::INTERRUPT_TIMEOUT_US * board::CYCLES_PER_US {
            return false;
        }
    }
}

fn start_control(
    coefficients: Result<Coefficients, SettingsError>,
    mut pwm: pwm::Pwm,
    adc: adc::Adc,
    encoder: encoder::Encoder,
    resets: u32,
) -> Result<Ends, NotStarted> {
    if resets > board::MOST_RESETS {
        return Err(NotStarted::Resets);
    }
    let coefficients = coefficients.map_err(|error| {
        defmt::error!("settings: {}", defmt::Display2Format(&error));
        NotStarted::Settings
    })?;
    let status =
        singleton!(: Mailbox<Status> = Mailbox::new(Status::default())).ok_or(NotStarted::Twice)?;
    let orders =
        singleton!(: Mailbox<Command> = Mailbox::new(Command::Stop)).ok_or(NotStarted::Twice)?;
    let answers = singleton!(: Mailbox<Answer> = Mailbox::new(Ok(Accepted::AsGiven)))
        .ok_or(NotStarted::Twice)?;
    let learned =
        singleton!(: Mailbox<Option<Learned>> = Mailbox::new(None)).ok_or(NotStarted::Twice)?;
    // Named, so that `cargo xtask size` can tell it from the rest.
    static TRACE_MEMORY: Trace<{ board::TRACE_RECORDS }> = Trace::new();
    let (send_status, status) = status.split();
    let (orders, take_orders) = orders.split();
    let (send_answers, answers) = answers.split();
    let (send_learned, learned) = learned.split();
    let (recorder, trace) = TRACE_MEMORY.take().ok_or(NotStarted::Twice)?;
    let seen = singleton!(: Ring<Seen, { board::SEEN_PERIODS }> = Ring::new());
    let (write_seen, seen) = seen.ok_or(NotStarted::Twice)?.split();

    pwm.start().map_err(NotStarted::Timer)?;
    let drive = Drive::new(coefficients);
    control::Control {
        drive,
        pwm,
        adc,
        encoder,
        status: send_status,
        orders: take_orders,
        answers: send_answers,
        learned: send_learned,
        trace: recorder,
        seen: write_seen,
    }
    .run();
    if !comes_as_it_should() {
        return Err(NotStarted::Interrupt);
    }
    Ok(Ends { status, orders, answers, learned, trace, seen })
}
