//! Two injected conversions of ADC1, triggered by TIM1.
#![no_std]
#![no_main]

use embassy_stm32::adc::{Adc, AdcChannel, AdcConfig, Exten, SampleTime};
use embassy_stm32::triggers::TIM1_TRGO2;

/// The last samples, at a place where the virtual board finds them.
#[unsafe(no_mangle)]
static mut SAMPLES: [u32; 2] = [0; 2];

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_stm32::init(foreign::clocks());
    let mut adc = Adc::new(p.ADC1, AdcConfig::default());
    let mut pin = p.PA0;
    let read = adc.blocking_read(&mut pin, SampleTime::CYCLES24_5);
    // SAFETY: nothing else writes it.
    unsafe { (&raw mut SAMPLES).cast::<u32>().write_volatile(u32::from(read)) };
    let sequence = [
        (pin.degrade_adc(), SampleTime::CYCLES24_5),
        (p.PA1.degrade_adc(), SampleTime::CYCLES47_5),
    ];
    let _injected = adc.setup_injected_conversions(sequence, TIM1_TRGO2, Exten::RISING_EDGE, false);
    loop {
        cortex_m::asm::nop();
    }
}
