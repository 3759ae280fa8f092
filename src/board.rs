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
//! | PA1 | dc link | ADC1_IN2, COMP1 |
//! | PC2 | heat sink | ADC2_IN8 |
//! | PA15, PB3 | encoder A, B | TIM2_CH1, CH2 |
//! | PA2, PA3 | console: transmit, receive (the ST-LINK's serial port) | LPUART1 |
//!
//! The gate inputs of the power stage need pull-down resistors of their own: while the controller
//! is in reset or being flashed, its pins float.

use drive_core::Settings;
use drive_core::io::PERIOD_S;
use drive_core::settings::Line;
use drive_core::settings::{Inverter, Scales};

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

/// Dead time of the inverter, s (section 3.9): both switches of a leg are off for this long at every
/// change. The default of the setting `inverter.dead_time_s`.
pub const DEAD_TIME_S: f32 = 2.2e-6;
/// What may be set, s: what fast and slow power modules need.
pub const DEAD_TIME_RANGE_S: (f32, f32) = (0.5e-6, 6e-6);
/// Core clocks per tick of the dead time (TIM1_CR1.CKD = 1): with one, it would end at 5.93 us.
pub const DEAD_TIME_CLOCKS: u32 = 2;
// The longest is within reach.
const _: () = assert!(
    (dead_time_ticks(u8::MAX) * DEAD_TIME_CLOCKS) as f32 >= DEAD_TIME_RANGE_S.1 * CLOCK_HZ as f32
);

/// The DTG field of TIM1_BDTR for a dead time in s within [`DEAD_TIME_RANGE_S`], and the dead time that
/// the timer makes then: never shorter than asked for but by a hundredth of a tick.
pub fn dead_time(seconds: f32) -> (u8, f32) {
    let clock_hz = (CLOCK_HZ / DEAD_TIME_CLOCKS) as f32;
    // Saturating cast. The hundredth is for what single precision makes of a whole number of ticks.
    let ticks = (seconds * clock_hz + 0.99) as u32;
    let code = dead_time_code(if ticks > LONGEST_DEAD_TIME { LONGEST_DEAD_TIME } else { ticks });
    (code, dead_time_ticks(code) as f32 / clock_hz)
}

const LONGEST_DEAD_TIME: u32 = dead_time_ticks(u8::MAX);

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

/// The BKF field of TIM1_BDTR: six samples at a quarter of the core clock (half of that of the dead
/// time), so a level must hold for [`BREAK_FILTER_NS`] to trip or to end a trip. Spikes of the gate
/// drivers are shorter, damage takes microseconds.
pub const BREAK_FILTER: u8 = 0b0100;
/// What that takes, ns.
pub const BREAK_FILTER_NS: u32 = 6 * 2 * DEAD_TIME_CLOCKS * 1000 / CYCLES_PER_US;

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

// Reaction times --------------------------------------------------------------------------------

/// The fault input of the power stage, from its edge to the outputs off, ns: the filter, and a few
/// clocks of the timer. No software.
pub const BREAK_REACTION_NS: u32 = BREAK_FILTER_NS + 4 * 1000 / CYCLES_PER_US;
/// An analog watchdog, from an over-current to the outputs off, ns: up to a period until the next
/// sample, the conversion, and the latest start of the interrupt that is allowed.
pub const WATCHDOG_REACTION_NS: u32 =
    (2 * PWM_TOP as u32 + CONVERSION.ticks()) * 1000 / CYCLES_PER_US + LATEST_START_US * 1000;
/// The software, from an over-current to the outputs off, ns: the same, after the whole sequence, and
/// the control step.
pub const SOFTWARE_REACTION_NS: u32 = (2 * PWM_TOP as u32 + SAMPLES_READY_TICKS) * 1000
    / CYCLES_PER_US
    + (LATEST_START_US + LONGEST_STEP_US) * 1000;
/// Latest start of the control interrupt after its samples are ready, us. Once it runs nothing masks it,
/// the log neither: what is left is its entry and the instruction it interrupts, below 1 us. `status`
/// shows the latest there was.
pub const LATEST_START_US: u32 = 10;
/// Longest control step that is reckoned with here, us; `status` shows the longest there was, in cycles.
const LONGEST_STEP_US: u32 = 20;
const _: () = {
    assert!(BREAK_REACTION_NS < 200);
    // Both lines in software end before the next period does.
    assert!(WATCHDOG_REACTION_NS < SOFTWARE_REACTION_NS);
    assert!(SOFTWARE_REACTION_NS < 200_000);
};

// Over-voltage ----------------------------------------------------------------------------------

/// Dc link at which the comparator pulls the break, V: above the drive's own limit (400 V), which is
/// asked first, below the end of the converter's range.
pub const OVER_VOLTAGE_V: f32 = 430.0;
/// The same as the code of a converter with the same reference and 12 bits, which the dc link is
/// measured with and the level is made with.
pub const OVER_VOLTAGE_CODE: u16 = ((OVER_VOLTAGE_V - DC_LINK.offset) / DC_LINK.gain) as u16;
const _: () = assert!(OVER_VOLTAGE_CODE < ADC_FULL_SCALE);
/// The INMSEL field of COMP1_CSR: DAC3, channel 1 (RM0440, comparator inverting inputs).
pub const COMP1_INVERTING_DAC3: u8 = 0b100;
/// The HYST field: 10 mV, which is 1.4 V of the dc link.
pub const COMP_HYSTERESIS: u8 = 1;
/// Time until the level stands, us (datasheet: 8 at most to wake up, unbuffered).
pub const DAC_START_US: u32 = 10;
/// Time until the comparator compares, us (datasheet: 5 at most).
pub const COMP_START_US: u32 = 5;

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
/// Control periods that the identification in the main loop may be behind, 10.7 ms: longer than the
/// watchdog lets it be.
pub const SEEN_PERIODS: usize = 64;
const _: () = assert!(SEEN_PERIODS as u32 * 1_000_000 / PWM_HZ > 2 * WATCHDOG_US);
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
/// Longest wait at start for the control interrupt to come as it should, us.
pub const INTERRUPT_TIMEOUT_US: u32 = 100_000;
/// Unwished resets in a row after which the drive is not started any more.
pub const MOST_RESETS: u32 = 4;
/// Time without a reset after which they are no longer in a row, ms.
pub const WELL_AFTER_MS: u32 = 10_000;

// Settings ------------------------------------------------------------------------------------

/// Size of the flash, bytes.
const FLASH_BYTES: u32 = 512 * 1024;
const FLASH_ADDRESS: u32 = 0x0800_0000;
/// Bytes of a page of the flash with two banks, and with one (RM0440, flash module organization).
const PAGE_BYTES: (u32, u32) = (2048, 4096);
/// What a set of settings may take, bytes: a page of the smaller kind.
pub const SETTINGS_SLOT_BYTES: u32 = PAGE_BYTES.0;
/// Where the two sets of settings are, from the beginning of the flash: the last pages of the larger
/// kind, so that they stay where they are when the option bit DBANK changes.
const SETTINGS_OFFSETS: [u32; 2] = [FLASH_BYTES - 2 * PAGE_BYTES.1, FLASH_BYTES - PAGE_BYTES.1];
// In the second bank; the code is in the first, and runs on while the second is written.
const _: () = assert!(SETTINGS_OFFSETS[0] >= FLASH_BYTES / 2);
/// Longest wait for an operation of the flash, us: twice the erasure of a page (datasheet, 24.5 ms).
pub const FLASH_TIMEOUT_US: u32 = 50_000;
// A save is two erasures' worth of waiting at most, and the watchdog's long time lasts through it.
const _: () = assert!(
    2 * FLASH_TIMEOUT_US < (WATCHDOG_LONG_RELOAD as u32 + 1) * 64 * 1000 / (WATCHDOG_HZ_MAX / 1000)
);

const fn settings_offset(slot: usize) -> u32 {
    if slot == 0 { SETTINGS_OFFSETS[0] } else { SETTINGS_OFFSETS[1] }
}

/// Address of a double word of a set of settings; always inside it.
pub const fn settings_address(slot: usize, word: usize) -> u32 {
    let words = SETTINGS_SLOT_BYTES / 8;
    FLASH_ADDRESS + settings_offset(slot) + 8 * (word as u32 % words)
}

/// The fields BKER (second bank) and PNB (page in the bank) of FLASH_CR for a set of settings.
pub const fn settings_page(slot: usize, dual_bank: bool) -> (bool, u8) {
    if dual_bank {
        (true, ((settings_offset(slot) - FLASH_BYTES / 2) / PAGE_BYTES.0) as u8)
    } else {
        (false, (settings_offset(slot) / PAGE_BYTES.1) as u8)
    }
}

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
    fn every_dead_time_that_may_be_set_is_made_within_four_percent() {
        for ns in 500..=6000 {
            let wanted = ns as f32 * 1e-9;
            let made = dead_time(wanted).1;
            assert!(made > wanted - 0.2e-9 && made < 1.04 * wanted + 12e-9, "{wanted}: {made}");
            // What the timer makes, asked for again, is the same.
            assert_eq!(dead_time(made), dead_time(wanted));
        }
        // Whatever else is asked for, there is a field.
        for odd in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
            let _ = dead_time(odd);
        }
    }

    #[test]
    fn the_comparator_trips_between_the_software_and_the_end_of_the_range() {
        let trip = DC_LINK.at(OVER_VOLTAGE_CODE);
        assert!(trip > settings().limits.dc_over_v && trip < DC_LINK.at(ADC_FULL_SCALE));
    }

    #[test]
    fn reaction_times_are_those_of_the_readme() {
        let times = [BREAK_REACTION_NS, WATCHDOG_REACTION_NS, SOFTWARE_REACTION_NS];
        assert_eq!(times, [164, 176_964, 198_376]);
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
        let (code, seconds) = dead_time(DEAD_TIME_S);
        assert_eq!((code, (seconds * 170e6).round()), (0x9e, 376.0)); // 2.21 us
        assert_eq!(SAMPLE_AT, 14_167 - 98);
    }

    /// An erasure of a page that is not the settings' would be the end of the firmware.
    #[test]
    fn the_pages_of_the_settings_are_the_last_with_one_bank_and_with_two() {
        assert_eq!([0, 1].map(|slot| settings_page(slot, true)), [(true, 124), (true, 126)]);
        assert_eq!([0, 1].map(|slot| settings_page(slot, false)), [(false, 126), (false, 127)]);
        let ends = [(0, 0), (0, 255), (1, 0), (1, 255)].map(|(s, w)| settings_address(s, w));
        assert_eq!(ends, [0x0807_e000, 0x0807_e7f8, 0x0807_f000, 0x0807_f7f8]);
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
