//! The gates after the drivers of every board, and the shunts, with register scripts and without firmware.

use crate::common::script::*;
use anyhow::Result;
use drive_core::Compare;
use stm32g4_unicorn::periph::Reset;
use virtual_board::power_stage::bridge::{BadGates, Leg};
use virtual_board::power_stage::shunts::Shunts;
use virtual_board::power_stage::{ALL, PowerStage};

const MIDDLE: [u32; 3] = [TOP / 2; 3];

/// Returns the ticks of a period in which a switch of a leg is on.
fn on(leg: &Leg, side: usize) -> u32 {
    leg.pieces.iter().filter(|piece| piece.on[side]).map(|piece| piece.ticks).sum()
}

fn st_boards() -> impl Iterator<Item = &'static PowerStage> {
    ALL.into_iter().filter(|stage| !stage.driver.low.on_at_high)
}

/// With the polarity of the board, the gates are off in every state but on, in which they alternate with the dead time.
#[test]
fn the_right_set_up_is_off_unless_it_is_on() -> Result<()> {
    for stage in ALL {
        let mut script = Script::new(stage)?;
        assert!(!script.board.gates().any_on(), "{}: after power-on", stage.name);
        script.bring_up(Setup::of(stage))?;
        assert!(!script.board.gates().any_on(), "{}: idle", stage.name);
        script.compare([3000, 7000, 11_000])?;
        script.outputs(true)?;
        script.wait(PERIOD)?;
        let gates = script.board.gates().clone();
        let expected = Compare { a: 3000, b: 7000, c: 11_000, enabled: true };
        assert_eq!(gates.compare(), expected, "{}", stage.name);
        assert_eq!(gates.dead_time, 376);
        for (leg, compare) in gates.legs.iter().zip([3000, 7000, 11_000]) {
            assert_eq!([on(leg, 0), on(leg, 1)], [2 * compare - 376, 2 * (TOP - compare) - 376]);
            // Around the top of the counter the low side is on.
            assert_eq!(leg.pieces[0].on, [false, true]);
        }
        script.outputs(false)?;
        assert!(!script.board.gates().any_on(), "{}: off", stage.name);
        // The fault input.
        script.outputs(true)?;
        script.modify(TIM1 + 0x60, 0x201, 0x201)?;
        script.modify(TIM1 + BDTR, 0x3000, 0x3000)?;
        script.wait(PERIOD)?;
        assert!(script.board.gates().any_on());
        script.board.set_fault_pin(false);
        assert!(!script.board.gates().any_on(), "{}: break", stage.name);
        script.wait(PERIOD)?;
        script.board.set_fault_pin(true);
        // A reset releases the pins while the outputs are on.
        script.outputs(true)?;
        script.wait(PERIOD / 3)?;
        assert!(script.board.gates().any_on());
        script.board.reset(Reset::Pin);
        assert!(!script.board.gates().any_on(), "{}: reset", stage.name);
        script.wait(PERIOD)?;
    }
    Ok(())
}

/// A board whose low sides are on at a low level, driven active high: when the timer takes the pins over, every low
/// side goes on and the motor is shorted.
#[test]
fn an_idle_level_that_is_on_shorts_the_motor_and_is_caught() -> Result<()> {
    for stage in st_boards() {
        let mut script = Script::new(stage)?;
        script.timer(Setup::ACTIVE_HIGH)?;
        let seen = violation(script.pins());
        let on = BadGates::OnWhileOff { leg: 0, side: 1, undefined: false };
        assert!(is(&seen, on), "{}: {seen}", stage.name);
        // The script continues regardless: at the motor, three low sides are on.
        script.regardless = true;
        script.pins()?;
        assert_eq!(script.applied(), Compare::LOW_SIDES_ON, "{}", stage.name);
    }
    Ok(())
}

/// Low sides that are on brake a motor that rotates with its flux; with open switches it coasts.
#[test]
fn the_short_carries_current() -> Result<()> {
    for stage in st_boards() {
        let mut currents = Vec::new();
        for setup in [Setup::of(stage), Setup { idle: 0, ..Setup::of(stage) }] {
            let mut script = Script::new(stage)?;
            script.bring_up(Setup::of(stage))?;
            script.compare([TOP / 2 + 600, TOP / 2 - 300, TOP / 2 - 300])?;
            script.outputs(true)?;
            script.wait(600 * PERIOD)?;
            let loaded = script.board.plant.phase_currents()[0];
            script.modify(TIM1 + CR2, 0x3f00, setup.idle)?;
            let result = script.outputs(false);
            assert_eq!(result.is_err(), setup.idle == 0, "{}", stage.name);
            // 3 ms: the diodes have long since fed the current back into the dc link.
            script.regardless = true;
            script.wait(18 * PERIOD)?;
            currents.push(script.board.plant.phase_currents()[0].abs() / loaded);
        }
        let [off, shorted] = currents[..] else { panic!("two runs") };
        assert!(off < 1e-6 && shorted > 0.2, "{}: {currents:?}", stage.name);
    }
    Ok(())
}

/// Polarities that are wrong only while the outputs are on.
#[test]
fn a_wrong_polarity_is_caught_at_the_first_pulse() -> Result<()> {
    let caught = |stage, change: u32, expected: &dyn Fn(&str) -> bool| -> Result<()> {
        let mut script = Script::new(stage)?;
        let right = Setup::of(stage);
        script.bring_up(Setup { ccer: right.ccer ^ change, ..right })?;
        script.compare(MIDDLE)?;
        let seen = violation(script.outputs(true).and_then(|()| script.wait(2 * PERIOD)));
        assert!(expected(&seen), "{} with CCER ^ {change:#x}: {seen}", stage.name);
        Ok(())
    };
    for stage in ALL {
        let interlock = stage.driver.interlock;
        let together = |leg| {
            move |seen: &str| {
                is(
                    seen,
                    if interlock { BadGates::Interlocked(leg) } else { BadGates::Together(leg) },
                )
            }
        };
        // CC1NP, CC2NP; CC3P.
        caught(stage, 0x8, &together(0))?;
        caught(stage, 0x80, &together(1))?;
        caught(stage, 0x200, &together(2))?;
        // Both of leg a: they alternate, but during the dead time of the timer both are on.
        caught(stage, 0xa, &together(0))?;
    }
    Ok(())
}

/// A driver with an interlock does not turn the motor if it is driven with the wrong polarity.
#[test]
fn an_interlock_leaves_the_motor_without_voltage() -> Result<()> {
    for stage in st_boards() {
        let mut script = Script::new(stage)?;
        let right = Setup::of(stage);
        script.bring_up(Setup { ccer: right.ccer ^ 0x888, ..right })?;
        script.compare([TOP / 2 + 600, TOP / 2 - 300, TOP / 2 - 300])?;
        script.regardless = true;
        script.outputs(true)?;
        script.wait(100 * PERIOD)?;
        assert_eq!(script.applied(), Compare::OFF);
        assert_eq!(script.board.plant.phase_currents(), [0.0; 3]);
    }
    Ok(())
}

/// Dead time: of the timer, of the driver if the timer's is shorter, of none.
#[test]
fn the_dead_time_at_the_gates_is_the_longer_one() -> Result<()> {
    for stage in ALL {
        let own = (stage.driver.dead_time_s * 170e6).round() as u32;
        let shortest = (stage.limits.dead_time_s * 170e6).round() as u32;
        for code in [0, 10, 0x9e] {
            let mut script = Script::new(stage)?;
            let right = Setup::of(stage);
            script.bring_up(Setup { bdtr: 0xc00 | code, ..right })?;
            script.compare(MIDDLE)?;
            let result = script.outputs(true).and_then(|()| script.wait(2 * PERIOD));
            let made = if code == 0x9e { 376 } else { 2 * code };
            let dead_time = made.max(own);
            let gates = script.board.gates();
            assert_eq!(gates.dead_time, dead_time, "{}", stage.name);
            for (leg, compare) in gates.legs.iter().zip(MIDDLE) {
                let on = [on(leg, 0), on(leg, 1)];
                let ideal = [2 * compare, 2 * (TOP - compare)];
                assert_eq!(on, ideal.map(|ticks| ticks - dead_time), "{}", stage.name);
            }
            if dead_time < shortest {
                let seen = violation(result);
                assert!(is(&seen, BadGates::Short { leg: 0, dead_time }), "{}: {seen}", stage.name);
            } else {
                result?;
            }
        }
    }
    Ok(())
}

/// Pins that nothing drives: inputs with the chip's resistors, outputs that the timer releases, other functions.
#[test]
fn a_pin_that_is_released_is_where_its_resistors_hold_it() -> Result<()> {
    for stage in ALL {
        let strong = stage.driver.low.on_at_high;
        let [[high_a, low_a], [high_b, low_b], [high_c, _]] =
            stage.wiring.gates.map(|leg| leg.map(|gate| gate.0));
        let port = |port: usize| GPIOA + 0x400 * port as u32;
        // OSSI = 0: without MOE the timer releases the pins; with the chip's pull-downs, then its pull-ups.
        for (pull, safe) in [(0, true), (2, strong), (1, strong)] {
            let mut script = Script::new(stage)?;
            let right = Setup::of(stage);
            script.timer(Setup { bdtr: right.bdtr & !(1 << 10), ..right })?;
            script.pins()?;
            let result = [low_a, high_a, high_b, high_c].into_iter().try_for_each(|(at, pin)| {
                script.modify(port(at) + PUPDR, 3 << (2 * pin), pull << (2 * pin))
            });
            let name = stage.name;
            assert_eq!(result.is_ok(), safe, "{name}, pull {pull}: {result:?}");
            assert_eq!(script.board.gates().any_on(), !safe);
        }
        // A pin of another peripheral has no known level.
        let mut script = Script::new(stage)?;
        let (at, pin) = low_a;
        let shift = 4 * (pin % 8);
        script.modify(port(at) + 0x20 + 4 * (pin / 8), 0xf << shift, 2 << shift)?;
        let seen = violation(script.modify(port(at) + MODER, 3 << (2 * pin), 2 << (2 * pin)));
        assert!(is(&seen, BadGates::OnWhileOff { leg: 0, side: 1, undefined: true }), "{seen}");
        // A pin that software drives to the level that switches the gate on.
        let mut script = Script::new(stage)?;
        let level = if stage.driver.low.on_at_high { 1 } else { 0 };
        let (at, pin) = low_b;
        script.write(port(at) + ODR, (1 - level) << pin)?;
        script.modify(port(at) + MODER, 3 << (2 * pin), 1 << (2 * pin))?;
        let seen = violation(script.write(port(at) + ODR, level << pin));
        assert!(is(&seen, BadGates::OnWhileOff { leg: 1, side: 1, undefined: false }), "{seen}");
    }
    Ok(())
}

/// Returns the current that corresponds to ADC counts, without the errors of gain and offset, A.
fn amperes(shunts: &Shunts, code: u16) -> f64 {
    (f64::from(code) * 3.3 / 4096.0 - shunts.zero_v) / shunts.volts_per_a
}

/// Returns the largest error of a reading, A: gain 0.4 %, offset 2 mV, five times the noise and one count.
fn allowed(shunts: &Shunts, current: f64) -> f64 {
    let volts = 2e-3 + 5.0 * shunts.noise_v + 3.3 / 4096.0;
    0.004 * current.abs() + volts / shunts.volts_per_a.abs()
}

/// Returns a board with shunts whose motor carries a current, with a voltage across phase a and half the duty on average.
fn loaded(stage: &'static PowerStage, volts: f64) -> Result<Script> {
    let mut script = Script::new(stage)?;
    script.bring_up(Setup::of(stage))?;
    let dc_link = script.board.plant.dc_link();
    // The dead time and the voltage drop of the switches reduce every phase voltage equally, against its current.
    let drop = stage.delay_and_drop.map_or(0.0, |(_, drop)| drop);
    let lost = (376.0 / PERIOD as f64 * dc_link + drop) * 4.0 / 3.0;
    let volts = volts + lost.copysign(volts);
    let shift = (volts * f64::from(TOP) / dc_link).round() as i32;
    let around = |by: i32| (TOP / 2).saturating_add_signed(by);
    script.compare([around(shift), around(-shift / 2), around(-shift / 2)])?;
    script.outputs(true)?;
    script.wait(600 * PERIOD)?;
    Ok(script)
}

fn shunts(stage: &PowerStage) -> Shunts {
    stage.shunts.unwrap_or_else(|| panic!("{} has no shunts", stage.name))
}

/// Returns the voltage at a phase that causes a fraction of the shunts' range.
fn volts_for(stage: &PowerStage, share: f64) -> Result<f64> {
    let range = 1.5 / shunts(stage).volts_per_a.abs();
    Ok(share * range * stage.config()?.motor.r_s)
}

/// At half the duty all three shunts show the currents of the motor, with either ADC, and the third shunt in a later
/// rank as well.
#[test]
fn shunts_show_the_currents_while_the_low_sides_conduct() -> Result<()> {
    for stage in st_boards() {
        for share in [0.2, -0.2] {
            let shunts = shunts(stage);
            for channels in [[&[1, 7, 6][..], &[7, 6, 1]], [&[6, 1, 7], &[1, 7, 6]]] {
                let mut script = loaded(stage, volts_for(stage, share)?)?;
                script.converters(channels, 3)?;
                script.wait(3 * PERIOD)?;
                let currents = script.board.plant.phase_currents();
                for converter in [0, 1] {
                    let codes = script.results(converter, 3);
                    for (channel, code) in channels[converter as usize].iter().zip(codes) {
                        let leg = [1, 7, 6].iter().position(|known| known == channel).unwrap();
                        let (true_a, seen) = (currents[leg], amperes(&shunts, code));
                        // In the zero vector the motor's current changes a little until a later rank.
                        let error = (seen - true_a).abs();
                        assert!(
                            error < allowed(&shunts, true_a) + 0.01 * true_a.abs(),
                            "{} leg {leg}: {seen:.3} A of {true_a:.3} A",
                            stage.name
                        );
                    }
                }
                let expected = share * 1.5 / shunts.volts_per_a.abs();
                assert!((currents[0] / expected - 1.0).abs() < 0.3, "{currents:?}");
            }
        }
    }
    Ok(())
}

/// A low side that does not conduct at the sampling instant shows nothing: with too much duty, and in a rank so late
/// that the high side is on.
#[test]
fn outside_the_window_a_shunt_shows_garbage() -> Result<()> {
    for stage in st_boards() {
        let shunts = shunts(stage);
        // A current out of the motor takes the high diode while both switches are off, and the low sides go on a few
        // ticks before the top.
        let mut script = loaded(stage, -volts_for(stage, 0.3)?)?;
        script.converters([&[1], &[7]], 3)?;
        script.compare([TOP - 380; 3])?;
        script.wait(PERIOD)?;
        let current = script.board.plant.phase_currents()[0];
        let seen = amperes(&shunts, script.results(0, 1)[0]);
        assert!(current < -0.1 && seen.abs() < 0.1 * current.abs() + allowed(&shunts, 0.0));

        // Sampling of 640.5 clocks: a rank ends 15 us after the one before, the fourth 46 us after the top, when the
        // high side of a leg with half the duty is on.
        let mut script = loaded(stage, volts_for(stage, 0.2)?)?;
        script.write(TIM1 + 0x40, TOP - 2562)?;
        script.converters([&[6, 7, 6, 1], &[6, 7, 6, 7]], 7)?;
        script.wait(3 * PERIOD)?;
        let currents = script.board.plant.phase_currents();
        let codes = script.results(0, 4);
        let late = amperes(&shunts, codes[3]);
        assert!(late.abs() < allowed(&shunts, 0.0), "{}: {late:.3} A, late", stage.name);
        let early = amperes(&shunts, codes[1]);
        assert!(
            (early - currents[1]).abs() < allowed(&shunts, currents[1]) + 0.05 * currents[1].abs()
        );
    }
    Ok(())
}

/// Between a settled reading and none lies the time constant of the amplifier: the sampling instant moves towards the
/// beginning of the low side's pulse, and the reading follows 1 - exp(-t / tau).
#[test]
fn a_reading_settles_with_the_time_constant() -> Result<()> {
    for stage in st_boards() {
        let shunts = shunts(stage);
        let delay = stage.delay_and_drop.unwrap().0;
        for settled_us in [0.3, 0.6, 1.2, 4.0] {
            let mut script = loaded(stage, -volts_for(stage, 0.3)?)?;
            let currents = script.board.plant.phase_currents();
            // The low side of leg a goes on at top - compare_a before the top, delayed by the dead time and the driver.
            let compare = u32::from(script.applied().a);
            let on = f64::from(TOP - compare) - 376.0 - delay * 170e6;
            let before_top = on - settled_us * 170.0;
            script.write(TIM1 + 0x40, TOP - 98 - before_top as u32)?;
            script.converters([&[1], &[7]], 3)?;
            script.wait(3 * PERIOD)?;
            let seen = amperes(&shunts, script.results(0, 1)[0]);
            let expected = currents[0] * (1.0 - (-settled_us * 1e-6 / shunts.settling_s).exp());
            // A tick changes the reading by 1.5 %.
            let error = allowed(&shunts, expected) + 0.02 * currents[0].abs();
            assert!((seen - expected).abs() < error, "{}: {seen} A, {expected} A", stage.name);
        }
    }
    Ok(())
}
