//! Faults that several classes share.

use hil_sim::plant::EncoderFault;
use induction_drive::board as firmware_board;
use induction_drive::monitor::register_check::{COUNT, Register, control};
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::scene::Target;
use drive_core::{Line, Sample};
use drive_settings::CurrentSensors;
use stm32g4_unicorn::memory::{FLASH, Region, STORED};
use virtual_board::board::Board;

/// Selects the ADC counts of a quantity in a sample.
type Code = fn(&mut Sample) -> &mut u16;

/// Returns the ADC counts of the current sensor of phase 0, 1 or 2.
pub fn current(which: usize, sample: &mut Sample) -> &mut u16 {
    match which {
        0 => &mut sample.current_a,
        1 => &mut sample.current_b,
        _ => &mut sample.current_c,
    }
}

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

/// Bits that affect the gates at once, before any software. TIM1: clock of the dead time (CR1), polarity (CCER). Ports:
/// the functions of PA7 to PA10, PB0 and PB1; the levels of other functions are not modelled.
const AT_THE_GATES: [(u32, u32); 5] = [
    (0x4001_2c00, 3 << 8),
    (0x4001_2c20, 0xaaa),
    (0x4800_0020, 0xf << 28),
    (0x4800_0024, 0xfff),
    (0x4800_0420, 0xff),
];

/// Flips a writable bit of a register that the firmware checks.
pub fn flip_register(board: &mut Board, rng: &mut dyn Rng) -> String {
    loop {
        let Register { address, mask } = control().nth(rng.random_range(0..COUNT)).unwrap();
        let bit = rng.random_range(0..32);
        if mask >> bit & 1 == 0
            || AT_THE_GATES.iter().any(|g| g.0 == address && g.1 >> bit & 1 == 1)
        {
            continue;
        }
        let chip = board.chip();
        let before = chip.read(address, 4);
        chip.write(address, 4, before ^ 1 << bit);
        // The bit is neither reserved nor locked.
        if (chip.read(address, 4) ^ before) & mask != 0 {
            return format!("bit {bit} of {address:#010x}");
        }
    }
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

/// Flips a bit of a region.
pub fn flip(board: &mut Board, rng: &mut dyn Rng, region: Region) -> String {
    let offset = rng.random_range(0..region.size);
    let address = region.address + offset;
    let bit = rng.random_range(0..8);
    let byte = board.cpu.byte(address).unwrap_or(0) ^ 1 << bit;
    board.cpu.write(address, &[byte]);
    format!("bit {bit} of {address:#010x}, {offset:#x} from the beginning")
}
