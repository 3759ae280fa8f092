//! Clocks: 170 MHz from the crystal, or from the internal oscillator if the crystal does not start.

use cortex_m::asm;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::pwr::{PwrExt, VoltageScale};
use stm32g4xx_hal::rcc::{
    Config, PllConfig, PllMDiv, PllNMul, PllRDiv, PllSrc, Rcc, RccExt, SysClockSrc,
};
use stm32g4xx_hal::time::RateExtU32;

use super::StartError;
use crate::board;
use crate::boards::SELECTED;

/// Source of the core's clock, with its code in PLLSRC.
#[derive(Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum Source {
    /// The crystal.
    Crystal = 3,
    /// The internal oscillator: 1 % accurate, and so are the control rate and all speeds.
    Internal = 2,
}

// Both oscillators are divided to 4 MHz, multiplied to 340 MHz and halved: inside what the PLL
// allows (input 2.66 to 16 MHz, oscillator 96 to 344 MHz).
const CRYSTAL_DIVIDER: PllMDiv = match SELECTED.wiring.crystal_hz {
    8_000_000 => PllMDiv::DIV_2,
    16_000_000 => PllMDiv::DIV_4,
    24_000_000 => PllMDiv::DIV_6,
    _ => panic!("wiring.crystal_hz: 8, 16 or 24 MHz are possible"),
};
const INTERNAL_DIVIDER: PllMDiv = PllMDiv::DIV_4;
const MULTIPLIER: PllNMul = PllNMul::MUL_85;
const OUTPUT_DIVIDER: PllRDiv = PllRDiv::DIV_2;

/// Longest until the PLL has locked, ms: many times the 40 us of the datasheet.
const PLL_START_MS: u32 = 2;

const fn pll_hz(oscillator_hz: u32, divider: PllMDiv) -> u32 {
    oscillator_hz / divider.divisor() * MULTIPLIER.multiplier() / OUTPUT_DIVIDER.divisor()
}
const _: () = assert!(pll_hz(SELECTED.wiring.crystal_hz, CRYSTAL_DIVIDER) == board::CLOCK_HZ);
const _: () = assert!(pll_hz(board::HSI_HZ, INTERNAL_DIVIDER) == board::CLOCK_HZ);

/// Switches on the clock of a peripheral, and waits two bus cycles until the peripheral can be accessed (ST reads the enable register
/// back after every enable, `stm32g4xx_ll_bus.h`). The result is an error if the bit does not stay set.
macro_rules! clock_on {
    ($register:expr, $bit:ident, $name:literal) => {{
        $register.modify(|_, w| w.$bit().set_bit());
        let on = $register.read().$bit().bit();
        cortex_m::asm::dsb();
        if on { Ok(()) } else { Err(concat!($name, " has no clock")) }
    }};
}
pub(crate) use clock_on;

/// Brings core, buses and timers to [`board::CLOCK_HZ`], and reads back the conditions for it.
pub fn start(
    rcc: pac::RCC,
    pwr: pac::PWR,
    flash: &pac::FLASH,
) -> (Rcc, Source, Result<(), StartError>) {
    let rcc = rcc.constrain();
    // PWR is off after reset, and the HAL leaves it off: without its clock no write below has an effect.
    let powered = clock_on!(rcc.apb1enr1(), pwren, "PWR");
    // The range without boost, from which the HAL takes the steps to 170 MHz. A reset may have kept the boost.
    pwr.cr5().modify(|_, w| w.r1mode().set_bit());
    let (source, mux, divider) = if crystal_starts(&rcc) {
        (Source::Crystal, PllSrc::HSE(SELECTED.wiring.crystal_hz.Hz()), CRYSTAL_DIVIDER)
    } else {
        rcc.cr().modify(|_, w| w.hseon().off());
        (Source::Internal, PllSrc::HSI, INTERNAL_DIVIDER)
    };

    // The supply monitor; its output goes to the break of TIM1 (`pwm.rs`).
    // SAFETY: three bits, all of them levels.
    pwr.cr2().modify(|_, w| unsafe { w.pvdls().bits(board::SUPPLY_LEVEL) }.pvde().set_bit());

    let pll =
        PllConfig { mux, m: divider, n: MULTIPLIER, r: Some(OUTPUT_DIVIDER), q: None, p: None };
    // The HAL waits for the PLL without a limit, and no watchdog runs yet.
    if !pll_locks(&rcc, source, divider) {
        return (rcc, source, Err("the PLL does not lock"));
    }
    // Above 150 MHz the core needs its boosted voltage range.
    let power = pwr.constrain().vos(VoltageScale::Range1 { enable_boost: true }).freeze();
    // The HAL sets the flash wait states (4) that belong to voltage range and clock.
    let rcc = rcc.freeze(Config::new(SysClockSrc::PLL).pll_cfg(pll), power);

    // The HAL leaves the prefetch off; the caches are on after reset.
    flash.acr().modify(|_, w| w.prften().set_bit());
    if source == Source::Crystal {
        // If the crystal stops, it raises the NMI, and TIM1's break with it.
        rcc.cr().modify(|_, w| w.csson().on());
    }
    (rcc, source, powered.and_then(|()| read_back(flash)))
}

/// Reads back the conditions under which the core may run at [`board::CLOCK_HZ`].
fn read_back(flash: &pac::FLASH) -> Result<(), StartError> {
    // SAFETY: only reads; the HAL has taken the owner of the registers.
    let pwr = unsafe { &*pac::PWR::ptr() };
    // R1MODE clear means boosted; VOSF is set while the voltage is still changing.
    if pwr.cr5().read().r1mode().bit() || pwr.sr2().read().vosf().bit() {
        return Err("the core voltage is not boosted, but 170 MHz need it");
    }
    let monitor = pwr.cr2().read();
    if !monitor.pvde().bit() || monitor.pvdls().bits() != board::SUPPLY_LEVEL {
        return Err("the supply monitor does not read back");
    }
    if flash.acr().read().latency().bits() < board::WAIT_STATES {
        return Err("too few wait states of the flash");
    }
    Ok(())
}

/// Whether the PLL locks on its source, within a limit; leaves it off.
fn pll_locks(rcc: &Rcc, source: Source, divider: PllMDiv) -> bool {
    let setting = MULTIPLIER.multiplier() << 8 | (divider.divisor() - 1) << 4 | source as u32;
    // SAFETY: PLLN, PLLM and PLLSRC as RM0440 codes them; no output is on.
    rcc.pllcfgr().write(|w| unsafe { w.bits(setting) });
    rcc.cr().modify(|_, w| w.pllon().on());
    let locks = becomes(|| rcc.cr().read().pllrdy().is_ready(), PLL_START_MS);
    rcc.cr().modify(|_, w| w.pllon().off());
    locks && becomes(|| !rcc.cr().read().pllrdy().is_ready(), PLL_START_MS)
}

/// Waits until `so` is true, for this many milliseconds at most.
fn becomes(so: impl Fn() -> bool, ms: u32) -> bool {
    // Each step takes a tenth of a millisecond: the core still runs from the internal oscillator.
    (0..10 * ms).any(|_| {
        so() || {
            asm::delay(board::HSI_HZ / 10_000);
            false
        }
    })
}

/// Switches the crystal on and waits for it, with a limit.
fn crystal_starts(rcc: &Rcc) -> bool {
    rcc.cr().modify(|_, w| w.hseon().on());
    becomes(|| rcc.cr().read().hserdy().is_ready(), board::HSE_START_MS)
}
