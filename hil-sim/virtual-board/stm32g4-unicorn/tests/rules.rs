//! The rules of the chip: for each one a script of register accesses that breaks it and one that keeps it, through the
//! bus and without firmware. They form one table, which makes the file long.

use stm32g4_unicorn::{Chip, periph::Reset, rules::Rule};

const TIM2: u32 = 0x4000_0000;
const IWDG: u32 = 0x4000_3000;
const PWR: u32 = 0x4000_7000;
const LPUART1: u32 = 0x4000_8000;
const SYSCFG: u32 = 0x4001_0000;
const COMP1: u32 = 0x4001_0200;
const TIM1: u32 = 0x4001_2c00;
const RCC: u32 = 0x4002_1000;
const FLASH: u32 = 0x4002_2000;
const GPIOA: u32 = 0x4800_0000;
const GPIOB: u32 = 0x4800_0400;
const ADC1: u32 = 0x5000_0000;
const DAC3: u32 = 0x5000_1000;
const DBGMCU: u32 = 0xe004_2000;

const CLOCK_CR: u32 = RCC;
const CFGR: u32 = RCC + 0x08;
const PLLCFGR: u32 = RCC + 0x0c;
const AHB2ENR: u32 = RCC + 0x4c;
const APB1ENR1: u32 = RCC + 0x58;
const APB2ENR: u32 = RCC + 0x60;
const CCIPR: u32 = RCC + 0x88;
const CCR: u32 = ADC1 + 0x308;
const BDTR: u32 = TIM1 + 0x44;

/// Bits of ADC_CR.
const REGULATOR: u32 = 1 << 28;
const CALIBRATE: u32 = 1 << 31;
const ENABLE: u32 = 1;
const START_INJECTED: u32 = 1 << 3;
/// 24 MHz / 6 * 85 / 2.
const PLL_170_MHZ: u32 = 1 << 24 | 85 << 8 | 5 << 4 | 3;
/// 24 MHz / 6 * 70 / 2.
const PLL_140_MHZ: u32 = 1 << 24 | 70 << 8 | 5 << 4 | 3;
const US: u64 = 170;

/// A step of a script.
#[derive(Clone, Copy)]
enum Step {
    /// Writes a word, then waits ten cycles.
    Write(u32, u32),
    /// Writes a word without the wait.
    Next(u32, u32),
    /// Reads a word.
    Read(u32),
    /// Lets time pass, ticks.
    Wait(u64),
    /// A debugger halts the core for 10 ms and continues it.
    Halt,
}
use Step::{Halt, Next, Read, Wait, Write};

/// Returns a chip after a script.
fn after(script: &[Step]) -> Chip {
    // The break input has a pull-up, and RS-485 a driver.
    let mut chip = Chip::default();
    (chip.break_pull_ohm, chip.bus_driver) = (4700.0, Some((2, 12)));
    let pass = |chip: &mut Chip, ticks: u64| {
        let end = chip.now + ticks;
        while chip.now < end && chip.reset.is_none() {
            chip.now = chip.next_event().clamp(chip.now, end);
            chip.catch_up();
            if chip.next_event() <= chip.now {
                chip.now += 1;
            }
        }
    };
    for step in script {
        match *step {
            Write(address, value) => {
                chip.write(address, 4, value);
                let cycle = chip.rcc.ticks_per_cycle;
                pass(&mut chip, 10 * cycle);
            }
            Next(address, value) => {
                chip.write(address, 4, value);
                chip.now += chip.rcc.ticks_per_cycle;
            }
            Read(address) => {
                chip.read(address, 4);
                chip.now += chip.rcc.ticks_per_cycle;
            }
            Wait(ticks) => pass(&mut chip, ticks),
            Halt => {
                chip.halt();
                pass(&mut chip, 10_000 * US);
                chip.resume();
            }
        }
        assert_eq!(chip.unknown, None);
    }
    chip
}

/// Returns the rules that a script breaks.
fn broken(script: &[Step]) -> Vec<Rule> {
    let mut rules: Vec<_> = after(script).rules.violations().iter().map(|v| v.rule).collect();
    rules.dedup();
    rules
}

/// Checks that one script breaks exactly this rule, and the other none.
fn twins(rule: Rule, breaks: &[&[Step]], keeps: &[&[Step]]) {
    assert_eq!(broken(&breaks.concat()), [rule], "breaks {rule:?}");
    assert_eq!(broken(&keeps.concat()), [], "keeps {rule:?}");
}

/// ADC1 and ADC2 on the synchronous clock / 4, with their regulator.
const ADC_ON: &[Step] =
    &[Write(AHB2ENR, 1 << 13), Write(CCR, 3 << 16), Write(ADC1 + 8, 0), Write(ADC1 + 8, REGULATOR)];
const CALIBRATED: &[Step] = &[Wait(20 * US), Write(ADC1 + 8, REGULATOR | CALIBRATE), Wait(10 * US)];
const READY: &[Step] = &[Write(ADC1 + 8, REGULATOR | ENABLE), Wait(10 * US)];
/// Boost, wait states, PLL on, half the bus clock.
const FAST: &[Step] = &[
    Write(APB1ENR1, 1 << 28),
    Write(CLOCK_CR, 1 << 16 | 1 << 8),
    Write(PLLCFGR, PLL_170_MHZ),
    Write(CLOCK_CR, 1 << 24 | 1 << 16 | 1 << 8),
];
const BOOST: &[Step] = &[Write(PWR + 0x80, 0)];
const WAIT_STATES: &[Step] = &[Write(FLASH, 0x4_0604)];
const HALF_THEN_WHOLE: &[Step] = &[Write(CFGR, 8 << 4 | 3), Wait(US), Write(CFGR, 3)];
/// TIM1 with its six outputs and its break pin.
const GATES: &[Step] = &[
    Write(APB2ENR, 1 << 11 | 1),
    Write(AHB2ENR, 3),
    Write(GPIOA, 0xabff_ffff & !(0x3f << 16 | 0xf << 12) | 0x2a << 16 | 0xa << 12),
    Write(GPIOA + 0x20, 6 << 28 | 6 << 24),
    Write(GPIOA + 0x24, 0x666),
    Write(GPIOB, 0xffff_feb0 | 0xa),
    Write(GPIOB + 0x20, 0x66),
    Write(TIM1 + 0x20, 0x555),
];
/// Break enabled, active high, with an inverted pin; outputs on.
const OUTPUTS_ON: &[Step] = &[
    Write(TIM1 + 0x60, 1 << 9 | 1),
    Write(BDTR, 1 << 13 | 1 << 12 | 3 << 8 | 0x40),
    Write(TIM1 + 0x10, 0),
    Write(BDTR, 1 << 15 | 1 << 13 | 1 << 12 | 3 << 8 | 0x40),
];

#[test]
fn a_peripheral_without_its_clock_drops_writes_and_reads_as_after_reset() {
    let script = [Write(PWR + 4, 0xb), Read(PWR)];
    twins(Rule::ClockGate, &[&script], &[&[Write(APB1ENR1, 1 << 28)], &script]);
    let mut chip = after(&script);
    chip.write(APB1ENR1, 4, 1 << 28);
    assert_eq!((chip.read(PWR, 4), chip.read(PWR + 4, 4)), (0x200, 0));
    // A written value stays hidden while the clock is off again.
    let mut chip = after(&[Write(APB1ENR1, 1 << 28), Write(PWR + 0x80, 0), Write(APB1ENR1, 0)]);
    assert_eq!(chip.read(PWR + 0x80, 4), 0x100);
    for address in [TIM2, LPUART1, SYSCFG, COMP1, TIM1, GPIOA, ADC1 + 8, DAC3] {
        assert_eq!(broken(&[Read(address)]), [Rule::ClockGate], "{address:#x}");
    }
    for address in [RCC, FLASH, IWDG, DBGMCU] {
        assert_eq!(broken(&[Read(address)]), [], "{address:#x}");
    }
}

#[test]
fn the_first_access_comes_two_cycles_after_the_clock() {
    let enable = Next(AHB2ENR, 1 << 13);
    let one_between = Wait(11);
    twins(
        Rule::EnableDelay,
        &[&[enable, one_between, Write(CCR, 3 << 16)]],
        &[&[enable, Read(AHB2ENR), Write(CCR, 3 << 16)]],
    );
    // The write is lost: the clock mode is as after reset.
    let mut chip = after(&[enable, one_between, Write(CCR, 3 << 16)]);
    assert_eq!(chip.read(CCR, 4), 0);
}

#[test]
fn above_150_mhz_the_range_is_boosted() {
    let switch = [Write(CFGR, 8 << 4 | 3)];
    twins(
        Rule::VoltageRange,
        &[FAST, WAIT_STATES, &switch],
        &[FAST, BOOST, WAIT_STATES, HALF_THEN_WHOLE],
    );
    // Without its clock, the boost is lost.
    let script = [BOOST, &FAST[1..], WAIT_STATES, &switch].concat();
    assert_eq!(broken(&script), [Rule::ClockGate, Rule::VoltageRange]);
    // 140 MHz needs none.
    let slower = [Write(PLLCFGR, PLL_140_MHZ)];
    assert_eq!(broken(&[FAST, &slower, WAIT_STATES, HALF_THEN_WHOLE].concat()), []);
}

#[test]
fn wait_states_follow_the_clock() {
    let three = [Write(FLASH, 0x4_0603)];
    twins(
        Rule::Latency,
        &[FAST, BOOST, &three, HALF_THEN_WHOLE],
        &[FAST, BOOST, WAIT_STATES, HALF_THEN_WHOLE],
    );
}

#[test]
fn the_bus_clock_rises_in_two_steps() {
    for breaks in [&[Write(CFGR, 3)][..], &[Next(CFGR, 8 << 4 | 3), Write(CFGR, 3)]] {
        twins(
            Rule::ClockStep,
            &[FAST, BOOST, WAIT_STATES, breaks],
            &[FAST, BOOST, WAIT_STATES, HALF_THEN_WHOLE],
        );
    }
}

#[test]
fn lock_holds_from_the_first_write() {
    let clock = [Write(APB2ENR, 1 << 11)];
    let [unlocked, locked] = [Write(BDTR, 0x40), Write(BDTR, 3 << 8 | 0x40)];
    twins(Rule::LockOnce, &[&clock, &[unlocked, locked]], &[&clock, &[locked, locked]]);
    let bdtr = |script: &[Step]| after(&[&clock[..], script].concat()).read(BDTR, 4);
    assert_eq!(bdtr(&[unlocked, locked, Write(BDTR, 0x20)]), 0x20, "not locked");
    assert_eq!(bdtr(&[locked, Write(BDTR, 3 << 8 | 0x20)]), 3 << 8 | 0x40, "locked");
}

#[test]
fn the_data_cache_is_off_while_the_flash_changes() {
    let keys = [Write(FLASH + 8, 0x4567_0123), Write(FLASH + 8, 0xcdef_89ab)];
    let off = [Write(FLASH, 0x4_0200)];
    let program = [Write(FLASH + 0x14, 1)];
    let erase =
        [Write(FLASH + 0x14, 1 << 11 | 1 << 1), Write(FLASH + 0x14, 1 << 16 | 1 << 11 | 1 << 1)];
    for work in [&program[..], &erase] {
        twins(Rule::DataCache, &[&keys, work], &[&keys, &off, work]);
    }
}

#[test]
fn a_converter_needs_a_clock() {
    let without = [Write(AHB2ENR, 1 << 13), Write(ADC1 + 8, 0), Write(ADC1 + 8, REGULATOR)];
    let own = [Write(CCIPR, 2 << 28)];
    twins(Rule::AdcClock, &[&without, CALIBRATED], &[&own, &without, CALIBRATED, READY]);
    assert_eq!(broken(&[ADC_ON, CALIBRATED, READY].concat()), []);
    // The calibration never ends, and the ADC never gets ready.
    let mut chip = after(&[&without[..], CALIBRATED].concat());
    assert_ne!(chip.read(ADC1 + 8, 4) & CALIBRATE, 0);
}

#[test]
fn a_converter_is_used_in_its_time() {
    let early_calibration = [Wait(10 * US), Write(ADC1 + 8, REGULATOR | CALIBRATE)];
    let early_enable = [
        Wait(20 * US),
        Write(ADC1 + 8, REGULATOR | CALIBRATE),
        Write(ADC1 + 8, REGULATOR | ENABLE),
    ];
    let early_start =
        [Next(ADC1 + 8, REGULATOR | ENABLE), Next(ADC1 + 8, REGULATOR | START_INJECTED)];
    let start = [Write(ADC1 + 8, REGULATOR | START_INJECTED)];
    let pins = [Write(AHB2ENR, 1 << 13 | 1)];
    for breaks in [
        [ADC_ON, &early_calibration].concat(),
        [ADC_ON, &early_enable].concat(),
        [ADC_ON, CALIBRATED, &early_start].concat(),
    ] {
        twins(Rule::AdcEarly, &[&breaks], &[ADC_ON, &pins, CALIBRATED, READY, &start]);
    }
    let mut chip = after(&[ADC_ON, CALIBRATED, READY].concat());
    assert_eq!(chip.read(ADC1, 4) & 1, 1, "ADRDY");
}

#[test]
fn jsqr_stays_while_conversions_run() {
    let queue_off = [Write(ADC1 + 0x0c, 1 << 31)];
    let triggered = 1 << 7 | 8 << 2;
    let sequence = [Write(ADC1 + 0x4c, triggered | 1 << 9)];
    let other = [Write(ADC1 + 0x4c, triggered | 2 << 9)];
    let [start, stop] = [START_INJECTED, 1 << 5].map(|bit| [Write(ADC1 + 8, REGULATOR | bit)]);
    let begun = [ADC_ON, CALIBRATED, READY, &queue_off, &sequence, &start].concat();
    twins(Rule::JsqrStarted, &[&begun, &other], &[&begun, &stop, &other]);
    let mut chip = after(&[&begun[..], &other].concat());
    assert_eq!(chip.read(ADC1 + 0x4c, 4), triggered | 1 << 9);
}

#[test]
fn the_watchdog_takes_a_value_at_a_time() {
    let unlock = Write(IWDG, 0x5555);
    let [short, long] = [Write(IWDG + 4, 0), Write(IWDG + 4, 6)];
    // Six clocks at 1/256 of 32 kHz are 48 ms.
    let [early, late] = [40_000 * US, 48_100 * US].map(Wait);
    let prescaler = |wait| [unlock, long, unlock, wait, short];
    twins(Rule::IwdgBusy, &[&prescaler(early)], &[&prescaler(late)]);
    // Prescaler and reload have a flag each.
    assert_eq!(broken(&[unlock, long, Write(IWDG + 8, 100)]), []);
    let mut chip = after(&[unlock, long]);
    assert_eq!(chip.read(IWDG + 0x0c, 4), 1, "PVU");
}

#[test]
fn outputs_and_inputs_have_their_pins() {
    twins(Rule::PinMode, &[&GATES[..2], &GATES[7..], OUTPUTS_ON], &[GATES, OUTPUTS_ON]);
    // A wrong alternate function of one gate.
    let wrong = [Write(GPIOA + 0x24, 0x665)];
    assert_eq!(broken(&[GATES, &wrong, OUTPUTS_ON].concat()), [Rule::PinMode]);
    // Converted channels: PA0 as an input is not analog.
    let injected = [Write(ADC1 + 0x4c, 1 << 9), Write(ADC1 + 8, REGULATOR | START_INJECTED)];
    let clocks = [Write(AHB2ENR, 1 << 13 | 1)];
    let input = [Write(GPIOA, 0xabff_fffc)];
    let converts = |pin: &[Step]| {
        broken(&[ADC_ON, CALIBRATED, READY, &clocks, pin, &injected, &[Wait(10 * US)]].concat())
    };
    assert_eq!(converts(&input), [Rule::PinMode]);
    assert_eq!(converts(&[]), []);
    // The encoder, and the port.
    let encoder = [Write(APB1ENR1, 1), Write(TIM2 + 8, 3), Write(TIM2, 1)];
    assert_eq!(broken(&encoder), [Rule::PinMode]);
    let port = [Write(RCC + 0x5c, 1), Write(LPUART1, 9), Write(LPUART1 + 0x28, 65)];
    assert_eq!(broken(&port), [Rule::PinMode]);
}

#[test]
fn outputs_stay_off_after_a_halt() {
    let stop_timer = [Write(DBGMCU + 0x10, 1 << 11)];
    let on = [GATES, OUTPUTS_ON].concat();
    let off = [Write(BDTR, 1 << 13 | 1 << 12 | 3 << 8 | 0x40)];
    let noticed = [Wait(400 * US)];
    twins(
        Rule::ResumedOutputs,
        &[&stop_timer, &on, &[Halt], &noticed],
        &[&stop_timer, &on, &[Halt], &off, &noticed],
    );
    // Off as if MOE had been reset, while the bit stays.
    let mut chip = after(&[&stop_timer[..], &on].concat());
    assert!(chip.tim1.outputs_on());
    chip.halt();
    assert!(!chip.tim1.outputs_on());
    assert_eq!(chip.read(BDTR, 4) >> 15 & 1, 1);
}

#[test]
fn a_halt_stops_what_dbgmcu_says() {
    let watchdog = [Write(IWDG, 0xcccc)];
    let stop = [Write(DBGMCU + 8, 1 << 12)];
    // 512 ms at 1/4; six halts of 100 ms.
    let halts = [Halt; 60];
    let expires = |script: &[&[Step]]| after(&script.concat()).reset;
    assert_eq!(expires(&[&watchdog, &halts]), Some(Reset::Watchdog));
    assert_eq!(expires(&[&watchdog, &stop, &halts]), None);
    // DBGMCU survives all resets except that of power-up.
    for (cause, kept) in [(Reset::Watchdog, 1 << 12), (Reset::Power, 0)] {
        let mut chip = after(&stop);
        chip.reset(cause);
        assert_eq!(chip.read(DBGMCU + 8, 4), kept);
    }
}

#[test]
fn the_supply_monitor_is_on_before_it_is_locked() {
    let clocks = [Write(APB1ENR1, 1 << 28), Write(APB2ENR, 1)];
    let on = [Write(PWR + 4, 5 << 1 | 1)];
    let lock = [Write(SYSCFG + 0x1c, 1 << 2)];
    twins(Rule::SupplyMonitor, &[&clocks, &lock, &on], &[&clocks, &on, &lock]);
    // Below 2.81 V the outputs go off; below 1.7 V the chip is reset.
    let mut chip = after(&[&clocks[..], &on, &lock, GATES, OUTPUTS_ON].concat());
    for (volts, outputs, reset) in
        [(2.9, true, None), (2.75, false, None), (1.6, false, Some(Reset::Power))]
    {
        chip.set_supply(volts);
        assert_eq!(chip.read(PWR + 0x14, 4) >> 11 & 1, u32::from(volts < 2.81), "PVDO");
        assert_eq!((chip.tim1.outputs_on(), chip.reset), (outputs, reset), "{volts} V");
    }
}

#[test]
fn a_level_is_set_up_in_order_and_waited_for() {
    let clocks = [Write(AHB2ENR, 1 << 18), Write(APB2ENR, 1)];
    let data = [Write(DAC3 + 8, 3909)];
    let mode = [Write(DAC3 + 0x3c, 2 << 14 | 3)];
    let on = [Write(DAC3, 1)];
    let ready = [Wait(9 * US), Read(DAC3 + 0x34)];
    let comparator = [Write(COMP1, 1 << 16 | 4 << 4 | 1), Wait(10 * US)];
    let right = [&clocks[..], &data, &mode, &on, &ready, &comparator];
    twins(Rule::DacMode, &[&clocks, &mode, &data, &on, &ready, &comparator], &right);
    twins(Rule::DacReady, &[&clocks, &data, &mode, &on, &[Wait(9 * US)], &comparator], &right);
    // The output is valid 8 us after it is on, and the comparator follows its level with its hysteresis.
    let mut chip = after(&right.concat());
    let high = |chip: &mut Chip, code| {
        chip.compare(0, 0, code);
        chip.now += 10;
        chip.catch_up();
        chip.read(COMP1, 4) >> 30 & 1 == 1
    };
    assert!(!high(&mut chip, 3909) && high(&mut chip, 3910) && high(&mut chip, 3900));
    assert!(!high(&mut chip, 3896));
    chip.write(DAC3 + 8, 4, 0);
    assert!(!high(&mut chip, 2000), "not settled");
    chip.now += 3 * US;
    assert!(high(&mut chip, 2000), "settled");
}

/// An ADC that waits for TIM1, with the chip's internal reference as a regular channel, sampled with this field of the
/// sampling time.
fn regular_beside_injected(sampling: u32) -> Vec<Step> {
    let triggered = 1 << 7;
    let converter = [
        Write(CCR, 3 << 16 | 1 << 22),
        Write(ADC1 + 0x0c, 1 << 31),
        Write(ADC1 + 0x4c, triggered | 1 << 9),
        Write(ADC1 + 0x18, sampling << 24),
        Write(ADC1 + 0x30, 18 << 6),
        Write(ADC1 + 8, REGULATOR | START_INJECTED),
    ];
    let timer = [
        Write(APB2ENR, 1 << 11),
        Write(TIM1 + 0x2c, 14_167),
        Write(TIM1 + 0x40, 14_000),
        Write(TIM1 + 0x1c, 7 << 12),
        Write(TIM1 + 4, 7 << 4),
        Write(TIM1 + 0x14, 1),
        Write(TIM1, 1 << 5 | 1),
    ];
    [ADC_ON, CALIBRATED, READY, &converter, &timer].concat()
}

#[test]
fn a_trigger_finds_no_regular_conversion() {
    let begun = regular_beside_injected(6);
    let convert = |after| [Wait(after), Write(ADC1 + 8, REGULATOR | 1 << 2), Wait(10_000)];
    // 260 clocks of the ADC are 1040 ticks.
    twins(Rule::AdcDisturbed, &[&begun, &convert(13_300)], &[&begun, &convert(12_000)]);
}

/// ADC1 samples a current from 14 000 ticks on. ADC3 converts for 653 clocks, which are 2612 ticks.
#[test]
fn slow_inputs_are_converted_beside_no_current() {
    const ADC3: u32 = ADC1 + 0x400;
    let third = |step: &Step| match *step {
        Write(at @ ADC1..ADC3, value) => Write(at + 0x400, value),
        Write(AHB2ENR, _) => Write(AHB2ENR, 3 << 13),
        other => other,
    };
    let on: Vec<_> = [ADC_ON, CALIBRATED, READY].concat().iter().map(third).collect();
    let both_on = Write(AHB2ENR, 3 << 13);
    let first = regular_beside_injected(6);
    let begun = [&on[..], &[Write(ADC3 + 0x14, 7), both_on], &first[1..]].concat();
    let convert = |after| [Wait(after), Write(ADC3 + 8, REGULATOR | 1 << 2), Wait(10_000)];
    twins(Rule::AdcBeside, &[&begun, &convert(12_000)], &[&begun, &convert(10_000)]);
}

#[test]
fn the_reference_inside_is_sampled_for_long() {
    let [short, long] = [5, 6].map(regular_beside_injected);
    let convert = [Write(ADC1 + 8, REGULATOR | 1 << 2), Wait(5000)];
    twins(Rule::OwnReference, &[&short, &convert], &[&long, &convert]);
}
