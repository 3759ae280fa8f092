//! The board: every number that belongs to the hardware, once.
//!
//! NUCLEO-G474RE on ST's morpho motor-control pins, with the inverter and the current sensors of
//! the dissertation. What follows from several numbers is computed here from them, and what must
//! hold between them is asserted when compiling.
//!
//! | pin | what | peripheral |
//! |---|---|---|
//! | PA8, PA9, PA10 | gates of the high sides a, b, c | TIM1_CH1, CH2, CH3 |
//! | PA7, PB0, PB1 | gates of the low sides a, b, c | TIM1_CH1N, CH2N, CH3N |
//! | PA6 | fault output of the power stage, low = trip | TIM1_BKIN |
//! | PA0 | current a | ADC1_IN1 |
//! | PC1 | current b | ADC2_IN7 |
//! | PA1 | dc link | ADC1_IN2 |
//! | PC2 | heat sink | ADC2_IN8 |
//! | PA15, PB3 | encoder A, B | TIM2_CH1, CH2 |
//! | PA2, PA3 | console: transmit, receive (the ST-LINK's serial port) | LPUART1 |
//!
//! The gate inputs of the power stage need pull-down resistors of their own: while the controller
//! is in reset or being flashed, its pins float.

use drive_core::Settings;
use drive_core::sensing::Line;
use drive_core::settings::{Inverter, PERIOD_S, Scales};

// Clock ---------------------------------------------------------------------------------------

/// Crystal of the Nucleo board, Hz.
pub const HSE_HZ: u32 = 24_000_000;
/// Time a crystal may take to start, ms: the datasheet's typical 2 ms, with a wide margin. After it
/// the internal oscillator takes over.
pub const HSE_START_MS: u32 = 100;
/// Internal oscillator, Hz; the core runs from it after reset.
pub const HSI_HZ: u32 = 16_000_000;
/// Core, both peripheral buses and all timers, Hz: the most the chip allows.
pub const CLOCK_HZ: u32 = 170_000_000;
/// Core cycles per microsecond.
pub const CYCLES_PER_US: u32 = CLOCK_HZ / 1_000_000;
const _: () = assert!(CYCLES_PER_US * 1_000_000 == CLOCK_HZ);

/// The PLS field of PWR_CR2: the supply has failed below 2.8 V (datasheet), 15 % below its 3.3 V.
pub const SUPPLY_LEVEL: u8 = 5;

// Power stage ---------------------------------------------------------------------------------

/// Alternate function of the pins that belong to TIM1 (datasheet).
pub const PWM_AF: u8 = 6;
/// PWM and control rate, Hz: the drive's filters and its carrier are made for this rate alone.
pub const PWM_HZ: u32 = 6000;
/// Value at which TIM1 turns round: it counts up and down once per period, so half a period in
/// ticks of the core clock, rounded.
pub const PWM_TOP: u16 = {
    let top = (CLOCK_HZ + PWM_HZ) / (2 * PWM_HZ);
    assert!(top <= u16::MAX as u32);
    top as u16
};
/// Update events of TIM1 come at both ends of the count; every other one is used, the one at the
/// top (low sides on): RCR counts the ones left out.
pub const PWM_UPDATES_LEFT_OUT: u16 = 1;
// The rate differs from the nominal one by rounding only, less than 1e-4.
const _: () = {
    let nominal = CLOCK_HZ as f32 * PERIOD_S;
    let error = (2 * PWM_TOP as u32) as f32 / nominal - 1.0;
    assert!(error < 1e-4 && error > -1e-4);
};

/// Dead time of the inverter, ns (section 3.9): both switches of a leg are off for this long at
/// every change.
pub const DEAD_TIME_NS: u32 = 2200;
/// Dead time as the timer makes it, in ticks of [`CLOCK_HZ`]: never shorter than asked for.
pub const DEAD_TIME_TICKS: u32 = dead_time_ticks(DEAD_TIME_CODE);
/// The same in s, for the compensation in the drive.
pub const DEAD_TIME_S: f32 = DEAD_TIME_TICKS as f32 / CLOCK_HZ as f32;
/// The DTG field of TIM1_BDTR.
pub const DEAD_TIME_CODE: u8 = dead_time_code((DEAD_TIME_NS * CYCLES_PER_US).div_ceil(1000));
const _: () = {
    assert!(DEAD_TIME_TICKS * 1000 >= DEAD_TIME_NS * CYCLES_PER_US);
    // What is added by rounding stays below 1 %.
    assert!(DEAD_TIME_TICKS * 100_000 <= DEAD_TIME_NS * CYCLES_PER_US * 101);
    // Two dead times per period are lost; the drive allows for 6 us.
    assert!(DEAD_TIME_NS >= 500 && DEAD_TIME_NS <= 6000);
};

/// The shortest dead time the DTG field can hold that is not below `ticks` (RM0440, TIM1_BDTR).
pub const fn dead_time_code(ticks: u32) -> u8 {
    if ticks <= 127 {
        ticks as u8
    } else if ticks <= 2 * 127 {
        0b1000_0000 | (ticks.div_ceil(2) - 64) as u8
    } else if ticks <= 8 * 63 {
        0b1100_0000 | (ticks.div_ceil(8) - 32) as u8
    } else {
        assert!(ticks <= 16 * 63, "longer than the timer can make it");
        0b1110_0000 | (ticks.div_ceil(16) - 32) as u8
    }
}

/// The dead time that a DTG field stands for, in ticks.
pub const fn dead_time_ticks(code: u8) -> u32 {
    let code = code as u32;
    match code >> 5 {
        0..=3 => code,
        4 | 5 => 2 * (64 + (code & 0x3f)),
        6 => 8 * (32 + (code & 0x1f)),
        _ => 16 * (32 + (code & 0x1f)),
    }
}

/// The BKF field of TIM1_BDTR: six samples at half the clock, so a level must hold for 71 ns to trip
/// or to end a trip. Spikes of the gate drivers are shorter, damage takes microseconds.
pub const BREAK_FILTER: u8 = 0b0100;

/// Address of TIM1_BDTR, for the handler that cannot rely on anything (RM0440, memory map).
pub const TIM1_BDTR: u32 = 0x4001_2c44;
/// Its bit MOE: outputs on.
pub const TIM1_BDTR_MOE: u32 = 1 << 15;

// Converters ----------------------------------------------------------------------------------

/// Clock of the converters, Hz: a quarter of the core clock and synchronous to it, so the sampling
/// instant does not jitter.
pub const ADC_HZ: u32 = CLOCK_HZ / ADC_CLOCK_DIVIDER;
/// Core clocks per converter clock.
pub const ADC_CLOCK_DIVIDER: u32 = 4;
// Two converters at a time: 52 MHz (datasheet, single-ended, all converters in operation).
const _: () = assert!(ADC_HZ <= 52_000_000);

/// A sampling time of the converter.
#[derive(Clone, Copy)]
pub struct SamplingTime {
    /// SMP field.
    pub code: u8,
    /// Halves of a converter clock.
    pub half_clocks: u32,
}

impl SamplingTime {
    /// In ticks of [`CLOCK_HZ`].
    pub const fn ticks(self) -> u32 {
        self.half_clocks * ADC_CLOCK_DIVIDER / 2
    }
}

/// Currents: 24.5 clocks, 0.58 us. Long for the operational amplifier that drives the pin, short
/// against the period, during which the current changes by milliamperes in that time.
pub const CURRENT_SAMPLING: SamplingTime = SamplingTime { code: 3, half_clocks: 49 };
/// Dc link and heat sink: 47.5 clocks, 1.1 us, for the higher resistance of their dividers.
pub const SLOW_SAMPLING: SamplingTime = SamplingTime { code: 4, half_clocks: 95 };
/// A 12-bit conversion after the sampling: 12.5 clocks.
const CONVERSION: SamplingTime = SamplingTime { code: 0, half_clocks: 25 };

/// Compare value of the trigger: the sampling of the currents starts on the way up and ends, with
/// the value that counts, when the counter is at the top and all low sides are on.
pub const SAMPLE_AT: u16 = PWM_TOP - CURRENT_SAMPLING.ticks() as u16;
/// From the top of the counter to the control interrupt, in ticks.
pub const SAMPLES_READY_TICKS: u32 = 2 * CONVERSION.ticks() + SLOW_SAMPLING.ticks();
// Leaves more than nine tenths of the period to the control.
const _: () = assert!(SAMPLES_READY_TICKS * 10 < 2 * PWM_TOP as u32);

/// Time the converter's regulator takes to start, us (datasheet: 20 at most).
pub const ADC_REGULATOR_START_US: u32 = 20;
/// Longest wait for the calibration or for the readiness of a converter, us; both take less than
/// 10.
pub const ADC_TIMEOUT_US: u32 = 1000;

/// Channels in each converter's sequence, currents first: `(current, slow signal)`.
pub const ADC1_CHANNELS: (u8, u8) = (1, 2);
/// See [`ADC1_CHANNELS`].
pub const ADC2_CHANNELS: (u8, u8) = (7, 8);

/// Reference of the converters, V: VREF+ of the Nucleo board is its 3.3 V supply.
pub const ADC_REFERENCE_V: f32 = 3.3;
/// Largest code of a conversion: 12 bits.
pub const ADC_FULL_SCALE: u16 = 4095;
/// Reference of the converter with which the sensors were calibrated, V (Eq. 3.4).
const CALIBRATION_REFERENCE_V: f32 = 3.0;

/// Current a, A: Eq. 3.5, moved from the reference it was calibrated with to this board's.
pub const CURRENT_A: Line = on_this_board(Line::CHANNEL_A);
/// Current b, A; see [`CURRENT_A`].
pub const CURRENT_B: Line = on_this_board(Line::CHANNEL_B);
/// Dc link, V: a divider by 136.5, so that 450 V are full scale. The source does not say how it
/// measured the dc link: adapt this to the divider of the inverter.
pub const DC_LINK: Line = Line { gain: 0.11, offset: 0.0 };

const fn on_this_board(line: Line) -> Line {
    // The same voltage gives a smaller code with a higher reference; code 0 stays 0 V.
    Line { gain: line.gain * (ADC_REFERENCE_V / CALIBRATION_REFERENCE_V), ..line }
}

/// Phase current beyond which the analog watchdogs trip, A: above the software's limit (4.3 A), below
/// the end of the sensors' range (4.47 A).
pub const ANALOG_TRIP_A: f32 = 4.4;
/// Lowest and highest code of current a that do not trip, both polarities.
pub const ANALOG_WINDOW_A: (u16, u16) = window(CURRENT_A);
/// The same of current b.
pub const ANALOG_WINDOW_B: (u16, u16) = window(CURRENT_B);
const _: () = {
    // A converter can still show a current beyond them.
    assert!(ANALOG_WINDOW_A.0 > 0 && ANALOG_WINDOW_B.0 > 0);
    assert!(ANALOG_WINDOW_A.1 < ADC_FULL_SCALE && ANALOG_WINDOW_B.1 < ADC_FULL_SCALE);
};

const fn window(line: Line) -> (u16, u16) {
    (
        ((-ANALOG_TRIP_A - line.offset) / line.gain) as u16,
        ((ANALOG_TRIP_A - line.offset) / line.gain) as u16,
    )
}

// Encoder -------------------------------------------------------------------------------------

/// Alternate function of the pins that belong to TIM2 (datasheet).
pub const ENCODER_AF: u8 = 1;
/// The ICxF field of TIM2: six samples at an eighth of the clock, so pulses below 282 ns are noise.
/// 10 000 counts a turn at 1440 rpm come every 4.2 us.
pub const ENCODER_FILTER: u8 = 0b1000;

// Console -------------------------------------------------------------------------------------

/// Alternate function of the pins that belong to LPUART1 (datasheet).
pub const SERIAL_AF: u8 = 12;
/// Bits per second; 8 data bits, no parity, 1 stop bit.
pub const SERIAL_BAUD: u32 = 115_200;
/// Clock ticks of LPUART1 per bit, in 1/256 (RM0440, LPUART_BRR), rounded.
pub const SERIAL_DIVIDER: u32 = {
    let divider = (256 * CLOCK_HZ as u64 + SERIAL_BAUD as u64 / 2) / SERIAL_BAUD as u64;
    // What the register holds.
    assert!(divider >= 0x300 && divider <= 0xf_ffff);
    divider as u32
};
/// Bytes received and not yet read: 22 ms of a flood, the main loop reads a thousand times as often.
pub const SERIAL_RECEIVE: usize = 256;
/// Bytes to be sent: the longest line waits 44 ms at most.
pub const SERIAL_TRANSMIT: usize = 512;
/// Records of a trace, 32 bytes each: all that the console can ask for.
pub const TRACE_RECORDS: usize = crate::console::grammar::LONGEST_TRACE as usize;
/// Longest wait for the answer to an order, us: it is taken in the next period, which lasts 167 us.
pub const ANSWER_TIMEOUT_US: u32 = 500;
const _: () = assert!(ANSWER_TIMEOUT_US > 2 * 1_000_000 / PWM_HZ);

// Watchdog ------------------------------------------------------------------------------------

/// Slowest clock of the watchdog, Hz (datasheet: 32 kHz, 29.5 to 34 kHz over all conditions).
const WATCHDOG_HZ: u32 = 29_500;
/// Fastest.
const WATCHDOG_HZ_MAX: u32 = 34_000;
/// The PR field: divided by 4.
pub const WATCHDOG_PRESCALER: u8 = 0;
/// Counts less one until it resets the chip.
pub const WATCHDOG_RELOAD: u16 = 35;
/// Shortest time from a feeding to the reset, us: 4.2 ms.
pub const WATCHDOG_US: u32 = (WATCHDOG_RELOAD as u32 + 1) * 4 * 1000 / (WATCHDOG_HZ_MAX / 1000);
// At most 5 ms, with the slowest clock.
const _: () = assert!((WATCHDOG_RELOAD as u32 + 1) * 4 * 1000 <= 5 * WATCHDOG_HZ);
/// The PR field while the outputs are off and something takes long: divided by 256.
pub const WATCHDOG_LONG_PRESCALER: u8 = 6;
/// Counts less one: ten seconds. The design of the control takes more than one: it is in double
/// precision, which the core computes in software.
pub const WATCHDOG_LONG_RELOAD: u16 = 1249;
/// Longest wait for the watchdog to take both over, us: six of its longest clocks, 12 ms.
pub const WATCHDOG_SET_US: u32 = 15_000;
/// Unwished resets in a row after which the drive is not started any more.
pub const MOST_RESETS: u32 = 4;
/// Time without a reset after which they are no longer in a row, ms.
pub const WELL_AFTER_MS: u32 = 10_000;

// Log -----------------------------------------------------------------------------------------

/// Control periods from one status line to the next: 10 lines a second.
pub const PERIODS_PER_STATUS: u32 = PWM_HZ / 10;

/// The drive's settings with the numbers of this board in them.
pub fn settings() -> Settings {
    let defaults = Settings::default();
    Settings {
        inverter: Inverter { top: PWM_TOP, dead_time_s: DEAD_TIME_S, ..defaults.inverter },
        scales: Scales {
            current_a: CURRENT_A,
            current_b: CURRENT_B,
            dc_link: DC_LINK,
            full_scale: ADC_FULL_SCALE,
            ..defaults.scales
        },
        ..defaults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_time_is_never_shorter_than_asked_for_and_hardly_longer() {
        for ticks in 0..=16 * 63 {
            let made = dead_time_ticks(dead_time_code(ticks));
            assert!(made >= ticks && made < ticks + 16, "{ticks} became {made}");
        }
    }

    #[test]
    fn every_dead_time_code_is_found_again() {
        for code in 0..=u8::MAX {
            let ticks = dead_time_ticks(code);
            assert_eq!(dead_time_ticks(dead_time_code(ticks)), ticks, "code {code:#x}");
        }
    }

    #[test]
    fn the_numbers_are_those_of_the_design() {
        assert_eq!(PWM_TOP, 14_167);
        assert_eq!((DEAD_TIME_CODE, DEAD_TIME_TICKS), (0xcf, 376)); // 2.21 us
        assert_eq!(SAMPLE_AT, 14_167 - 98);
    }

    /// 0 A gave 2024 with 3.0 V (Table 4): the same voltage is 1840 of 3.3 V.
    #[test]
    fn the_calibration_follows_the_reference() {
        let zero = -CURRENT_A.offset / CURRENT_A.gain;
        assert!((zero - 2022.0 / 1.1).abs() < 1.0, "zero at {zero}");
    }

    #[test]
    fn the_analog_watchdogs_trip_between_the_software_and_the_end_of_the_range() {
        for (line, (low, high)) in [(CURRENT_A, ANALOG_WINDOW_A), (CURRENT_B, ANALOG_WINDOW_B)] {
            let software = settings().limits.trip_a;
            assert!(line.at(high) > software && line.at(low) < -software);
            assert!(line.at(high + 1) < 4.47 && line.at(low - 1) > -4.47);
        }
    }

    #[test]
    fn the_drive_accepts_the_board() {
        assert!(settings().build().is_ok());
    }
}
