//! Register scripts: the core of the board stands still after reset, and the script writes to its registers.

use anyhow::Result;
use drive_core::Compare;
use virtual_board::power_stage::bridge::BadGates;
use virtual_board::{Board, Image, Options, PowerStage};

const RCC_AHB2ENR: u32 = 0x4002_104c;
const RCC_APB2ENR: u32 = 0x4002_1060;
pub const GPIOA: u32 = 0x4800_0000;
const GPIOC: u32 = 0x4800_0800;
pub const TIM1: u32 = 0x4001_2c00;
const ADC1: u32 = 0x5000_0000;
const ADC_CCR: u32 = 0x5000_0308;
/// Registers of a port.
pub const MODER: u32 = 0x00;
pub const PUPDR: u32 = 0x0c;
pub const ODR: u32 = 0x14;
/// Registers of TIM1.
pub const CCER: u32 = 0x20;
pub const CR2: u32 = 0x04;
pub const BDTR: u32 = 0x44;
const MOE: u32 = 1 << 15;
/// Top of the counter, as in the firmware.
pub const TOP: u32 = 14_167;
/// Ticks of a period.
pub const PERIOD: u64 = 2 * TOP as u64;
/// Ticks of a microsecond.
pub const US: u64 = 170;

/// The set-up of the timer by a script.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// CCER: enables and polarities of channels 1 to 3.
    pub ccer: u32,
    /// The idle levels of CR2.
    pub idle: u32,
    /// BDTR without MOE.
    pub bdtr: u32,
}

impl Setup {
    /// Both outputs of the legs for inputs that are active high; off means driven low. Dead time of 2.2 us at two clocks a tick.
    pub const ACTIVE_HIGH: Self = Self { ccer: 0x555, idle: 0, bdtr: 0xc9e };
    /// The low sides are active low: CCxNP and OISxN are set.
    pub const LOW_SIDES_LOW: Self = Self { ccer: 0xddd, idle: 0x2a00, bdtr: 0xc9e };

    /// Returns the set-up that suits a board.
    pub fn of(stage: &PowerStage) -> Self {
        if stage.driver.low.on_at_high { Self::ACTIVE_HIGH } else { Self::LOW_SIDES_LOW }
    }
}

/// A board that executes the script.
pub struct Script {
    pub board: Board,
    /// Whether it continues in spite of violations.
    pub regardless: bool,
}

impl Script {
    /// Makes a board after power-up, with its core at rest, and with its motor.
    pub fn new(stage: &'static PowerStage) -> Result<Self> {
        let config = stage.config()?;
        let mut board = Board::new(Image::built()?, Options::on(stage, &config, 1))?;
        board.hang();
        let mut script = Self { board, regardless: false };
        script.clocks()?;
        Ok(script)
    }

    /// Switches the clocks of the ports, of TIM1, the system configuration and the ADCs on.
    pub fn clocks(&mut self) -> Result<()> {
        self.write(RCC_AHB2ENR, 0x2007)?;
        self.write(RCC_APB2ENR, 0x801)
    }

    /// Writes a register, and waits for the effect.
    pub fn write(&mut self, address: u32, value: u32) -> Result<()> {
        self.board.chip().write(address, 4, value);
        self.wait(16)
    }

    pub fn read(&mut self, address: u32) -> u32 {
        self.board.chip().read(address, 4)
    }

    /// Changes the bits of a mask.
    pub fn modify(&mut self, address: u32, mask: u32, value: u32) -> Result<()> {
        let old = self.read(address);
        self.write(address, old & !mask | value & mask)
    }

    /// Lets time pass.
    pub fn wait(&mut self, ticks: u64) -> Result<()> {
        let end = self.board.chip().now + ticks;
        loop {
            let rest = end - self.board.chip().now;
            match self.board.run_ticks(rest) {
                Err(_) if self.regardless => {}
                result => return result,
            }
        }
    }

    /// Sets the timer up with its outputs off, not counting yet.
    pub fn timer(&mut self, setup: Setup) -> Result<()> {
        for (register, value) in [
            (0x2c, TOP),
            (0x18, 0x6868),
            (0x1c, 0x7868),
            (0x34, 0),
            (0x38, 0),
            (0x3c, 0),
            // The first conversion's sampling of 24.5 clocks ends at the top.
            (0x40, TOP - 98),
            (CR2, 7 << 4 | setup.idle),
            (CCER, setup.ccer),
            (BDTR, setup.bdtr),
            // Dead time of two clocks a tick, centre-aligned, preloaded.
            (0x00, 1 << 8 | 1 << 7 | 1 << 5),
            (0x30, 0),
            (0x14, 1),
            (0x30, 1),
        ] {
            self.write(TIM1 + register, value)?;
        }
        Ok(())
    }

    /// Connects the pins of the gates and the fault input to the timer.
    pub fn pins(&mut self) -> Result<()> {
        let wiring = self.board.chip().circuit.stage.wiring;
        let pins = wiring.gates.as_flattened().iter().chain([&wiring.fault]);
        pins.into_iter().try_for_each(|((port, pin), function)| {
            let (port, half) = (GPIOA + 0x400 * *port as u32, 4 * (pin / 8));
            let shift = 4 * (pin % 8);
            self.modify(port + 0x20 + half, 0xf << shift, function << shift)?;
            self.modify(port + MODER, 3 << (2 * pin), 2 << (2 * pin))
        })
    }

    /// Sets timer and pins up: counting, with the outputs off.
    pub fn bring_up(&mut self, setup: Setup) -> Result<()> {
        self.timer(setup)?;
        self.pins()?;
        self.modify(TIM1, 1, 1)?;
        self.wait(2 * PERIOD)
    }

    /// Sets compare values for the next period.
    pub fn compare(&mut self, values: [u32; 3]) -> Result<()> {
        for (leg, value) in values.into_iter().enumerate() {
            self.write(TIM1 + 0x34 + 4 * leg as u32, value)?;
        }
        self.wait(PERIOD)
    }

    /// Switches the outputs on or off.
    pub fn outputs(&mut self, on: bool) -> Result<()> {
        self.modify(TIM1 + BDTR, MOE, if on { MOE } else { 0 })
    }

    /// Sets both ADCs up with these channels and the same SMP fields for all, started by the timer.
    pub fn converters(&mut self, channels: [&[u32]; 2], sampling: u32) -> Result<()> {
        for port in [GPIOA, GPIOC] {
            // Analog, as after reset.
            let analog = if port == GPIOA { 0xf } else { 0x3f };
            self.modify(port + MODER, analog, analog)?;
        }
        // A quarter of the core clock.
        self.write(ADC_CCR, 3 << 16)?;
        for (n, channels) in (0..).zip(channels) {
            let base = ADC1 + 0x100 * n;
            self.write(base + 0x08, 0)?;
            self.write(base + 0x08, 1 << 28)?;
            self.wait(25 * US)?;
            self.write(base + 0x08, 1 << 31 | 1 << 28)?;
            self.wait(50 * US)?;
            self.write(base, 1)?;
            self.write(base + 0x08, 1 << 28 | 1)?;
            self.wait(10 * US)?;
            // JQDIS.
            self.modify(base + 0x0c, 1 << 31, 1 << 31)?;
            for register in 0..2 {
                let all = (0..10).fold(0, |word, n| word | sampling << (3 * n));
                let mask = if register == 0 { 0x3fff_ffff } else { 0x7ff_ffff };
                self.modify(base + 0x14 + 4 * register, mask, all)?;
            }
            let ranks = channels.iter().zip([9, 15, 21, 27]);
            let sequence = ranks.fold(0, |word, (channel, at)| word | channel << at);
            let length = channels.len() as u32 - 1;
            self.write(base + 0x4c, sequence | 1 << 7 | length)?;
            self.write(base + 0x08, 1 << 28 | 1 | 1 << 3)?;
        }
        Ok(())
    }

    /// Returns the results of an ADC.
    pub fn results(&mut self, converter: u32, count: u32) -> Vec<u16> {
        (0..count)
            .map(|rank| self.read(ADC1 + 0x100 * converter + 0x80 + 4 * rank) as u16)
            .collect()
    }

    /// Returns the compare values in force at the motor.
    pub fn applied(&mut self) -> Compare {
        self.board.gates().compare()
    }
}

/// Returns the violation with which a run must end.
pub fn violation(result: Result<()>) -> String {
    let why = result.expect_err("nothing was noticed").to_string();
    let violation = why.strip_prefix("bad gate signals: ");
    violation.unwrap_or_else(|| panic!("{why}")).to_owned()
}

/// Whether a text is that of a violation.
pub fn is(violation: &str, bad: BadGates) -> bool {
    violation.starts_with(&bad.to_string())
}
