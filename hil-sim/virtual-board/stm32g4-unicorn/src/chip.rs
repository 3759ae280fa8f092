//! The chip around the core: time, registers, events.
//!
//! Time is counted in ticks of 170 MHz, the highest clock of core and timers.

mod bus;
mod clocked;
pub mod debugger;
mod execution;
mod nets;
pub mod pins;
mod supply;

pub use bus::{Unknown, clock_of, kept_registers};
pub use execution::Watched;

use crate::circuit::{Circuit, SUPPLY_V};
use crate::cost::Block;
pub use crate::periph::rcc::TICKS_PER_S;
use crate::periph::tim1::{Event, Tim1};
use crate::periph::uart::{self, Uart};
use crate::periph::{NEVER, Reset, Store, plain};
use crate::periph::{
    adc::Adc, analog::Comparator, crc::CrcUnit, dac::Dac, encoder::EncoderTimer, flash::Flash,
    gpio::Gpio, iwdg::Iwdg, pwr::Pwr, rcc, rcc::Rcc, tim8::Tim8, time_base::TimeBase, wwdg::Wwdg,
};
use crate::rules::{Rule, Rules};
use crate::scs::{self, Scs};
use debugger::{Halt, IWDG_STOP, WWDG_STOP};
use nets::AnalogNet;
use pins::Pin;

/// Number of counts of an ADC.
pub const CODES: f64 = 4096.0;

/// Longest time for which the core runs without a check, ticks: a third of a millisecond.
const PATIENCE: u64 = TICKS_PER_S / 3000;

/// ADC counts of the chip's internal reference as measured in the factory, at 3.0 V: 1.212 V (datasheet, typical).
const OWN_REFERENCE_CODE: u16 = 1655;
/// Positions in the vector table, counted from the first peripheral.
const IRQ_ADC1_2: u16 = 18;
const IRQ_USART3: u16 = 39;
const IRQ_LPUART: u16 = 91;
/// Exception number of ADC1 and ADC2.
pub const ADC_INTERRUPT: u16 = 16 + IRQ_ADC1_2;

/// Damage inside the chip to a protection by DAC3, a comparator and its connection to the break of TIM1.
/// It persists over resets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// DAC3 outputs these counts regardless of its data.
    Level(u16),
    /// The comparator is not connected to its pin.
    Input,
    /// The output of the comparator stays low, regardless of its polarity.
    Comparator,
    /// The break is not connected to a comparator.
    Break,
}

defaults! {
    /// The chip without its core and memories; by default after power-up, with its flash erased.
    #[derive(Clone, Debug)]
    pub struct Chip<C: Circuit = ()> {
        /// Time, ticks.
        pub now: u64,
        /// Time up to which the core may run.
        pub deadline: u64,
        /// Whether the core has just been released.
        pub first: bool,
        /// Whether something has to be done before the core continues.
        pub attention: bool,
        /// The first access that the model does not know.
        pub unknown: Option<Unknown>,
        /// Time before which the core executes nothing.
        pub stalled_until: u64,
        /// A reset that is due.
        pub reset: Option<Reset>,
        /// Last known position of the core.
        pub at: u32,
        /// Number of accesses to registers since power-up.
        pub accesses: u64,
        /// Number of instructions from the flash since power-up.
        pub instructions: u64,
        /// Blocks executed in CCM since the last fetch, if requested.
        pub blocks: Vec<Block>,
        /// Whether blocks are stored.
        pub keep_blocks: bool,
        /// Number of blocks and accesses up to the last write of a leg's compare value.
        pub compared: (usize, u64),
        /// A function of the main loop whose calls are counted, if there is one.
        pub watched: Option<Watched>,
        /// Whether unknown registers read as 0.
        pub forgiving: bool,
        /// Rules of the chip that the program has broken.
        pub rules: Rules,
        /// Cycles of an instruction in the flash: 1 is the model for the tests of timing; a chip with 4 wait states,
        /// prefetch and caches is expected to take 2 to 3.
        pub flash_cycles: u64 = 1,
        /// Whether an interrupt runs whose cycles are counted; see [`Chip::begin_counted`].
        pub in_counted: bool,
        /// Whether the emulated core is running; and its access that the memory protection denied.
        pub(crate) core_runs: bool,
        pub(crate) guard_hit: Option<u32>,
        /// State of the halt, if a debugger has halted the core.
        pub(crate) halt: Option<Halt>,
        /// Damage to the protection by the comparator of the net.
        pub damage: Option<Damage>,
        /// Error of the core clock, as a share, and error of the reference of the ADCs.
        clock_error: f64,
        reference_error: f64,
        /// Time at which outputs that came back with the core are checked.
        pub(crate) back_on: Option<u64>,
        /// System and bus clock at the last check, and the time at which the system clock rose above 80 MHz.
        system_hz: u64 = 16_000_000,
        bus_hz: u64 = 16_000_000,
        system_rose: u64,
        /// ADC counts that the outside applies to PA0, PC1, PA1.
        analog: [u16; 3],
        /// A net at one of these pins with a circuit of its own.
        pub net: AnalogNet,
        /// The place of its pin among them.
        pub net_at: usize = 2,
        /// Counts by which an input must exceed the level of a comparator: offset of this part, and zero error of its DAC.
        pub comparator_offset: u16,
        /// The pin of the break input.
        pub break_pin: Pin = (0, 6),
        /// Resistor from the break input to the supply, ohm.
        pub break_pull_ohm: f64 = f64::INFINITY,
        /// Whether the outside pulls the break input low.
        break_low: bool,
        /// The pin that enables the RS-485 driver of USART3, if there is one.
        pub bus_driver: Option<Pin>,
        last_block: Option<(u32, u32)>,
        /// Core-private registers.
        pub scs: Scs,
        /// Clocks.
        pub rcc: Rcc,
        /// Supply.
        pub pwr: Pwr,
        /// Flash.
        pub flash: Flash,
        /// CRC unit.
        pub crc: CrcUnit,
        /// Backup registers.
        pub tamp: Store = Store::of("TAMP"),
        /// Ports A to G.
        pub gpio: [Gpio; 7] = std::array::from_fn(Gpio::new),
        /// System configuration.
        pub syscfg: Store = Store::of("SYSCFG"),
        /// Interrupts of pins and comparators.
        pub exti: Store = Store::of("EXTI"),
        /// Timer of a power stage.
        pub tim1: Tim1,
        /// Timer with a single output.
        pub tim8: Tim8 = Tim8(Store::of("TIM8")),
        /// Timer of an encoder.
        pub tim2: EncoderTimer,
        /// Time base.
        pub tim5: TimeBase,
        /// Timer that captures MCO.
        pub tim16: TimeBase = TimeBase::tim16(),
        /// ADC1 and ADC2.
        pub adc: Adc,
        /// ADC3 and ADC4.
        pub slow_adc: Adc = Adc::from(2),
        /// Pins of each port that are connected to ground.
        pub grounded: [u32; 7],
        /// Pins of each port that are connected to the supply.
        pub lifted: [u32; 7],
        /// Comparators.
        pub comp: [Comparator; 7],
        /// Reference voltages of the comparators.
        pub dac: [Dac; 2] = [1, 3].map(Dac::new),
        /// Low-power serial port.
        pub lpuart: Uart,
        /// Serial port with an RS-485 driver.
        pub usart3: Uart = Uart::new(&uart::USART3),
        /// Watchdog.
        pub iwdg: Iwdg,
        /// Window watchdog.
        pub wwdg: Wwdg,
        /// Debug support.
        pub debug: Store = Store::of("DBGMCU"),
        /// The circuit at the pins.
        pub circuit: C,
    }
}

/// Takes over fields that a reset does not change.
macro_rules! keep {
    ($new:ident, $old:ident: $($field:ident $(. $part:ident)?)*) => {
        $($new.$field $(.$part)? = $old.$field $(.$part)?;)*
    };
}

impl<C: Circuit> Chip<C> {
    /// Resets the chip: registers get their reset values; flash contents and the outside world are unchanged.
    pub fn reset(&mut self, cause: Reset) {
        let mut old = std::mem::take(self);
        // Only power-up clears the flags of resets and resets the debug support.
        if cause == Reset::Power {
            old.rcc.flags = 0;
        } else {
            keep! { self, old: debug halt tamp }
        }
        old.rcc.flags |= rcc::flags_of(cause);
        keep! { self, old:
            now accesses instructions keep_blocks watched forgiving rules flash_cycles
            analog net net_at comparator_offset break_pin break_pull_ohm break_low bus_driver damage clock_error reference_error
            pwr.supply_v iwdg.clock adc.own_reference adc.inputs adc.lose_triggers slow_adc.inputs grounded lifted tim1.drop_update tim2.position
            rcc.flags rcc.crystal_hz rcc.crystal_lives rcc.pll_locks lpuart.line usart3.line circuit tim5.captures tim16.captures
            flash.bytes flash.torn flash.torn_code flash.operations flash.options
        }
        self.follow_break_pin();
        self.follow_pins();
    }

    /// Sets the error of the core clock, as a share, and the frequency of the LSI oscillator, Hz; 0 stops it.
    pub fn set_clocks(&mut self, error: f64, lsi_hz: f64) {
        self.clock_error = error;
        let ticks = self.ticks_per_s() / lsi_hz;
        self.tim5.set_oscillator(ticks, self.now);
        self.follow_hsi();
        self.iwdg.clock = (ticks as u64).min(NEVER >> 32);
    }

    /// Sets the edges of MCO, which is HSI divided by 16: it is exact beside a wrong crystal, and runs with a core that it drives.
    pub(crate) fn follow_hsi(&mut self) {
        let ticks = if self.rcc.on_crystal() { self.ticks_per_s() } else { TICKS_PER_S as f64 };
        self.tim16.set_oscillator(16.0 * ticks / f64::from(rcc::HSI_HZ), self.now);
    }

    /// Number of ticks per second outside the chip.
    pub fn ticks_per_s(&self) -> f64 {
        TICKS_PER_S as f64 * (1.0 + self.clock_error)
    }

    /// Sets the error of the ADCs' reference, as a share: all voltages then have other counts.
    pub fn set_reference(&mut self, error: f64) {
        self.reference_error = error;
        let code = f64::from(OWN_REFERENCE_CODE) * 3.0 / (SUPPLY_V * (1.0 + error));
        self.adc.own_reference = code.round() as u16;
    }

    /// Returns the error of the ADCs' reference, as a share.
    pub fn reference_error(&self) -> f64 {
        self.reference_error
    }

    /// Locks the core up, which acts on the break of TIM1 if the program has enabled that.
    pub fn lock_up(&mut self) {
        if self.syscfg.get(plain::CFGR2) & plain::CLL != 0 {
            self.system_break();
        }
    }

    /// Pulls the breaks because of a fault inside the chip.
    fn system_break(&mut self) {
        self.tim1.system_break();
        self.tim8.system_break();
    }

    /// Checks that ADC3 and ADC4 convert nothing while ADC1 or ADC2 samples a current.
    pub(crate) fn check_beside(&mut self, at: u64) {
        self.slow_adc.happen(at);
        let free = !(self.adc.samples_current(at) && self.slow_adc.converts(at));
        self.rules.require(free, Rule::AdcBeside, || {
            "ADC3 or ADC4 converts while a current is sampled".into()
        });
    }

    /// Updates level-sensitive interrupt requests.
    pub fn update_lines(&mut self) {
        self.scs.set_line(IRQ_ADC1_2, self.adc.requests());
        self.scs.set_line(IRQ_LPUART, self.lpuart.requests());
        self.scs.set_line(IRQ_USART3, self.usart3.requests());
    }

    /// Returns the time of the next event.
    pub fn next_event(&self) -> u64 {
        [
            self.tim1.next_event(),
            self.adc.next_event(),
            self.slow_adc.next_event(),
            self.lpuart.next_event(),
            self.usart3.next_event(),
            if self.stops(IWDG_STOP) { NEVER } else { self.iwdg.next_event() },
            if self.stops(WWDG_STOP) { NEVER } else { self.wwdg.next_event() },
            self.scs.systick.next_event(),
            self.rcc.next_event(),
            self.comp.iter().map(Comparator::next_event).fold(NEVER, u64::min),
            self.dac[0].next_event(self.now),
            self.dac[1].next_event(self.now),
            self.net.next_event(),
            self.back_on.unwrap_or(NEVER),
            self.now.saturating_add(PATIENCE),
        ]
        .into_iter()
        .fold(NEVER, u64::min)
    }

    /// Lets the circuit follow the pins and the outputs of TIM1, which may have changed.
    pub fn follow_pins(&mut self) {
        self.circuit.follow(&self.gpio, &self.tim1, self.at, self.now);
    }

    /// Processes events that are due, up to the top of the PWM counter, or also to its 0 if the ADCs sample there. If
    /// it was reached, returns the time, and whether it is the top, at which the outside world advances before anything
    /// later happens.
    pub fn catch_up(&mut self) -> Option<(u64, bool)> {
        let now = self.now;
        self.attention = false;
        while self.tim1.next_event() <= now {
            match self.tim1.happen() {
                Event::Trigger(at, output) => {
                    let free = !self.adc.disturbs(at, output);
                    self.rules.require(free, Rule::AdcDisturbed, || "a trigger of TIM1".into());
                    self.adc.trigger(at, output);
                    self.slow_adc.trigger(at, output);
                    self.check_beside(at);
                }
                Event::Crest(at) => {
                    self.follow_pins();
                    return Some((at, true));
                }
                Event::Valley(at) if self.adc.samples_twice() => return Some((at, false)),
                Event::Valley(_) => {}
            }
        }
        if self.rcc.happen(now) {
            self.system_break();
            self.scs.pend(scs::NMI);
        }
        self.compare_now();
        self.adc.happen(now);
        self.slow_adc.happen(now);
        (self.rules.now, self.rules.at) = (now, self.at);
        self.check_analog_pins();
        self.check_outputs_back();
        self.lpuart.happen(now, None);
        let driver = self.drives_bus();
        let lost = self.usart3.happen(now, Some(driver));
        self.rules.require(!lost, Rule::BusDriver, || {
            "a byte ended with the driver's pin not high".to_owned()
        });
        if !self.stops(IWDG_STOP) && self.iwdg.next_event() <= now {
            self.reset = Some(Reset::Watchdog);
        }
        if !self.stops(WWDG_STOP) && self.wwdg.next_event() <= now {
            self.reset = Some(Reset::Window);
        }
        if self.scs.systick.happen(now) {
            self.scs.pend(scs::SYSTICK);
        }
        self.update_lines();
        None
    }
}
