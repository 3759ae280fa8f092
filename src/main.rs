//! The firmware of the drive.
//!
//! What runs when:
//!
//! * [`main`], once: clocks, encoder, power stage with all switches off, converters, the drive.
//! * the control interrupt (`control.rs`), 6000 times a second: samples in, `Drive::step`, compare
//!   values out.
//! * the loop at the end of `main`, between interrupts: sleeps, and logs ten times a second.
//! * `stop.rs`, when it cannot go on: outputs off.
//!
//! The drive starts off, and so far there is no console that could start it: the outputs stay off.
//!
//! On a host this is a program that says how to flash.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod adc;
#[cfg(any(target_os = "none", test))]
#[cfg_attr(test, allow(dead_code))]
mod board;
mod clocks;
mod control;
mod encoder;
#[cfg(any(target_os = "none", test))]
mod mailbox;
mod pwm;
mod stop;

/// See the top of this file.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use defmt::Display2Format;
    use defmt_rtt as _; // the log goes to the debug probe
    use drive_core::Hardware;

    defmt::info!("induction-drive {}", env!("CARGO_PKG_VERSION"));
    let mut status = match bring_up() {
        Ok(status) => status,
        Err(error) => {
            defmt::error!("not started, outputs stay off: {}", error);
            loop {
                cortex_m::asm::wfi();
            }
        }
    };

    loop {
        cortex_m::asm::wfi();
        if let Some(s) = status.take() {
            defmt::info!(
                "{}: currents {} {}, dc link {}, heat sink {}, encoder {}; {} periods, {} cycles",
                Display2Format(&s.state),
                s.sample.current_a,
                s.sample.current_b,
                s.sample.dc_link,
                s.sample.heat_sink,
                s.sample.encoder,
                s.periods,
                s.worst_cycles,
            );
            for (event, text) in [
                (Hardware::BREAK, "the power stage pulls the break input, or is not there"),
                (Hardware::DEADLINE_MISS, "a control period took too long"),
                (Hardware::CONVERTER_OVERRUN, "a conversion was lost"),
            ] {
                if s.hardware.has(event) {
                    defmt::warn!("{}", text);
                }
            }
        }
    }
}

/// Why the drive was not started.
#[cfg(target_os = "none")]
#[derive(defmt::Format)]
enum NotStarted {
    /// `main` ran twice.
    Twice,
    /// The settings make no drive.
    Settings,
    /// A converter.
    Converter(adc::Stuck),
    /// The timer of the power stage.
    Timer(pwm::NotInStep),
}

/// Sets everything up and starts the control interrupt; gives back what it reports.
#[cfg(target_os = "none")]
fn bring_up() -> Result<mailbox::Receiver<'static, control::Status>, NotStarted> {
    use drive_core::Drive;
    use stm32g4xx_hal::gpio::GpioExt;

    let mut core = cortex_m::Peripherals::take().ok_or(NotStarted::Twice)?;
    let chip = stm32g4xx_hal::pac::Peripherals::take().ok_or(NotStarted::Twice)?;

    let (mut rcc, source) = clocks::start(chip.RCC, chip.PWR, &chip.FLASH);
    if source == clocks::Source::Internal {
        defmt::warn!("the crystal does not start: on the internal oscillator, 1 % accurate");
    }
    // Keep the debug port alive while the core sleeps.
    chip.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    // The cycle counter measures the control interrupt.
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();

    let a = chip.GPIOA.split(&mut rcc);
    let b = chip.GPIOB.split(&mut rcc);
    let c = chip.GPIOC.split(&mut rcc);
    let pwm_pins =
        pwm::Pins { high: (a.pa8, a.pa9, a.pa10), low: (a.pa7, b.pb0, b.pb1), fault: a.pa6 };
    let adc_pins =
        adc::Pins { current_a: a.pa0, current_b: c.pc1, dc_link: a.pa1, heat_sink: c.pc2 };

    let mut pwm = pwm::Pwm::new(chip.TIM1, pwm_pins, &mut rcc, &chip.DBGMCU);
    let encoder = encoder::Encoder::new(chip.TIM2, a.pa15, b.pb3, &mut rcc);
    let adc = adc::Adc::new(chip.ADC1, chip.ADC2, &chip.ADC12_COMMON, adc_pins, &mut rcc)
        .map_err(NotStarted::Converter)?;

    let coefficients = board::settings().build().map_err(|error| {
        defmt::error!("settings: {}", defmt::Display2Format(&error));
        NotStarted::Settings
    })?;

    let mailbox =
        cortex_m::singleton!(: mailbox::Mailbox<control::Status> = mailbox::Mailbox::new());
    let (sender, receiver) = mailbox.ok_or(NotStarted::Twice)?.split();
    pwm.start().map_err(NotStarted::Timer)?;
    let drive = Drive::new(coefficients);
    control::Control { drive, pwm, adc, encoder, status: sender }.run();
    Ok(receiver)
}

/// Says how to flash.
#[cfg(not(target_os = "none"))]
fn main() {
    println!(
        "\
This is the firmware of the drive; it runs on an STM32G474, not on this computer.

    cargo firmware   builds the image for the board
    cargo flash      builds it, writes it through a debug probe and shows its log
    cargo sim        runs the same drive against a simulated motor, here

Flashing needs probe-rs: cargo install probe-rs-tools --locked
Before flashing: mains off, and pull-down resistors at the gate inputs of the power stage."
    );
}
