//! The history against a flash that loses power.

use std::ops::Range;

use super::{FAULTS, History, LONG_S, ON_S, SAME_FAULT_S};
use crate::store::tests::fake::Fake;

fn load(fake: &mut Fake) -> History {
    History::load(&mut &mut *fake)
}

/// Powered and running time, s, starts, and the numbers of the faults, the latest first.
fn seen(history: &History) -> (u32, u32, u32, Vec<u8>) {
    let faults = history.faults().map(|fault| fault.code).collect();
    (history.powered_s, history.running_s, history.starts, faults)
}

/// A drive that runs and stops for some seconds each, with a fault now and then.
struct Life {
    history: History,
    random: u64,
}

impl Life {
    /// A cycle: start, run, stop or fault, rest. Writes when that is due, as the main loop does. Stops if the power fails.
    fn cycle(&mut self, fake: &mut Fake) -> bool {
        let draw = |random: &mut u64, n: u64| {
            *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (*random >> 33) % n
        };
        self.history.started();
        let seconds = draw(&mut self.random, 1500) as u32;
        for _ in 0..seconds {
            self.history.pass(1000, true);
            if self.history.is_due(false) && self.history.write(&mut &mut *fake).is_err() {
                return false;
            }
        }
        if draw(&mut self.random, 3) == 0 {
            let code = 1 + draw(&mut self.random, 40) as u8;
            if self.history.fault(&mut &mut *fake, code).is_err() {
                return false;
            }
        }
        for _ in 0..draw(&mut self.random, 600) {
            self.history.pass(1000, false);
            if self.history.is_due(true) && self.history.write(&mut &mut *fake).is_err() {
                return false;
            }
        }
        true
    }
}

#[test]
fn an_erased_flash_is_a_new_drive() {
    assert_eq!(seen(&load(&mut Fake::new())), (0, 0, 0, vec![]));
}

/// Over many pages: after each reset, times and starts lack at most the time between two writes, they never decrease, and the last faults
/// are there in their order.
#[test]
fn what_was_counted_is_there_after_a_reset() {
    let mut fake = Fake::new();
    let mut life = Life { history: load(&mut fake), random: 7 };
    let mut before = (0, 0);
    for n in 0..2000 {
        assert!(life.cycle(&mut fake));
        if n % 7 != 0 {
            continue;
        }
        let (powered, running, starts, faults) = seen(&life.history);
        life.history = load(&mut fake);
        let after = seen(&life.history);
        // The time powered is rounded to a minute.
        assert!(
            after.0 <= powered && powered - after.0 < LONG_S + 60,
            "{n}: {powered} {}",
            after.0
        );
        assert!(after.1 <= running && running - after.1 <= LONG_S, "{n}: {running} {}", after.1);
        assert!(after.2 <= starts && after.2 >= before.1, "{n}: {starts} {}", after.2);
        assert!(after.1 >= before.0);
        assert_eq!(after.3, faults, "{n}");
        before = (after.1, after.2);
    }
    assert!(before.1 > 1900, "{before:?}");
    assert_eq!(life.history.faults().count(), FAULTS);
}

/// The power fails in every operation of several pages, with random contents of the torn word: all earlier entries are there, and the log
/// goes on.
fn whenever_the_power_fails(seeds: Range<u64>) {
    for seed in seeds {
        for operation in (0..700).step_by(1 + seed as usize % 3) {
            let mut fake = Fake::new();
            fake.random = seed * 1000 + operation as u64;
            fake.left = Some(operation);
            let mut life = Life { history: load(&mut fake), random: seed };
            let mut before = seen(&life.history);
            loop {
                let whole = life.cycle(&mut fake);
                if !whole {
                    break;
                }
                // History that a reset would find here.
                before = seen(&load(&mut fake));
            }
            fake.left = None;
            life.history = load(&mut fake);
            let after = seen(&life.history);
            assert!(after.0 >= before.0 && after.1 >= before.1 && after.2 >= before.2);
            // At most one fault of a cycle is new.
            let older = after.3.get(1..).unwrap_or_default();
            let same = after.3 == before.3 || before.3.starts_with(older);
            assert!(same, "{operation}: {:?}, then {:?}", before.3, after.3);
            for _ in 0..3 {
                assert!(life.cycle(&mut fake), "{operation}");
            }
            let (_, running, ..) = seen(&life.history);
            assert!(running - load(&mut fake).running_s <= LONG_S);
        }
    }
}

#[test]
fn whenever_the_power_fails_what_was_written_is_there() {
    whenever_the_power_fails(0..3);
}

#[test]
#[ignore = "cargo xtask prove long-tests"]
fn whenever_the_power_fails_what_was_written_is_there_with_more_seeds() {
    whenever_the_power_fails(3..8);
}

/// Number of erasures, as the head of the module states: continuous starts and stops.
#[test]
fn the_flash_lasts() {
    let mut fake = Fake::new();
    let mut history = load(&mut fake);
    let (mut erased, mut seconds) = (0_u32, 0_u32);
    while erased < 10 {
        history.started();
        history.pass(500, true);
        history.pass(500, false);
        seconds += 1;
        if history.is_due(true) {
            erased += u32::from(history.is_full());
            history.write(&mut &mut fake).unwrap();
        }
    }
    let hours = f64::from(seconds) / 3600.0 / f64::from(erased);
    assert!((hours - 9.8).abs() < 0.5, "{hours} h a page");

    // The same fault every second is written once a minute.
    let mut history = load(&mut Fake::new());
    let mut fake = Fake::new();
    for _ in 0..10 * SAME_FAULT_S {
        history.pass(1000, false);
        history.fault(&mut &mut fake, 5).unwrap();
    }
    assert!((10..=11).contains(&load(&mut fake).faults().count()));
}

/// A drive that never stops writes for 20 days, at most four hours apart, and does not erase.
#[test]
fn a_drive_that_never_stops_is_counted() {
    let mut fake = Fake::new();
    let mut history = load(&mut fake);
    history.write(&mut &mut fake).unwrap();
    let erased = fake.words;
    for minute in 0..20 * 24 * 60 {
        history.pass(60_000, true);
        if history.is_due(false) {
            assert!(!history.is_full());
            history.write(&mut &mut fake).unwrap();
        }
        let kept = load(&mut fake).running_s;
        let most = if minute < 28 * 60 { ON_S } else { LONG_S };
        assert!(history.running_s - kept <= most, "{minute}: {kept}");
    }
    assert_eq!(fake.words[0], erased[0], "the settings");
}
