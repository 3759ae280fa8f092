//! The small image: it runs one motor at one speed, and logs. No console, no bus, no settings, no design on the chip.
//!
//! The coefficients of the drive come from a file that `cargo sim coefficients` writes and a debug probe puts into the flash. If you press
//! the button of the Nucleo board, the motor starts; press it again, and the drive stops by the ramp. Read this file from top to bottom:
//! [`image::main`] sets the chip up, [`image::Control::period`] is the control interrupt, [`image::run`] is the main loop. Everything else
//! is the control crate (`Drive::period`) and the drivers of the chip (`src/chip`).
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    println!("An image: `cargo sim coefficients --help`, `cargo firmware --image drive-and-log`");
}

#[cfg(target_os = "none")]
mod image {
    use core::cell::UnsafeCell;
    use core::mem::MaybeUninit;
    use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

    use cortex_m::peripheral::{DWT, NVIC};
    use cortex_m::{asm, singleton};
    use defmt_rtt as _; // the log goes to the debug probe
    use drive_core::flux::FilterLoop;
    use drive_core::{Command, FrontEndState, Hardware, Mode, PERIOD_S};
    use drive_core::{Refused, State, Stop, Telemetry};
    use induction_drive::board;
    use induction_drive::boards::pin::{Pin, pc};
    use induction_drive::boards::{Level, SELECTED};
    use induction_drive::chip::watchdog::Watchdog;
    use induction_drive::chip::{StartError, adc, clocks, dc_link, encoder, memory, over_voltage};
    use induction_drive::chip::{pins, pwm, sleep, stage::Stage, stop, time, window::Window};
    use induction_drive::coefficients::{ADDRESS, Designed, LONGEST};
    use induction_drive::link::mailbox::{Mailbox, Receiver, Sender};
    use induction_drive::monitor::watchdog::WINDOW_CYCLES;
    use stm32g4xx_hal::gpio::GpioExt;
    use stm32g4xx_hal::pac::{self, Interrupt};
    use stm32g4xx_hal::stm32::interrupt;

    type Drive = drive_core::Drive<FilterLoop>;

    /// The button of the Nucleo board, which connects the pin to the supply.
    const BUTTON: Pin = pc(13);
    /// Control periods between two reports, 0.1 s.
    const REPORT: u32 = 600;
    /// Whether the motor is to run: the only request to the control interrupt.
    static RUN: AtomicBool = AtomicBool::new(false);
    /// Control periods since the start, wrapping.
    static PERIODS: AtomicU32 = AtomicU32::new(0);
    /// Whether a deadline was missed with the outputs on.
    static MISSED: AtomicBool = AtomicBool::new(false);
    /// Whether the interrupt feeds the window watchdog. The first feeding starts it.
    static WATCHED: AtomicBool = AtomicBool::new(false);

    /// A report to the main loop.
    #[derive(Clone, Copy)]
    struct Report {
        state: State,
        refused: Option<Refused>,
        telemetry: Telemetry,
        /// ADC counts of the dc link.
        dc_link: u16,
        /// Cycles of this control interrupt.
        cycles: u32,
    }

    /// The drive and its surroundings, owned by the control interrupt.
    pub struct Control {
        drive: Drive,
        front_end: FrontEndState,
        stage: Stage,
        report: Sender<'static, Option<Report>>,
        rpm: f32,
        /// Word of the drive's phase at the end of the last period.
        phase: u32,
        /// State in the last report.
        reported: State,
        /// The request that was carried out last, and why it was refused.
        runs: bool,
        refused: Option<Refused>,
    }

    impl Control {
        /// Runs one control period: samples in, `Drive::period`, compare values out.
        fn period(&mut self) {
            let began = DWT::cycle_count();
            let Some(mut period) = self.stage.begin(WATCHED.load(Relaxed), Hardware::empty())
            else {
                return;
            };
            // A flipped bit in the word of the phase: the state of the drive is unknown. Periods are counted no more, so the main loop
            // stops feeding the watchdog, which resets the chip.
            let phase = self.phase_word();
            if phase != self.phase {
                return self.stage.pwm.trip();
            }
            let was_off = Drive::is_off_in(phase);
            let sample = self.stage.sample(&mut period, was_off);
            let Self { drive, front_end, stage, .. } = self;
            let mut allowed = true;
            let (_, output) = drive.period(front_end, &sample, &mut |compare| {
                allowed &= stage.pwm.apply(compare);
            });
            if !allowed {
                return stage.pwm.trip();
            }
            MISSED.fetch_or(stage.end(&period, was_off, &output).1, Relaxed);
            if self.drive.has_time() {
                self.follow_button();
            }
            self.phase = self.phase_word();
            if Drive::is_off_in(self.phase) {
                self.stage.pwm.trip();
                self.stage.pwm.disarm();
            }
            self.stage.periods = self.stage.periods.wrapping_add(1);
            self.stage.adc.close();
            PERIODS.store(self.stage.periods, Relaxed);
            let state = self.drive.state();
            if self.reported != state || self.stage.periods.is_multiple_of(REPORT) {
                let (telemetry, dc_link) = (*self.drive.telemetry(), sample.dc_link);
                let cycles = DWT::cycle_count().wrapping_sub(began);
                let report = Report { state, refused: self.refused, telemetry, dc_link, cycles };
                if self.report.send(Some(report)) {
                    (self.reported, self.refused) = (state, None);
                }
            }
        }

        /// Starts or stops the drive when the request has changed.
        fn follow_button(&mut self) {
            let runs = RUN.load(Relaxed);
            if runs == core::mem::replace(&mut self.runs, runs) {
                return;
            }
            let drive = &mut self.drive;
            let commands: &[Command<FilterLoop>] = if runs {
                self.stage.pwm.arm();
                &[Command::Clear, Command::Start(Mode::Speed), Command::Speed(self.rpm)]
            } else {
                &[Command::Stop(Stop::Ramp)]
            };
            self.refused = commands.iter().find_map(|command| drive.command(command).err());
        }

        /// Returns the word of the drive's phase in memory.
        fn phase_word(&self) -> u32 {
            let drive = &raw const self.drive;
            // SAFETY: a word within the drive, read as a plain number.
            unsafe { drive.cast::<u32>().byte_add(Drive::PHASE).read_volatile() }
        }
    }

    /// The interrupt's own memory.
    struct Owned(UnsafeCell<MaybeUninit<Control>>);

    // SAFETY: `start` writes it before it unmasks the interrupt; after that only the interrupt accesses it.
    unsafe impl Sync for Owned {}

    // SAFETY: a section of memory.x for data without initialisation.
    #[unsafe(link_section = ".control_data")]
    static CONTROL: Owned = Owned(UnsafeCell::new(MaybeUninit::uninit()));

    #[interrupt]
    fn ADC1_2() {
        // SAFETY: written before the interrupt was unmasked; the reference ends with this function.
        unsafe { (*CONTROL.0.get()).assume_init_mut() }.period();
        // The requests are cleared before the return (Arm erratum 838869).
        asm::dsb();
    }

    /// The parts that the main loop works with, and the pole pairs.
    type Board = (Receiver<'static, Option<Report>>, Watchdog, f32);

    #[cortex_m_rt::entry]
    fn main() -> ! {
        memory::paint_stack();
        match start() {
            Ok(board) => run(board),
            Err(why) => {
                defmt::error!("not started, outputs stay off: {=str}", why);
                loop {
                    sleep::until_interrupt();
                }
            }
        }
    }

    /// From reset to a running control interrupt. On an error the pins of the gates stay as after a reset, or the outputs off.
    #[inline(never)] // its stack is free in the main loop
    fn start() -> Result<Board, StartError> {
        const TWICE: StartError = "started twice";
        let mut core = cortex_m::Peripherals::take().ok_or(TWICE)?;
        let chip = pac::Peripherals::take().ok_or(TWICE)?;
        memory::guard_stack(&mut core.MPU);
        let (mut rcc, source, clocked) = clocks::start(chip.RCC, chip.PWR, &chip.FLASH);
        clocked?;
        time::start(chip.TIM5, &mut rcc, &chip.DBGMCU)?;
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
        if let Some(record) = stop::take_record() {
            defmt::error!("the last run ended with {}", defmt::Display2Format(&record));
        }
        // SAFETY: readable flash, which nothing writes while the image runs.
        let file = unsafe { core::slice::from_raw_parts(ADDRESS as *const u8, LONGEST) };
        let designed = Designed::read(file, SELECTED).map_err(|why| why.text())?;
        defmt::info!("drive-and-log, board {=str}, {=f32} rpm", SELECTED.name, designed.rpm);
        chip.GPIOA.split(&mut rcc);
        chip.GPIOB.split(&mut rcc);
        chip.GPIOC.split(&mut rcc);
        pins::pulled_input(BUTTON, Level::Low);
        // The coefficients name the board, so the pins of the gates may be connected.
        let mut pwm =
            pwm::Pwm::new(chip.TIM1, &mut rcc, &chip.DBGMCU, &chip.SYSCFG, &designed.timer())?;
        pwm::connect_gates();
        let dc_link = dc_link::DcLink::new(chip.TIM8, &mut rcc, &chip.DBGMCU)?;
        let encoder = encoder::Encoder::new(chip.TIM2, &mut rcc)?;
        let window = Window::new(chip.WWDG, &mut rcc)?;
        let levels = &designed.protection;
        over_voltage::watch(&chip.DAC3, &chip.COMP, &mut rcc, &mut pwm, levels.over_voltage)?;
        let mut adc = adc::Adc::new(chip.ADC1, chip.ADC2, &chip.ADC12_COMMON, &mut rcc, levels)?;
        adc.convert_both(designed.coefficients.front_end.both_zero_vectors);
        pwm.start()?;
        let clocks = time::captured();
        if !clocks.is_some_and(|n| board::clocks_agree(n, source == clocks::Source::Internal)) {
            return Err("the core clock and the oscillators of the chip disagree");
        }
        let mailbox = singleton!(: Mailbox<Option<Report>> = Mailbox::new(None)).ok_or(TWICE)?;
        let (report, reports) = mailbox.split();
        let control = Control {
            drive: Drive::new(designed.coefficients),
            front_end: FrontEndState::default(),
            stage: Stage::new(pwm, dc_link, adc, encoder, window),
            report,
            rpm: designed.rpm,
            phase: Drive::PHASES[0],
            reported: State::Off,
            runs: false,
            refused: None,
        };
        // SAFETY: called once, and the interrupt is still masked.
        unsafe { (*CONTROL.0.get()).write(control) };
        // SAFETY: no critical section relies on this mask; the data of the interrupt are initialised.
        unsafe { NVIC::unmask(Interrupt::ADC1_2) };
        asm::delay(WINDOW_CYCLES);
        WATCHED.store(true, Relaxed);
        asm::delay(1000 * board::CYCLES_PER_US);
        Window::close();
        let watchdog = Watchdog::start(chip.IWDG, chip.DBGMCU, &PERIODS);
        Ok((reports, watchdog, designed.pole_pairs.into()))
    }

    /// The main loop: log, button, watchdog.
    fn run((mut reports, mut watchdog, pole_pairs): Board) -> ! {
        let (mut state, mut logged, mut pressed) = (State::Off, 0, false);
        loop {
            let periods = PERIODS.load(Relaxed);
            if let Some(report) = reports.take().flatten() {
                if let Some(why) = report.refused {
                    defmt::error!("refused: {}", why);
                }
                if core::mem::replace(&mut state, report.state) != report.state {
                    defmt::info!("{}", state);
                    // A drive that has ended waits for the button.
                    RUN.fetch_and(!state.is_off(), Relaxed);
                }
                if periods.wrapping_sub(logged) >= board::PWM_HZ {
                    logged = periods;
                    let Telemetry { current: i, rotor_freq, dc_link, .. } = report.telemetry;
                    let rpm = rotor_freq * (60.0 / PERIOD_S) / pole_pairs;
                    defmt::info!(
                        "{}: i_d {=f32} A, i_q {=f32} A, {=f32} rpm",
                        state,
                        i.d,
                        i.q,
                        rpm
                    );
                    defmt::info!("dc link {=f32} V, {} cycles", dc_link, report.cycles);
                }
                // The button is read with the reports, which come ten times a second, so it does not bounce.
                let was = core::mem::replace(&mut pressed, pins::is_high(BUTTON));
                if pressed && !was {
                    RUN.store(state.is_off() && over_voltage::prove(report.dc_link), Relaxed);
                }
            }
            watchdog.feed(MISSED.load(Relaxed));
            sleep::until_interrupt();
        }
    }
}
