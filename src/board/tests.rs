use super::*;

#[test]
fn every_dead_time_that_may_be_set_is_made_within_four_percent() {
    for ns in 500..=6000 {
        let wanted = ns as f32 * 1e-9;
        let made = dead_time(wanted).1;
        assert!(made > wanted - 0.2e-9 && made < 1.04 * wanted + 12e-9, "{wanted}: {made}");
        // A dead time that the timer generates, requested again, gives the same dead time.
        assert_eq!(dead_time(made), dead_time(wanted));
    }
    // Any other request has a field, too.
    for odd in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
        let _ = dead_time(odd);
    }
}

#[test]
fn the_comparator_trips_between_the_software_and_the_end_of_the_range() {
    let trip = SELECTED.dc_link.line.value.at(protection(SELECTED, &settings()).over_voltage);
    assert!(trip > settings().dc_over_v() && trip < SELECTED.dc_link.line.value.at(ADC_FULL_SCALE));
    assert!((trip - 430.0).abs() < 0.2, "{trip}");
}

/// A 48 V board with sensors to 100 A, and limits at the ends of the ranges.
#[test]
fn the_protection_follows_the_settings_and_stays_in_the_range_of_the_converters() {
    let mut s = settings();
    let current = Line { gain: 200.0 / 4095.0, offset: -100.0 };
    (s.scales.current_a, s.scales.current_b) = (current, current);
    s.scales.dc_link = Line { gain: 0.02, offset: 0.0 };
    (s.limits.trip_a, s.limits.dc_over_v) = (Some(80.0), Some(60.0));
    let Protection { window_a, window_b, over_voltage } = protection(SELECTED, &s);
    assert_eq!(window_a, window_b);
    assert!(
        (current.at(window_a.1) - 81.6).abs() < 0.1 && (current.at(window_a.0) + 81.6).abs() < 0.1
    );
    assert!((s.scales.dc_link.at(over_voltage) - 64.5).abs() < 0.05);
    (s.limits.trip_a, s.limits.dc_over_v) = (Some(s.sensor_range_a()), Some(s.dc_link_range_v()));
    let ends = protection(SELECTED, &s);
    // The comparator's level ends at the board's limit: 436.9 V at 0.11 V a count, for any scale.
    assert_eq!((ends.window_a, ends.over_voltage), ((1, ADC_FULL_SCALE - 1), 3971));
}

/// Reaction time of an analog watchdog, from an over-current to the outputs off, ns: up to a period until the next sample, the
/// conversion, and the latest start of the interrupt that is allowed.
const WATCHDOG_REACTION_NS: u32 =
    (2 * PWM_TOP as u32 + CONVERSION.ticks()) * 1000 / CYCLES_PER_US + LATEST_START_US * 1000;
/// Reaction time of the software, from an over-current to the outputs off, ns: up to a period until the next sample, the whole sequence,
/// the latest allowed start of the interrupt, and the control step.
const SOFTWARE_REACTION_NS: u32 = (2 * PWM_TOP as u32 + SAMPLES_READY_TICKS) * 1000 / CYCLES_PER_US
    + (LATEST_START_US + LONGEST_STEP_US) * 1000;
/// Longest control step assumed here, us; `status` shows the longest so far, in cycles.
const LONGEST_STEP_US: u32 = 20;
// Both reactions by software end before the next period does.
const _: () =
    assert!(WATCHDOG_REACTION_NS < SOFTWARE_REACTION_NS && SOFTWARE_REACTION_NS < 200_000);

#[test]
fn reaction_times_are_those_of_the_documentation() {
    let times = [
        format!("| {BREAK_REACTION_NS} ns |"),
        format!("| ≤ {:.0} µs |", f64::from(WATCHDOG_REACTION_NS) / 1e3),
        format!("| ≤ {:.0} µs |", f64::from(SOFTWARE_REACTION_NS) / 1e3),
    ];
    let causes = ["break input of the power stage", "analog watchdogs", "software: phase currents"];
    for (cause, time) in causes.into_iter().zip(times) {
        let mut rows = include_str!("../../docs/protections.md").lines();
        let row = rows.find(|row| row.starts_with(&format!("| {cause}"))).unwrap();
        assert!(row.ends_with(&time), "{row}: {time}");
    }
}

#[test]
fn the_numbers_are_those_of_the_design() {
    assert_eq!(PWM_TOP, 14_167);
    let (code, seconds) = dead_time(SELECTED.dead_time_s.value);
    assert_eq!((code, (seconds * 170e6).round()), (0x9e, 376.0)); // 2.21 us
    assert_eq!(SAMPLE_AT, 14_167 - 98);
}

/// One update in a control period, at a top; the period is the same within 1e-4, and the drive has the timer's count.
#[test]
fn the_timer_makes_equal_pulses_in_a_control_period() {
    let tops = [(Carrier::Khz6, 14_167), (Carrier::Khz12, 7083), (Carrier::Khz18, 4722)];
    for (switching_khz, top) in tops {
        let mut settings = settings();
        settings.inverter.switching_khz = switching_khz;
        let timer = Timer::of(&settings.inverter);
        assert_eq!(timer.top(), top);
        assert_eq!(f32::from(top), settings.build().unwrap().front_end.top);
        // The timer leaves out this many ends of the count before an update; each pulse has two ends.
        assert_eq!(timer.updates_left_out() + 1, 2 * switching_khz.pulses());
        let hz = CLOCK_HZ as f32 / (2 * u32::from(top) * u32::from(switching_khz.pulses())) as f32;
        assert!((hz / 6000.0 - 1.0).abs() < 1e-4, "{hz} Hz");
    }
}

/// 0 A gave 2024 counts with 3.0 V (Table 4): the same voltage is 1840 counts with 3.3 V.
#[test]
fn the_calibration_follows_the_reference() {
    let line = SELECTED.currents.a.line.value;
    let zero = -line.offset / line.gain;
    assert!((zero - 2022.0 / 1.1).abs() < 1.0, "zero at {zero}");
}

#[test]
fn the_analog_watchdogs_trip_between_the_software_and_the_end_of_the_range() {
    let Protection { window_a, window_b, .. } = protection(SELECTED, &settings());
    for (line, (low, high)) in
        [(settings().scales.current_a, window_a), (settings().scales.current_b, window_b)]
    {
        let software = settings().trip_a();
        assert!(line.at(high) > software && line.at(low) < -software);
        assert!(line.at(high + 1) < 4.47 && line.at(low - 1) > -4.47);
    }
}

#[test]
fn the_drive_accepts_the_board() {
    assert!(settings().build().is_ok());
}

/// A watchdog oscillator at the ends of the datasheet's range passes, beside a crystal and beside the internal oscillator with its error.
/// Beyond 29 and 35 kHz it fails.
#[test]
fn clocks_agree_over_the_range_of_the_oscillator() {
    let clocks =
        |hz: f64, error: f64| ((8.0 * f64::from(CLOCK_HZ) * (1.0 + error) / hz) as u32, HSI_CLOCKS);
    for hz in [29.5e3, 32e3, 34e3] {
        assert!(clocks_agree(clocks(hz, 0.0), false), "{hz}");
        assert!([-0.02, 0.02].iter().all(|error| clocks_agree(clocks(hz, *error), true)), "{hz}");
    }
    for hz in [0.5, 16e3, 28.2e3, 35.8e3, 64e3] {
        assert!(!clocks_agree(clocks(hz, 0.0), false) && !clocks_agree(clocks(hz, 0.0), true));
    }
    assert!(!clocks_agree((0, HSI_CLOCKS), true) && !clocks_agree((clocks(32e3, 0.0).0, 0), true));
    // The HSI at the ends of its range passes, a crystal that is 4 % off beside a right one does not.
    for (error, right) in [(0.02, true), (-0.02, true), (0.04, false), (-0.04, false)] {
        let hsi = (f64::from(HSI_CLOCKS) * (1.0 + error)) as u32;
        assert_eq!(clocks_agree((clocks(32e3, error).0, hsi), false), right, "{error}");
    }
}

/// The factory's option bytes pass, and each bit that the firmware needs is named.
#[test]
fn wrong_option_bytes_are_named() {
    let factory = 0xffef_f8aa;
    assert_eq!(check_options(factory), Ok(()));
    let names = ["IWDG_SW", "WWDG_SW", "BFB2", "DBANK", "SRAM_PE"];
    for (name, bit) in names.into_iter().zip([16, 19, 20, 22, 24]) {
        let why = check_options(factory ^ 1 << bit).unwrap_err();
        assert!(why.contains(&format!("set {name} to {}", factory >> bit & 1)), "{why}");
    }
}

/// The factory has measured the chip's own reference with 3.0 V.
#[test]
fn references_agree_within_three_per_cent() {
    let code = |volts: f32| (1655.0 * 3.0 / volts) as u16;
    for (volts, right) in
        [(3.3, true), (3.22, true), (3.38, true), (3.18, false), (3.42, false), (3.0, false)]
    {
        assert_eq!(references_agree(code(volts), 1655), right, "{volts} V");
    }
    assert!(!references_agree(0, 1655) && !references_agree(1504, u16::MAX));
    assert!(!references_agree(1504, 0));
}

/// Only nSWBOOT0 = 0 with nBOOT0 = 1 ends that the boot pin counts, whatever the other option bytes are.
#[test]
fn the_boot_pin_counts_unless_both_bits_say_otherwise() {
    for others in [0, !(N_SWBOOT0 | N_BOOT0)] {
        for (bits, counts) in
            [(0, true), (N_SWBOOT0, true), (N_SWBOOT0 | N_BOOT0, true), (N_BOOT0, false)]
        {
            assert_eq!(boot_pin_counts(others | bits), counts, "{others:#x} {bits:#x}");
        }
    }
}
