//! The clocks of the peripherals, and the rules between clock tree, supply and flash.

use super::{Chip, Circuit, bus::clock_of};
use crate::rules::Rule;

/// Number of cycles from the store that switches a clock on to the first store that takes effect: two whole cycles lie between.
const ENABLE_CYCLES: u64 = 3;
/// Number of cycles that an access to a register takes in excess of one.
const BUS_CYCLES: u64 = 2;
/// Frequency, Hz; a step to a higher one needs half the bus clock for a while.
const STEP_HZ: u64 = 80_000_000;
/// Duration of that while, ticks: a microsecond.
const STEP_TICKS: u64 = 170;

impl<C: Circuit> Chip<C> {
    /// Whether an access reaches its peripheral.
    pub(super) fn is_clocked(&mut self, address: u32) -> bool {
        let Some((name, register, bit)) = clock_of(address) else { return true };
        let Some(on) = self.rcc.clock(register, bit) else {
            self.rules
                .note(Rule::ClockGate, format!("{name} at {address:#010x} without its clock"));
            return false;
        };
        let Some(on) = on.filter(|_| !self.rules.coarse) else { return true };
        let cycles = (self.now - on.at) / self.rcc.ticks_per_cycle;
        // This access itself is counted as well.
        let accesses = self.accesses.saturating_sub(on.accesses + 1);
        self.rules.require(
            cycles + BUS_CYCLES * accesses >= ENABLE_CYCLES,
            Rule::EnableDelay,
            || format!("{name} at {address:#010x} {cycles} cycles after its clock was switched on"),
        )
    }

    /// Checks clock tree, voltage range and wait states against each other, after one of them was written.
    pub(super) fn check_clocks(&mut self) {
        let (system, bus) = (self.rcc.system_hz(), self.rcc.bus_hz());
        let range = self.pwr.range();
        let limit = range.clocks_hz().0;
        self.rules.require(system <= limit, Rule::VoltageRange, || {
            format!("a system clock of {system} Hz in {range:?}, at most {limit}")
        });
        let (have, need) = (self.flash.wait_states(), range.wait_states(bus));
        self.rules.require(have >= need, Rule::Latency, || {
            format!("{have} wait states at {bus} Hz in {range:?}, at least {need}")
        });
        let (old_system, old_bus) = (self.system_hz, std::mem::replace(&mut self.bus_hz, bus));
        if system > STEP_HZ && old_system <= STEP_HZ {
            self.system_rose = self.now;
        }
        let whole = bus == system && bus > STEP_HZ && bus > old_bus;
        let halved_long = old_system > STEP_HZ && self.system_rose + STEP_TICKS <= self.now;
        self.rules.require(!whole || halved_long, Rule::ClockStep, || {
            format!("the bus clock from {old_bus} to {bus} Hz, at half of it for less than 1 us")
        });
        self.system_hz = system;
    }
}
