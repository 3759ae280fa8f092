//! Six complementary outputs of TIM1 at 6 kHz with dead time.
#![no_std]
#![no_main]

use embassy_stm32::gpio::OutputType;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::Channel;
use embassy_stm32::timer::complementary_pwm::{ComplementaryPwm, ComplementaryPwmPin};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::PwmPin;

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_stm32::init(foreign::clocks());
    let push_pull = OutputType::PushPull;
    let mut pwm = ComplementaryPwm::new(
        p.TIM1,
        Some(PwmPin::new(p.PA8, push_pull)),
        Some(ComplementaryPwmPin::new(p.PA7, push_pull)),
        Some(PwmPin::new(p.PA9, push_pull)),
        Some(ComplementaryPwmPin::new(p.PB0, push_pull)),
        Some(PwmPin::new(p.PA10, push_pull)),
        Some(ComplementaryPwmPin::new(p.PB1, push_pull)),
        None,
        None,
        Hertz(6000),
        CountingMode::CenterAlignedBothInterrupts,
    );
    pwm.set_dead_time(190);
    let half = pwm.get_max_duty() / 2;
    for channel in [Channel::Ch1, Channel::Ch2, Channel::Ch3] {
        pwm.set_duty(channel, half);
        pwm.enable(channel);
    }
    loop {
        cortex_m::asm::nop();
    }
}
