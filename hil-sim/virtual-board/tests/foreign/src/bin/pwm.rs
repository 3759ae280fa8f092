//! Six complementary outputs of TIM1 at 6 kHz with dead time.
#![no_std]
#![no_main]

use embassy_stm32::{gpio::OutputType, time::Hertz, timer::Channel, timer::low_level::CountingMode, timer::simple_pwm::PwmPin};
use embassy_stm32::timer::complementary_pwm::{ComplementaryPwm, ComplementaryPwmPin};

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
    // 2.35 us, as the power stage of the reference board requires.
    pwm.set_dead_time(400);
    let half = pwm.get_max_duty() / 2;
    for channel in [Channel::Ch1, Channel::Ch2, Channel::Ch3] {
        pwm.set_duty(channel, half);
        pwm.enable(channel);
    }
    loop {
        cortex_m::asm::nop();
    }
}
