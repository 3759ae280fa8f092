//! Inputs of a board from outside, including faults, and its console and log.

use anyhow::Result;

use super::{Board, CONTROL_INTERRUPT};
use crate::image::Image;
use stm32g4_unicorn::{chip::TICKS_PER_S, periph::Reset};

impl Board {
    /// Sends a line, without its end, to the console.
    pub fn type_line(&mut self, line: &str) {
        self.send(line.as_bytes());
        self.send(b"\n");
    }

    /// Sends bytes to the console.
    pub fn send(&mut self, bytes: &[u8]) {
        if let Some(loader) = &mut self.loader {
            return loader.line.extend(bytes);
        }
        let chip = self.chip();
        chip.lpuart.line.to_chip.extend(bytes.iter().map(|byte| u16::from(*byte)));
        chip.lpuart.wake(chip.now);
    }

    /// Sends bytes on the line of the field bus, one after the other.
    pub fn send_bus(&mut self, bytes: &[u8]) {
        let chip = self.chip();
        chip.usart3.line.to_chip.extend(bytes.iter().map(|byte| u16::from(*byte)));
        chip.usart3.wake(chip.now);
    }

    /// Returns the bytes that the board has sent on the field bus since the last call.
    pub fn take_bus(&mut self) -> Vec<u8> {
        self.chip().usart3.line.take()
    }

    /// Returns the output of the console since the last call.
    pub fn take_console(&mut self) -> String {
        let bytes = self.chip().lpuart.line.take();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Returns the log since the last call.
    ///
    /// # Errors
    /// The log cannot be decoded.
    pub fn take_log(&mut self) -> Result<Vec<String>> {
        self.drain_log()?;
        Ok(std::mem::take(&mut self.progress.lines))
    }

    pub(super) fn drain_log(&mut self) -> Result<()> {
        if let Some(log) = &mut self.log {
            self.progress.lines.extend(log.take(&mut self.cpu)?);
        }
        Ok(())
    }

    /// Switches the supplies of the power stage, of the gate drivers and of the dc link, V, off or on.
    ///
    /// # Errors
    /// A dc-link voltage that the plant refuses.
    pub fn supply_stage(&mut self, on: bool, dc_link_v: f64) -> Result<()> {
        self.chip().circuit.without_supply = !on;
        self.chip().follow_pins();
        self.plant.set_dc_link(dc_link_v)?;
        Ok(())
    }

    /// Interrupts the supply of the controller for a moment: RAM is lost, and a running operation of the flash leaves
    /// its words unreadable.
    pub fn unplug(&mut self) {
        let now = self.chip().now;
        self.chip().flash.cut(now);
        self.reset(Reset::Power);
    }

    /// Lets a programmer write another image for some time, ms: it resets the chip and holds the core, so that nothing
    /// sets up the pins. A reset ends it.
    ///
    /// # Errors
    /// As [`Board::run_ticks`].
    pub fn flash(&mut self, image: &Image, ms: f64) -> Result<()> {
        self.reset(Reset::Pin);
        self.hang();
        self.run_ticks((ms * 1e-3 * TICKS_PER_S as f64) as u64)?;
        for segment in &image.segments {
            self.cpu.write(segment.address, &segment.bytes);
        }
        self.reset(Reset::Pin);
        Ok(())
    }

    /// Lets the power stage release the fault input, or pull it low, which trips.
    pub fn set_fault_pin(&mut self, high: bool) {
        self.chip().pull_break_pin(!high);
    }

    /// Stops the crystal, or starts it again.
    pub fn set_crystal(&mut self, lives: bool) {
        self.chip().rcc.crystal_lives = lives;
    }

    /// Stops the execution of the core until a reset.
    pub fn hang(&mut self) {
        self.progress.hung = true;
    }

    /// Stops the execution of the core for some ticks, as if the bus were occupied.
    pub fn stall(&mut self, ticks: u64) {
        let chip = self.chip();
        chip.stalled_until = chip.now + ticks;
    }

    /// Makes accesses that the model does not know behave as on the chip from now on: reserved registers read as 0,
    /// other accesses are faults, and a fault in a fault handler locks the core up. This is for runs in which the
    /// firmware is damaged on purpose.
    pub fn forgive(&mut self) {
        self.cpu.chip_mut().forgiving = true;
        self.collect_violations();
    }

    /// Makes [`Board::run_ticks`] return before the n-th instruction in the flash from here.
    pub fn stop_after(&mut self, instructions: u64) {
        self.progress.preempt_at = Some(self.cpu.chip().instructions + instructions);
    }

    /// Makes an exception pending: it preempts according to its priority and the masks.
    pub fn pend(&mut self, exception: u16) {
        // A running control interrupt delays only itself.
        if exception == CONTROL_INTERRUPT && self.progress.entered.is_none() {
            self.progress.pended = Some(self.cpu.chip().now);
        }
        self.chip().scs.pend(exception);
    }
}
