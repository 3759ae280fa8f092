//! Currents sampled in both zero vectors: less noise, the same bits as on the host, and protections that check both conversions.

use crate::common;
use std::cell::Cell;
use std::rc::Rc;

use crate::common::pair::Pair;
use anyhow::Result;
use drive_core::{Fault, State};
use hil_sim::Config;
use virtual_board::{Image, Options};

const YES: &str = "set scales.both_zero_vectors yes";

/// Cycles of a control interrupt.
#[derive(Debug, Default)]
struct Cycles {
    /// Largest number up to the last compare value.
    to_compares: u32,
    /// Mean of the whole interrupt; the longest one depends on the sample in which a report or a command comes.
    whole: f64,
}

/// A start without a sensor, torque in both directions, and a stop: the true torque is the commanded one, within 5 %.
fn torque(pair: &mut Pair) -> Result<Cycles> {
    pair.start_torque()?;
    let settings = pair.shadow.settings();
    let per_ampere = f64::from(settings.motor.torque_per_ampere(settings.i_d()));
    let mut most = Cycles::default();
    for i_q in [1.5, -1.0] {
        pair.order(&format!("torque {i_q}"))?;
        pair.run(3000, |_, _| {})?;
        let mut sum = 0.0;
        pair.run(3000, |pair, period| {
            sum += pair.board.plant.torque();
            most.to_compares = most.to_compares.max(period.to_compares);
            most.whole += f64::from(period.cycles) / 6000.0;
        })?;
        let (torque, wanted) = (sum / 3000.0, per_ampere * i_q);
        assert!((torque / wanted - 1.0).abs() < 0.05, "{torque} of {wanted}");
    }
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    Ok(most)
}

/// Mean and deviation of the reading of current a with the outputs off, A.
fn reading(pair: &mut Pair) -> Result<[f64; 2]> {
    let scales = pair.shadow.settings().scales;
    let line = scales.of_code(scales.current_a);
    let mut readings = Vec::new();
    // The current of the run has decayed by then.
    pair.run(10, |_, _| {})?;
    pair.run(12_000, |_, period| readings.push(f64::from(line.at(period.sample.current_a))))?;
    let mean = |of: &dyn Fn(f64) -> f64| {
        readings.iter().map(|r| of(*r)).sum::<f64>() / readings.len() as f64
    };
    let middle = mean(&|r| r);
    Ok([middle, mean(&|r| (r - middle).powi(2)).sqrt()])
}

/// Switched on and off again at the console, with a run in each state: every compare value is that of the host's drive
/// (see `Shadow::follow`), and two conversions have the noise of one divided by the root of 2. (One has 5 mA and the
/// steps of its counts; the deviation of 12 000 readings is accurate to 0.6 %.)
#[test]
fn both_zero_vectors_halve_the_variance_and_the_host_computes_the_same() -> Result<()> {
    let mut pair = common::pair(&Config::default(), 41)?;
    let one = reading(&mut pair)?;
    let cycles = [torque(&mut pair)?, {
        pair.order(YES)?;
        pair.order("apply")?;
        torque(&mut pair)?
    }];
    let two = reading(&mut pair)?;
    assert!((two[0] - one[0]).abs() < 2e-4, "{one:?} {two:?}");
    assert!((two[1] / one[1] / 0.5_f64.sqrt() - 1.0).abs() < 0.03, "{one:?} {two:?}");
    // Two more readings and additions.
    assert!(cycles[1].to_compares <= cycles[0].to_compares + 15, "{cycles:#?}");
    assert!(cycles[1].whole <= cycles[0].whole + 15.0, "{cycles:#?}");
    pair.order("set scales.both_zero_vectors no")?;
    pair.order("apply")?;
    torque(&mut pair)?;
    let again = reading(&mut pair)?;
    assert!((again[1] / one[1] - 1.0).abs() < 0.03, "{one:?} {again:?}");
    Ok(())
}

/// Returns a board that was saved with the setting on, and regulates torque.
fn regulating(seed: u64) -> Result<Pair> {
    let mut config = Config::default();
    config.measurement.both_zero_vectors = true;
    config.calibrate();
    let options = Options::new(&config, seed).set_up(&config)?;
    let mut pair = Pair::new(Image::built()?, options)?;
    assert!(pair.shadow.settings().scales.both_zero_vectors);
    pair.start_torque()?;
    Ok(pair)
}

/// Whether the counter is on its way to the top.
fn goes_up(pair: &mut Pair) -> bool {
    let chip = pair.board.chip();
    chip.tim1.read(0, chip.now).is_some_and(|cr1| cr1 & 1 << 4 == 0)
}

/// An over-current that only the conversion in the upper zero vector sees trips there: the outputs are off before the next top.
#[test]
fn the_analog_watchdogs_see_the_upper_zero_vector() -> Result<()> {
    let mut pair = regulating(42)?;
    let (upper, asked) = (Rc::new(Cell::new(false)), Rc::new(Cell::new(0_u32)));
    let (seen, count) = (upper.clone(), asked.clone());
    pair.board.disturb = Some(Box::new(move |sample| {
        count.set(count.get() + 1);
        if seen.replace(false) {
            sample.current_a = 4000;
        }
    }));
    // After the sample at a top, the next sample is that of the upper zero vector.
    let at = asked.get();
    while asked.get() == at || goes_up(&mut pair) {
        pair.board.run_ticks(100)?;
    }
    let began = pair.board.chip().now;
    upper.set(true);
    while pair.board.chip().tim1.outputs_on() {
        pair.board.run_ticks(100)?;
        assert!(pair.board.chip().now < began + 14_167 + 1700, "no trip");
    }
    pair.board.run_periods(3000)?;
    let log = pair.board.take_log()?;
    let fault = format!("fault {}: {}", Fault::AnalogWatchdog.code(), Fault::AnalogWatchdog);
    assert!(log.iter().any(|line| line.contains(&fault)), "{log:#?}");
    Ok(())
}

/// A trigger that one ADC loses in the upper zero vector is detected at the next top: its old counts are not used again.
#[test]
fn a_conversion_that_is_missing_in_the_upper_zero_vector_is_noticed() -> Result<()> {
    for lost in [[1, 0], [0, 1]] {
        let mut pair = regulating(43)?;
        // Right behind the top, wherever in the period the run has ended.
        for up in [false, true] {
            while goes_up(&mut pair) == up {
                pair.board.run_ticks(100)?;
            }
        }
        pair.board.chip().adc.lose_triggers = lost;
        pair.run(3, |_, _| {})?;
        assert_eq!(pair.shadow.drive.state().fault(), Some(Fault::ConverterOverrun), "{lost:?}");
        assert!(!pair.board.chip().tim1.outputs_on());
    }
    Ok(())
}
