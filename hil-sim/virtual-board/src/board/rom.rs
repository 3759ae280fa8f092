//! ST's boot loader in the system memory, which starts instead of the image or from it: the pins as it drives them, and
//! its protocol at the serial port of the console.

use std::collections::VecDeque;

use anyhow::{Result, ensure};

use super::Board;
use stm32g4_unicorn::chip::TICKS_PER_S;
use stm32g4_unicorn::memory::{FLASH, FLASH_END, STORED, SYSTEM};
use stm32g4_unicorn::periph::Reset;
use stm32g4_unicorn::periph::flash::{ERASE, PAGE, PROGRAM};
use stm32g4_unicorn::periph::rcc::{HSI_HZ, On};

/// Bit nSWBOOT0 of the option bytes (RM0440, FLASH_OPTR).
pub const N_SWBOOT0: u32 = 1 << 26;
/// Bit nBOOT0 of the option bytes (RM0440, FLASH_OPTR).
pub const N_BOOT0: u32 = 1 << 27;

/// Clocks of the ports, in RCC.
const AHB2ENR: u32 = 0x4c;
/// Registers of a port.
const MODER: u32 = 0x00;
const PUPDR: u32 = 0x0c;
const BSRR: u32 = 0x18;

/// State of a pin in the loader, as its fields of MODER and PUPDR: driven, idle at a high level; an input with the
/// chip's pull-up; an input with its pull-down.
type Held = (u32, u32);
const HIGH: Held = (1, 1);
const UP: Held = (0, 1);
const DOWN: Held = (0, 2);

/// Port (0 is A) and number of the pins of its serial ports, SPI and I2C that a power stage has (AN2606, table of the
/// configuration of STM32G47x in system memory boot).
const PINS: [(usize, u32, Held); 8] = [
    (0, 6, HIGH),
    (0, 7, DOWN),
    (0, 8, UP),
    (0, 9, HIGH),
    (0, 10, UP),
    (1, 14, HIGH),
    (2, 6, UP),
    (2, 8, UP),
];

/// Whether these option bytes and this level at PB8 start the loader (RM0440, boot configuration).
fn starts(option_bytes: u32, boot_pin: bool) -> bool {
    if option_bytes & N_SWBOOT0 != 0 { boot_pin } else { option_bytes & N_BOOT0 == 0 }
}

/// The system memory: stack pointer, entry, and an instruction that waits, at which the model takes over.
pub const CODE: [u8; 12] = [0, 0x40, 0, 0x20, 9, 0, 0xff, 0x1f, 0x30, 0xbf, 0xfd, 0xe7];

/// Whether the core executes the system memory.
pub fn is_inside(address: u32) -> bool {
    (SYSTEM..SYSTEM + CODE.len() as u32).contains(&address)
}

const ACK: u8 = 0x79;
const NACK: u8 = 0x1f;
/// Duration of a byte, ticks: eleven bits, with its parity, at the usual rate.
const BYTE: u64 = 11 * TICKS_PER_S / 115_200;
/// Answers to Get (version, commands), to Get Version, and to Get ID (the product).
const GET: [u8; 14] = [11, 0x31, 0, 1, 2, 0x11, 0x21, 0x31, 0x44, 0x63, 0x73, 0x82, 0x92, ACK];
const GET_VERSION: [u8; 4] = [0x31, 0, 0, ACK];
const GET_ID: [u8; 4] = [1, 0x04, 0x69, ACK];

/// The loader at the pins of the console (AN3155): Get, Get Version, Get ID, Read, Go, Write, Extended Erase.
#[derive(Default)]
pub struct Loader {
    /// Bytes on the line to the loader.
    pub line: VecDeque<u8>,
    /// Time at which it takes the next byte.
    ready_at: u64,
    /// Whether it has received 0x7f.
    synchronised: bool,
    /// The received part of a command.
    heard: Vec<u8>,
}

/// Whether the exclusive or of all bytes, including the check sum at the end, is zero.
fn sums_up(bytes: &[u8]) -> bool {
    bytes.iter().fold(0, |sum, byte| sum ^ byte) == 0
}

fn address(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |address, byte| address << 8 | u32::from(*byte))
}

impl Board {
    /// Resets the chip with this level at PB8; returns whether ST's loader runs from then on instead of the image, until the next reset.
    pub fn reset_with_boot_pin(&mut self, high: bool) -> bool {
        self.reset(Reset::Pin);
        let runs = starts(self.chip().flash.options, high);
        if runs {
            self.begin_loader();
        }
        runs
    }

    /// Starts the loader after the image has jumped into it.
    pub(super) fn enter_loader(&mut self) -> Result<()> {
        let chip = self.cpu.chip();
        ensure!(chip.syscfg.get(0) & 7 == 1, "the system memory is not at address 0");
        ensure!(
            chip.rcc.system_hz() == u64::from(HSI_HZ),
            "the loader needs the clock after a reset"
        );
        self.begin_loader();
        Ok(())
    }

    fn begin_loader(&mut self) {
        let chip = self.chip();
        let on = On { at: chip.now, accesses: chip.accesses };
        chip.rcc.write(AHB2ENR, 7, on);
        for (port, pin, (mode, pull)) in PINS {
            let gpio = &mut chip.gpio[port];
            gpio.write(BSRR, 1 << pin);
            for (register, field) in [(PUPDR, pull), (MODER, mode)] {
                let others = gpio.read(register).unwrap_or(0) & !(3 << (2 * pin));
                gpio.write(register, others | field << (2 * pin));
            }
        }
        chip.follow_pins();
        self.loader = Some(Loader { ready_at: on.at, ..Loader::default() });
        self.hang();
    }

    /// Lets the loader take the bytes that have come.
    pub(super) fn serve_loader(&mut self) {
        let now = self.cpu.chip().now;
        if self.loader.is_some() {
            // No interrupt does this meanwhile.
            self.advance_plant(now);
        }
        while let Some(loader) = &mut self.loader {
            if self.cpu.chip().flash.power_lost || loader.ready_at > now {
                return;
            }
            let Some(byte) = loader.line.pop_front() else {
                return loader.ready_at = now;
            };
            loader.ready_at += BYTE;
            if !loader.synchronised {
                loader.synchronised = byte == 0x7f;
                self.answer(&[ACK][..usize::from(byte == 0x7f)]);
                continue;
            }
            loader.heard.push(byte);
            let heard = std::mem::take(&mut loader.heard);
            let (goes_on, answer) = self.command(&heard);
            self.answer(&answer);
            if let Some(loader) = self.loader.as_mut().filter(|_| goes_on) {
                loader.heard = heard;
            }
        }
    }

    fn answer(&mut self, bytes: &[u8]) {
        let Some(loader) = &mut self.loader else { return };
        loader.ready_at += BYTE * bytes.len() as u64;
        let sent = bytes.iter().map(|byte| (loader.ready_at, *byte));
        self.cpu.chip_mut().lpuart.line.from_chip.extend(sent);
    }

    /// Processes the received part of a command: returns whether more of it is to come, and the answer.
    fn command(&mut self, heard: &[u8]) -> (bool, Vec<u8>) {
        let last = |done: bool| (false, vec![if done { ACK } else { NACK }]);
        let more = |right: bool| (right, vec![if right { ACK } else { NACK }]);
        match *heard {
            [_] => (true, Vec::new()),
            [command, complement] if command ^ complement != 0xff => last(false),
            [0x00, _] => (false, [&[ACK], &GET[..]].concat()),
            [0x01, _] => (false, [&[ACK], &GET_VERSION[..]].concat()),
            [0x02, _] => (false, [&[ACK], &GET_ID[..]].concat()),
            [0x11 | 0x21 | 0x31 | 0x44, _] => more(true),
            [_, _] => last(false),
            [0x44, _, _, _] | [_, _, _] => (true, Vec::new()),
            [0x44, _, high, low, ref rest @ ..] => {
                let length = 2 * address(&[high, low]) as usize + 2;
                if rest.len() <= length {
                    return (true, Vec::new());
                }
                let mut pages = rest[..length].chunks(2).map(address);
                last(sums_up(&heard[2..]) && pages.all(|page| self.erase(page)))
            }
            [_, _, ref at @ ..] if at.len() < 5 => (true, Vec::new()),
            [command, _, ref at @ ..] if at.len() == 5 => {
                let place = address(&at[..4]);
                let right = sums_up(at) && (FLASH..FLASH_END).contains(&place);
                if right && command == 0x21 {
                    self.answer(&[ACK]);
                    self.jump(place);
                    return (false, Vec::new());
                }
                more(right)
            }
            [0x11, _, ref at @ .., count, complement] if at.len() == 5 => {
                if count ^ complement != 0xff {
                    return last(false);
                }
                let bytes = self.contents(address(&at[..4]), usize::from(count) + 1);
                (false, [vec![ACK], bytes].concat())
            }
            [0x31, _, ref at @ ..] if at.len() > 6 && at.len() == usize::from(at[5]) + 8 => {
                let done =
                    sums_up(&at[5..]) && self.program(address(&at[..4]), &at[6..at.len() - 1]);
                last(done)
            }
            _ => (true, Vec::new()),
        }
    }

    /// Returns some bytes of the flash.
    fn contents(&mut self, from: u32, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        if from < STORED {
            self.cpu.read(from, &mut bytes);
        } else {
            let at = (from - STORED) as usize;
            bytes.copy_from_slice(&self.chip().flash.contents().0[at..at + count]);
        }
        bytes
    }

    /// Writes bytes to the flash.
    fn program(&mut self, from: u32, bytes: &[u8]) -> bool {
        for (n, word) in bytes.chunks(8).enumerate() {
            let (at, mut new) = (from + 8 * n as u32, [0xff; 8]);
            new[..word.len()].copy_from_slice(word);
            let erased = at.is_multiple_of(8) && self.contents(at, 8) == [0xff; 8];
            if !erased || self.chip().flash.power_lost {
                return false;
            }
            self.change(at, &new, PROGRAM);
        }
        true
    }

    fn erase(&mut self, page: u32) -> bool {
        let at = FLASH + page * PAGE as u32;
        let inside = at < FLASH_END && !self.chip().flash.power_lost;
        if inside {
            self.change(at, &[0xff; PAGE], ERASE);
        }
        inside
    }

    /// Does an operation of the flash that takes some ticks.
    fn change(&mut self, at: u32, bytes: &[u8], ticks: u64) {
        if at < STORED {
            self.cpu.write(at, bytes);
        }
        self.chip().flash.by_loader(at..at + bytes.len() as u32, bytes);
        self.loader.iter_mut().for_each(|loader| loader.ready_at += ticks);
    }

    /// Continues the core from a vector table.
    fn jump(&mut self, vectors: u32) {
        self.loader = None;
        self.progress.hung = false;
        self.cpu.reset(vectors);
    }
}
