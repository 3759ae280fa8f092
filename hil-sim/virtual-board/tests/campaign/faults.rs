//! Faults that several classes share.

use hil_sim::plant::EncoderFault;
use induction_drive::board as firmware_board;
use induction_drive::monitor::register_check::control;
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::scene::Target;
use drive_core::{Line, Sample};
use drive_settings::CurrentSensors;
use stm32g4_unicorn::memory::{FLASH, Region, STORED};
use virtual_board::board::Board;
use virtual_board::faults::{Places, flip_one};

/// Selects the ADC counts of a quantity in a sample.
type Code = fn(&mut Sample) -> &mut u16;

/// Returns the name of a current sensor.
pub fn name(which: usize) -> &'static str {
    ["sensor a", "sensor b", "sensor c"][which]
}

impl Target {
    /// Returns one of the current sensors at random.
    pub fn any_current(&self, rng: &mut dyn Rng) -> usize {
        match self.settings.scales.sensors {
            CurrentSensors::InLine => usize::from(!rng.random::<bool>()),
            CurrentSensors::LowSide => rng.random_range(0..3),
        }
    }

    /// Returns what described faults act on.
    pub fn places(&self) -> Places {
        let addresses = self.addresses;
        let word = |address| Region { address, size: 4 };
        let mailbox = Region { address: addresses.orders, size: addresses.order_waits + 4 };
        Places {
            lines: [0, 1, 2].map(|which| self.line(which)),
            sensors: if self.settings.scales.sensors == CurrentSensors::InLine { 2 } else { 3 },
            relative_voltage: self.relative_voltage,
            areas: vec![addresses.state, self.data, word(addresses.phase), mailbox],
        }
    }

    /// Returns the scale of a current sensor.
    pub fn line(&self, which: usize) -> Line {
        let scales = &self.settings.scales;
        [scales.current_a, scales.current_b, scales.current_c][which]
    }
}

/// Makes the encoder lose a share of its counts.
pub fn losing(board: &mut Board, share: f64) -> String {
    board.plant.set_encoder_fault(EncoderFault::Losing(share));
    format!("{:.1} %", 100.0 * share)
}

/// Sets the error of the core clock, as a share, and the frequency of the LSI oscillator, Hz.
pub fn set_clocks(board: &mut Board, error: f64, lsi_hz: f64) -> String {
    board.chip().set_clocks(error, lsi_hz);
    format!("core clock {:.1} %, {lsi_hz:.0} Hz", 100.0 * error)
}

/// Returns Gaussian noise with an rms value in ADC counts, which is added to counts.
pub fn noise(rng: &mut dyn Rng, rms: f64) -> impl FnMut(&mut u16) + use<> {
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(rng.random());
    move |code| {
        let draw: f64 = StandardNormal.sample(&mut generator);
        let full_scale = f64::from(firmware_board::ADC_FULL_SCALE);
        *code = (f64::from(*code) + rms * draw).clamp(0.0, full_scale) as u16;
    }
}

/// Makes the sensor of the dc link or of the heat sink stick, open, saturate or noisy.
pub fn slow_sensor(board: &mut Board, rng: &mut dyn Rng, of: Code) -> String {
    let held = *of(&mut board.sample());
    let rms = 2_f64.powf(rng.random_range(0.0..10.0));
    let mut noise = noise(rng, rms);
    let kind = rng.random_range(0..4_usize);
    board.disturb = Some(Box::new(move |s| {
        let code = of(s);
        match kind {
            0 => *code = held,
            1 => *code = 0,
            2 => *code = firmware_board::ADC_FULL_SCALE,
            _ => noise(code),
        }
    }));
    let noisy = format!("{rms:.0} counts of noise");
    [format!("stuck at {held}"), "open".into(), "saturated".into(), noisy][kind].clone()
}

/// Flips a writable bit of a register that the firmware checks.
pub fn flip_register(board: &mut Board, rng: &mut dyn Rng) -> String {
    let registers: Vec<_> = control().map(|register| (register.address, register.mask)).collect();
    flip_one(board, rng, &registers)
}

/// Makes the check code wrong of the next instructions of the main loop in the flash, or of some instructions after them.
pub fn bad_code(board: &mut Board, rng: &mut dyn Rng) -> String {
    let (mut left, mut steps) = (rng.random_range(1..300), 0..100_000);
    while left > 0 && steps.next().is_some() && board.run_ticks(1).is_ok() {
        left -= u32::from((FLASH..STORED).contains(&board.chip().at));
    }
    let address = board.chip().at & !7;
    board.chip().flash.bad_code = Some(address);
    format!("{address:#010x}")
}
