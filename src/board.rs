//! Numbers of the chip, once, and the settings of the power stage that the firmware is built
//! for.
//!
//! Pins, polarities, sensors and limits of the power stages are in [`boards`](crate::boards). Derived numbers are
//! computed here; relations between numbers are asserted when compiling. The file is long because every number says why.

mod dead_time;
mod flash;

pub use flash::{SETTINGS_SLOT_BYTES, STORED_SLOTS, settings_address, settings_page};

use drive_core::Line;
use drive_core::io::PERIOD_S;
use drive_settings::{Carrier, CurrentSensors, Inverter, Scales, Sequence, Settings};

use crate::boards::converter::REFERENCE_V;
use crate::boards::{Board, Currents, SELECTED, Shunts};

// Clock ---------------------------------------------------------------------------------------

/// Longest wait for the crystal to start, ms: typically 2 ms (datasheet), with a wide margin. After it
/// the internal oscillator is used.
pub const HSE_START_MS: u32 = 100;
/// Internal oscillator, Hz; the core runs from it after reset.
pub const HSI_HZ: u32 = 16_000_000;
/// Core, both peripheral buses and all timers, Hz: the largest the chip allows.
pub const CLOCK_HZ: u32 = 170_000_000;
/// Core cycles per microsecond.
pub const CYCLES_PER_US: u32 = CLOCK_HZ / 1_000_000;
const _: () = assert!(CYCLES_PER_US * 1_000_000 == CLOCK_HZ);

/// The PLS field of PWR_CR2: a supply below 2.8 V (datasheet), 15 % below the nominal 3.3 V, counts as failed.
pub const SUPPLY_LEVEL: u8 = 5;

/// Wait states of the flash that [`CLOCK_HZ`] needs with boosted core voltage (RM0440, FLASH wait states: 4 above
/// 136 MHz).
pub const WAIT_STATES: u8 = 4;

// Power stage ---------------------------------------------------------------------------------

/// Control rate, Hz. With one pulse per control period it is the switching frequency as well. The drive's filters and the injected
/// voltage are designed for this rate only.
pub const PWM_HZ: u32 = 6000;
/// Half a control period in ticks of the core clock, rounded. With one pulse per control period it is the largest count of TIM1, which
/// counts up and down once per pulse. With more pulses the largest count is [`Timer::top`].
pub const PWM_TOP: u16 = {
    let top = (CLOCK_HZ + PWM_HZ) / (2 * PWM_HZ);
    assert!(top <= u16::MAX as u32);
    top as u16
};
/// A control period with one pulse, in ticks.
pub const PERIOD_TICKS: u32 = 2 * PWM_TOP as u32;
// The control rate differs from the nominal one by less than 1e-4, due to rounding: by 2.4e-5 with one pulse, by 4.7e-5 the
// other way with two and three.
const _: () = {
    let mut pulses = 1;
    while pulses <= 3 {
        let ticks = 2 * pulses * (PWM_TOP as u32 / pulses);
        let error = ticks as f32 / (CLOCK_HZ as f32 * PERIOD_S) - 1.0;
        assert!(error < 1e-4 && error > -1e-4);
        pulses += 1;
    }
};

/// Values for TIM1 that follow from the settings; they stay in force until the next reset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timer {
    /// The DTG field of TIM1_BDTR.
    pub dead_time_code: u8,
    /// Dead time, s.
    pub dead_time_s: f32,
    /// Switching frequency.
    pub switching_khz: Carrier,
}

impl Timer {
    /// The timer values for these settings, which are within the ranges of the board.
    pub fn of(inverter: &Inverter) -> Self {
        let (dead_time_code, dead_time_s) = dead_time(inverter.dead_time_s);
        Self { dead_time_code, dead_time_s, switching_khz: inverter.switching_khz }
    }

    /// The largest count.
    pub fn top(&self) -> u16 {
        PWM_TOP / self.switching_khz.pulses()
    }

    /// Difference between the top with one pulse and this top, ticks. The control interrupt measures its start from the top with one
    /// pulse, so it reads a start that is later by this difference.
    pub fn below_the_top(&self) -> u32 {
        u32::from(PWM_TOP - self.top())
    }

    /// The RCR field: update events skipped. Update events occur at both ends of the count; one per control period is used, at the top
    /// (low sides on).
    pub fn updates_left_out(&self) -> u16 {
        2 * self.switching_khz.pulses() - 1
    }

    /// The MMS field: the trigger output that starts the sampling of the currents. With one pulse the trigger is channel 4 at
    /// [`SAMPLE_AT`], so that the sampling ends at the top. Channel 4 triggers at every pulse, so with more pulses the update event
    /// starts the sampling, which then ends [`CURRENT_SAMPLING`] after the top.
    pub fn trigger_output(&self) -> u8 {
        if self.switching_khz == Carrier::Khz6 { 7 } else { 2 }
    }
}

/// Core clocks per tick of the dead time (TIM1_CR1.CKD = 1). With one, the longest would be 5.93 us.
pub const DEAD_TIME_CLOCKS: u32 = 2;
// The timer can generate the longest dead time.
const _: () = assert!(
    (dead_time::LONGEST * DEAD_TIME_CLOCKS) as f32 >= SELECTED.dead_time_max_s * CLOCK_HZ as f32
);

/// The DTG field of TIM1_BDTR for a dead time in s within the range of the board, and the dead time, s, that the
/// timer makes of it: shorter than the requested one by at most a hundredth of a tick.
pub fn dead_time(seconds: f32) -> (u8, f32) {
    let clock_hz = (CLOCK_HZ / DEAD_TIME_CLOCKS) as f32;
    // The cast saturates. The hundredth allows for the rounding of a whole number of ticks to single precision.
    let ticks = (seconds * clock_hz + 0.99) as u32;
    let code = dead_time::code(ticks.min(dead_time::LONGEST));
    (code, dead_time::ticks(code) as f32 / clock_hz)
}

/// The BKF field of TIM1_BDTR: six samples at a quarter of the core clock (half of that of the dead
/// time), so a level must hold for [`BREAK_FILTER_NS`] to trip or to end a trip. Spikes of the gate
/// drivers are shorter, damage takes microseconds.
pub const BREAK_FILTER: u8 = 0b0100;
/// Duration of these samples, ns.
pub const BREAK_FILTER_NS: u32 = 6 * 2 * DEAD_TIME_CLOCKS * 1000 / CYCLES_PER_US;

/// Address of TIM1_BDTR (RM0440, memory map), for the fault handler, which cannot rely on Rust's state.
pub const TIM1_BDTR: u32 = 0x4001_2c44;
/// Its bit MOE: outputs on.
pub const TIM1_BDTR_MOE: u32 = 1 << 15;

// ADCs =>----------------------------------------------------------------------------------

/// Core clocks per clock of the ADCs, which is synchronous to the core clock, so the sampling instant does not jitter.
pub const ADC_CLOCK_DIVIDER: u32 = 4;
// Two ADCs at a time: 52 MHz (datasheet, single-ended, all ADCs in operation).
const _: () = assert!(CLOCK_HZ / ADC_CLOCK_DIVIDER <= 52_000_000);

/// A sampling time of the ADC.
#[derive(Clone, Copy)]
pub struct SamplingTime {
    /// SMP field.
    pub code: u8,
    /// Halves of an ADC clock.
    pub half_clocks: u32,
}

impl SamplingTime {
    /// The sampling time in ticks of [`CLOCK_HZ`].
    pub const fn ticks(self) -> u32 {
        self.half_clocks * ADC_CLOCK_DIVIDER / 2
    }
}

/// Currents: 24.5 clocks, 0.58 us. Long enough for the operational amplifier that drives the pin; the current
/// changes by milliamperes in that time.
pub const CURRENT_SAMPLING: SamplingTime = SamplingTime { code: 3, half_clocks: 49 };
/// Dc link and heat sink: 47.5 clocks, 1.1 us, for the higher resistance of their dividers.
pub const SLOW_SAMPLING: SamplingTime = SamplingTime { code: 4, half_clocks: 95 };
/// The chip's own reference: 247.5 clocks, of which it needs 4 us (datasheet).
pub const REFERENCE_SAMPLING: SamplingTime = SamplingTime { code: 6, half_clocks: 495 };
const _: () = assert!(REFERENCE_SAMPLING.ticks() >= 4 * CYCLES_PER_US);
/// A 12-bit conversion after the sampling: 12.5 clocks.
pub const CONVERSION: SamplingTime = SamplingTime { code: 0, half_clocks: 25 };

/// Compare value of the trigger, with one pulse per control period. The sampling of the currents starts while the counter goes up. It
/// ends, which fixes the sampled value, when the counter is at the top and all low sides are on.
pub const SAMPLE_AT: u16 = PWM_TOP - CURRENT_SAMPLING.ticks() as u16;
/// Compare value of the trigger in the upper zero vector, on the way down: this sampling ends when the counter is at 0. On the way up it
/// starts the slow inputs of the terminals.
pub const UPPER_SAMPLE_AT: u32 = CURRENT_SAMPLING.ticks();
/// Time from the end of the sampling to the control interrupt, in ticks. A third current is converted after the first two.
pub const SAMPLES_READY_TICKS: u32 = 2 * CONVERSION.ticks()
    + SLOW_SAMPLING.ticks()
    + if SELECTED.currents.shunts.is_some() { THIRD_CURRENT_TICKS } else { 0 };
/// Conversion of a third current, in ticks.
const THIRD_CURRENT_TICKS: u32 = CURRENT_SAMPLING.ticks() + CONVERSION.ticks();
// Its sampling ends before the low sides go off, which the modulator leaves on for a settling time and more.
const _: () = assert!(THIRD_CURRENT_TICKS < CYCLES_PER_US);
// More than nine tenths of the period are left for the control.
const _: () = assert!(SAMPLES_READY_TICKS * 10 < 2 * PWM_TOP as u32);

/// Start-up time of the ADC's regulator, us (datasheet: 20 at most).
pub const ADC_REGULATOR_START_US: u32 = 20;
/// Longest wait for the calibration or for the readiness of an ADC, us; both take less than 10.
pub const ADC_TIMEOUT_US: u32 = 1000;

/// Full scale of a conversion, ADC counts (12 bits).
pub const ADC_FULL_SCALE: u16 = 4095;

/// The analog watchdogs trip at this multiple of the software's limit, which acts first at slow currents.
const ANALOG_TRIP_SHARE: f32 = 1.02;

/// Lowest and highest ADC counts that do not trip an analog watchdog, for currents up to `trip_a` in both directions, A. Counts at the
/// ends of the range always trip.
fn window(line: Line, trip_a: f32) -> (u16, u16) {
    // The casts saturate.
    let code =
        |amperes: f32| (((amperes - line.offset) / line.gain) as u16).clamp(1, ADC_FULL_SCALE - 1);
    let (negative, positive) = (code(-trip_a), code(trip_a));
    // With a negative gain the positive current has the smaller count.
    (negative.min(positive), negative.max(positive))
}

// Cross-checks --------------------------------------------------------------------------------

/// Periods of an oscillator that one capture spans, by the prescaler of the capture.
const CAPTURED: u32 = 8;
/// Lowest and highest frequency of the watchdog's oscillator, Hz, measured with a correct core clock. If the internal oscillator replaces
/// the crystal, its error widens the range by [`INTERNAL_HZ`] on either side: 2 % (datasheet, over all temperatures).
const LSI_HZ: (u32, u32) = (29_000, 35_000);
const INTERNAL_HZ: u32 = 700;
const _: () = assert!(LSI_HZ.0 < WATCHDOG_HZ && LSI_HZ.1 > WATCHDOG_HZ_MAX);
/// Longest wait from one capture to the next, us.
pub const LSI_TIMEOUT_US: u32 = 600;
const _: () = assert!(LSI_TIMEOUT_US > 2 * CAPTURED * 1_000_000 / (LSI_HZ.0 - INTERNAL_HZ));

/// Core clocks between two captures of the HSI divided by 16.
const HSI_CLOCKS: u32 = 16 * CAPTURED * (CLOCK_HZ / 1000) / (HSI_HZ / 1000);
/// Longest wait for two captures of the HSI, us: each takes 8 us.
pub const HSI_TIMEOUT_US: u32 = 40;

/// Whether the core clock agrees with LSI and HSI, from the core clocks between two captures of each. From the HSI it may differ by 2.5 %.
/// The HSI is off by 2 % at most (datasheet, over all temperatures), so an error of the core clock of 4.5 % is always found.
pub fn clocks_agree((lsi, hsi): (u32, u32), internal: bool) -> bool {
    let more = if internal { INTERNAL_HZ } else { 0 };
    let hz = CAPTURED * CLOCK_HZ / lsi.max(1);
    (LSI_HZ.0 - more..=LSI_HZ.1 + more).contains(&hz) && HSI_CLOCKS.abs_diff(hsi) <= HSI_CLOCKS / 40
}

/// Address of the ADC counts that the chip's own reference gave in the factory (datasheet, VREFINT_CAL), and the ADC reference voltage
/// there, V.
pub const REFERENCE_CALIBRATION: u32 = 0x1fff_75aa;
const CALIBRATED_AT_V: f32 = 3.0;
/// Largest error of the ADC reference voltage. The chip's own reference, with its calibration, may be off by 1 % (datasheet).
const REFERENCE_ERROR: f32 = 0.03;

/// Whether the ADC reference voltage is the board's, from the ADC counts of the chip's own reference.
pub fn references_agree(code: u16, calibration: u16) -> bool {
    let right = f32::from(calibration) * (CALIBRATED_AT_V / REFERENCE_V);
    (f32::from(code) / right - 1.0).abs() <= REFERENCE_ERROR
}

// Reaction times --------------------------------------------------------------------------------

/// Reaction time of the fault input of the power stage, from its edge to the outputs off, ns: the filter and a few clocks of the timer,
/// no software.
pub const BREAK_REACTION_NS: u32 = BREAK_FILTER_NS + 4 * 1000 / CYCLES_PER_US;
/// Latest allowed start of the control interrupt after its samples are ready, us. Nothing masks the running
/// interrupt, not even the log: only its entry and the interrupted instruction remain, below 1 us. `status`
/// shows the latest start so far.
pub const LATEST_START_US: u32 = 10;
/// Longest control interrupt that the window watchdog allows, cycles: one that takes a start command. The next interrupt may be late by
/// this time, and the one after it early. `cargo xtask cycles` fails above it.
pub const LONGEST_INTERRUPT_CYCLES: u32 = 12_000;
const _: () = assert!(BREAK_REACTION_NS < 200);

// Over-voltage ----------------------------------------------------------------------------------

/// Ratio of the comparator's trip to the software's limit, which acts first. If the board's limits are lower, the comparator trips at
/// these.
const OVER_VOLTAGE_SHARE: f32 = 1.075;

/// The protection that works without the control step. It is set up at start from the settings in force then, and holds
/// until the next reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "coefficients", derive(serde::Deserialize, serde::Serialize))]
pub struct Protection {
    /// Lowest and highest ADC counts of current a that do not trip its analog watchdog.
    pub window_a: (u16, u16),
    /// Lowest and highest ADC counts of current b that do not trip its analog watchdog.
    pub window_b: (u16, u16),
    /// ADC counts of the dc link at which the comparator trips. The DAC that generates the level has the reference and the 12 bits of the
    /// ADC that measures the dc link.
    pub over_voltage: u16,
}

/// The protection for these settings on a board. Analog watchdogs trip at 1.02 times `limits.trip_a`, the comparator at 1.075 times
/// `limits.dc_over_v`, but not above the board's limit. The board's limit is in ADC counts, so no setting raises it. All are within the
/// range of the ADCs.
pub fn protection(board: &Board, settings: &Settings) -> Protection {
    let Scales { current_a, current_b, dc_link, .. } = settings.scales;
    let trip_a = ANALOG_TRIP_SHARE * settings.trip_a();
    // The casts saturate.
    let code = |volts: f32, line: Line| ((volts - line.offset) / line.gain) as u16;
    let most = code(board.dc_link_limits.comparator_v(), board.dc_link.line.value);
    let over_voltage = code(OVER_VOLTAGE_SHARE * settings.dc_over_v(), dc_link).min(most);
    Protection {
        window_a: window(current_a, trip_a),
        window_b: window(current_b, trip_a),
        over_voltage: over_voltage.clamp(1, ADC_FULL_SCALE - 1),
    }
}

/// The comparator of the dc link, COMP1 (0) or COMP3 (1), and its INPSEL field.
pub const COMPARATOR: (u8, u8) =
    SELECTED.dc_link.pin.comparator().expect("a comparator reaches the dc link");
/// Address of its register CSR (RM0440, memory map).
pub const COMPARATOR_CSR: u32 = 0x4001_0200 + 8 * COMPARATOR.0 as u32;
/// The INMSEL field of COMP1_CSR and COMP3_CSR: DAC3, channel 1 (RM0440, comparator inverting inputs).
pub const COMP_INVERTING_DAC3: u8 = 0b100;
/// The HYST field: 10 mV, which is 1.4 V of the dc link.
pub const COMP_HYSTERESIS: u8 = 1;
/// Settling time of the level, us (datasheet: 8 at most to wake up, unbuffered).
pub const DAC_START_US: u32 = 10;
/// Start-up time of the comparator, us (datasheet: 5 at most).
pub const COMP_START_US: u32 = 5;
/// Longest time until the chip's pull-up has lifted the pin of the dc link above the offsets of DAC and comparator, us: with 100 nF and
/// 9.31 kOhm it rises to 90 % in 0.8 ms.
pub const LIFT_US: u32 = 5000;
/// ADC counts of the dc link, a tenth of the range, above which the comparator of the dc link can be tested with the dc link itself.
pub const COMPARABLE: u16 = 410;

// Encoder -------------------------------------------------------------------------------------

/// The ICxF field of TIM2: six samples at an eighth of the clock, so shorter pulses than 282 ns are ignored.
/// 10 000 counts a turn at 1440 rpm come every 4.2 us.
pub const ENCODER_FILTER: u8 = 0b1000;

// Console and recording -----------------------------------------------------------------------

/// Bits per second of the console after a reset; 8 data bits, no parity, 1 stop bit.
pub const SERIAL_BAUD: u32 = 115_200;
/// Ticks of LPUART1's clock, Hz, per bit, in 1/256 (RM0440, LPUART_BRR), rounded.
pub const fn serial_divider(clock_hz: u32, baud: u32) -> u32 {
    ((256 * clock_hz as u64 + baud as u64 / 2) / baud as u64) as u32
}
/// Records of the longest trace, 32 bytes each.
pub const TRACE_RECORDS: usize = 1024;
/// Longest wait for the answer to a command, us: one period of ten takes it, within 1.7 ms.
pub const ANSWER_TIMEOUT_US: u32 = 3000;
const _: () = assert!(ANSWER_TIMEOUT_US > 11 * 1_000_000 / PWM_HZ);

// Watchdog ------------------------------------------------------------------------------------

/// Slowest clock of the watchdog, Hz (datasheet: 32 kHz, 29.5 to 34 kHz over all conditions).
pub const WATCHDOG_HZ: u32 = 29_500;
/// Fastest clock, Hz.
const WATCHDOG_HZ_MAX: u32 = 34_000;
/// The PR field: divided by 4.
pub const WATCHDOG_PRESCALER: u8 = 0;
/// The RLR field: counts until the reset of the chip, less one.
pub const WATCHDOG_RELOAD: u16 = 35;
/// Shortest time from a feeding to the reset, us: 4.2 ms.
pub const WATCHDOG_US: u32 = (WATCHDOG_RELOAD as u32 + 1) * 4 * 1000 / (WATCHDOG_HZ_MAX / 1000);
// At most 5 ms, with the slowest clock.
const _: () = assert!((WATCHDOG_RELOAD as u32 + 1) * 4 * 1000 <= 5 * WATCHDOG_HZ);
/// The PR field during long operations with the outputs off: divided by 256.
pub const WATCHDOG_LONG_PRESCALER: u8 = 6;
/// The RLR field then: ten seconds. The design of the control takes more than one, because the core computes double
/// precision in software.
pub const WATCHDOG_LONG_RELOAD: u16 = 1249;
/// Longest wait until the watchdog has taken both values, us: six of its clocks divided by 256, 52 ms with the slowest clock
/// (`stm32g4xx_hal_iwdg.c`).
pub const WATCHDOG_SET_US: u32 = 60_000;
const _: () = assert!(WATCHDOG_SET_US > 6 * 256 * 1_000_000 / WATCHDOG_HZ);
/// Longest wait at start for the control interrupt to come at its rate, us.
pub const INTERRUPT_TIMEOUT_US: u32 = 100_000;
/// Consecutive unintended resets after which the drive is not started any more.
pub const MOST_RESETS: u32 = 4;
/// Running time after which a reset no longer counts as consecutive, ms.
pub const WELL_AFTER_MS: u32 = 10_000;

// Flash ---------------------------------------------------------------------------------------

/// Longest wait for an operation of the flash, us: twice the erasure of a page (datasheet, 24.5 ms).
pub const FLASH_TIMEOUT_US: u32 = 50_000;
// The watchdog's long time covers a save, which waits for two erasures at most.
const _: () = assert!(
    2 * FLASH_TIMEOUT_US < (WATCHDOG_LONG_RELOAD as u32 + 1) * 64 * 1000 / (WATCHDOG_HZ_MAX / 1000)
);

// Option bytes --------------------------------------------------------------------------------

/// Bits of FLASH_OPTR (RM0440) and the values that the firmware needs, each with its error. With the other value of WWDG_SW or BFB2 the
/// chip hardly gets as far: the start block is longer than the watchdog's time, and it resets what ST's loader has started. BOR level and
/// read-out protection may have any value: no run depends on them.
const OPTIONS: [(u32, bool, &str); 5] = [
    (22, true, "option bytes: the flash has one bank; set DBANK to 1"),
    (16, true, "option bytes: the watchdog runs before the control does; set IWDG_SW to 1"),
    (19, true, "option bytes: the window watchdog runs before the control does; set WWDG_SW to 1"),
    (20, false, "option bytes: ST's loader chooses the bank; set BFB2 to 0"),
    (24, true, "option bytes: the parity of the RAM counts, which is not set up; set SRAM_PE to 1"),
];

/// Checks the option bytes.
///
/// # Errors
/// The first option that is wrong, by its name and the value that it needs.
pub fn check_options(option_bytes: u32) -> Result<(), &'static str> {
    let wrong = |&&(bit, set, _): &&(u32, bool, _)| (option_bytes >> bit & 1 != 0) != set;
    OPTIONS.iter().find(wrong).map_or(Ok(()), |(_, _, why)| Err(*why))
}

/// Bit of FLASH_OPTR (RM0440): the level of PB8 counts at a reset; without this bit, the next one starts the firmware.
const N_SWBOOT0: u32 = 1 << 26;
const N_BOOT0: u32 = 1 << 27;

/// Whether these option bytes let the pin PB8 choose between the firmware and ST's boot loader at a reset. The factory's option bytes do.
pub fn boot_pin_counts(option_bytes: u32) -> bool {
    option_bytes & (N_SWBOOT0 | N_BOOT0) != N_BOOT0
}

// Log -----------------------------------------------------------------------------------------

/// Control periods from one status line to the next: 10 lines a second.
pub const PERIODS_PER_STATUS: u32 = PWM_HZ / 10;

/// The drive's settings with the numbers of the board that the firmware is built for.
pub fn settings() -> Settings {
    settings_of(SELECTED)
}

/// The drive's settings with the numbers of a board.
pub fn settings_of(board: &Board) -> Settings {
    let defaults = Settings::default();
    let Currents { a, b, shunts } = &board.currents;
    let (sensors, c, shunt_settle_s) = match shunts {
        None => (CurrentSensors::InLine, b, defaults.scales.shunt_settle_s),
        Some(Shunts { c, settle_s }) => (CurrentSensors::LowSide, c, settle_s.value),
    };
    let inverter = Inverter {
        top: PWM_TOP,
        dead_time_s: board.dead_time_s.value,
        dc_link_v: board.dc_link_v,
        ..defaults.inverter
    };
    let scales = Scales {
        current_a: a.line.value,
        current_b: b.line.value,
        current_c: c.line.value,
        sensors,
        shunt_settle_s,
        dc_link: board.dc_link.line.value,
        dc_link_highest: board.highest_dc_link(),
        full_scale: ADC_FULL_SCALE,
        ntc: board.ntc.value,
        current_delay_s: board.current_delay_s.value,
        ..defaults.scales
    };
    let sequence = Sequence { flux: board.flux, ..defaults.sequence };
    Settings { inverter, scales, sequence, ..defaults }
}

#[cfg(test)]
mod tests;
