//! Exception entry and return: the stack frames (ARMv7-M, B1.5), and the registers that they hold.

use super::{Circuit, Cpu, Register as R};

/// Bit of EXC_RETURN: a frame without floating-point registers.
const BASIC_FRAME: u32 = 1 << 4;
/// Bit of CONTROL: floating-point registers are in use.
const FPCA: u64 = 1 << 2;

pub(super) const BASIC: [R; 8] = [R::R0, R::R1, R::R2, R::R3, R::R12, R::LR, R::PC, R::XPSR];
const FLOAT: [R; 9] = [R::D0, R::D1, R::D2, R::D3, R::D4, R::D5, R::D6, R::D7, R::FPSCR];

/// R4 to R11, and S16 to S31, which functions preserve.
const KEPT: [R; 8] = [R::R4, R::R5, R::R6, R::R7, R::R8, R::R9, R::R10, R::R11];
const KEPT_FLOAT: [R; 8] = [R::D8, R::D9, R::D10, R::D11, R::D12, R::D13, R::D14, R::D15];

impl<C: Circuit> Cpu<C> {
    /// Pushes the frame of an exception and goes to its `handler`; returns `false` if the stack is not in memory.
    pub fn enter(&mut self, exception: u16, handler: u32) -> bool {
        let float = self.control() & FPCA != 0;
        let before = self.get(R::SP);
        let size = if float { 0x68 } else { 0x20 };
        let sp = before.wrapping_sub(size) & !7;
        let mut frame = [0; 0x68];
        let basic = self.uc.reg_read_batch(&BASIC, 8).unwrap_or_default();
        for (place, value) in frame.chunks_exact_mut(4).zip(&basic) {
            place.copy_from_slice(&(*value as u32).to_le_bytes());
        }
        // The stacked status contains the Thumb bit, and whether the stack was moved for its alignment.
        let xpsr = basic.get(7).map_or(0, |x| *x as u32) & !(1 << 9) | 1 << 24 | (before & 4) << 7;
        frame[0x1c..0x20].copy_from_slice(&xpsr.to_le_bytes());
        if float {
            let values = self.uc.reg_read_batch(&FLOAT, 9).unwrap_or_default();
            for (place, value) in frame[0x20..0x68].chunks_exact_mut(8).zip(&values) {
                place.copy_from_slice(&value.to_le_bytes());
            }
            self.uc.reg_write(R::CONTROL, self.control() & !FPCA).ok();
        }
        let bytes = &frame[..size as usize];
        let stacked = !self.denies(sp, size) && self.uc.mem_write(u64::from(sp), bytes).is_ok();
        let from_handler = xpsr & 0x1ff != 0;
        let exc_return =
            0xffff_ffe1 | if from_handler { 0 } else { 8 } | if float { 0 } else { BASIC_FRAME };
        self.set(R::SP, sp);
        self.set(R::LR, exc_return);
        self.set_exception(1 << 24 | u32::from(exception));
        self.set(R::PC, handler);
        stacked
    }

    /// Pops the frame of an exception; returns `false` if the stack is not in memory.
    pub fn leave(&mut self, exc_return: u32) -> bool {
        let sp = self.get(R::SP);
        let float = exc_return & BASIC_FRAME == 0;
        let mut frame = [0; 0x68];
        let size = if float { 0x68 } else { 0x20 };
        if self.uc.mem_read(u64::from(sp), &mut frame[..size]).is_err() {
            return false;
        }
        let word = |n: usize| u32::from_le_bytes(frame.as_chunks().0[n]);
        let xpsr = word(7);
        self.set_exception(xpsr & !(1 << 9));
        if float {
            let doubles = frame[0x20..].as_chunks().0;
            let values: [u64; 9] = std::array::from_fn(|k| u64::from_le_bytes(doubles[k]));
            self.uc.reg_write_batch(&FLOAT, &values, 9).ok();
        }
        let control = self.control() & !FPCA | if float { FPCA } else { 0 };
        self.uc.reg_write(R::CONTROL, control).ok();
        let basic: [u64; 7] = std::array::from_fn(|k| word(k).into());
        self.uc.reg_write_batch(&BASIC[..6], &basic[..6], 6).ok();
        self.set(R::SP, sp.wrapping_add(size as u32).wrapping_add(4 * (xpsr >> 9 & 1)));
        self.set(R::PC, basic[6] as u32);
        true
    }

    /// Returns the registers that an interrupt must preserve: R0 to PC, status, masks, CONTROL, S16 to S31, and, if
    /// floating point is used, S0 to S15 and FPSCR.
    pub fn registers(&self) -> Vec<u64> {
        let read = |register: &R| self.uc.reg_read(*register).unwrap_or(0);
        let special = [R::SP, R::PRIMASK, R::BASEPRI, R::CONTROL];
        // All but XPSR, which is the last one.
        let basic = &BASIC[..BASIC.len() - 1];
        let whole = basic.iter().chain(&KEPT).chain(&KEPT_FLOAT).chain(&special);
        let mut values: Vec<u64> = whole.map(read).collect();
        // Flags and exception number; the emulator sets the Thumb bit only while it runs.
        values.push(read(&R::XPSR) & 0xf80f_01ff);
        if self.uses_float() {
            values.extend(FLOAT.iter().map(read));
        }
        values
    }

    /// Whether the floating-point registers are in use.
    pub fn uses_float(&self) -> bool {
        self.control() & FPCA != 0
    }

    /// Fills S0 to S15 with values that are not numbers.
    pub fn spoil_float(&mut self) {
        for register in FLOAT.into_iter().take(8) {
            self.uc.reg_write(register, 0x7fa0_dead_7fa0_dead).ok();
        }
    }

    fn control(&self) -> u64 {
        self.uc.reg_read(R::CONTROL).unwrap_or(0)
    }

    pub(super) fn set_exception(&mut self, xpsr: u32) {
        let mut write = |register, value| self.uc.reg_write(register, value);
        write(R::XPSR, u64::from(xpsr)).ok();
        write(R::IPSR, u64::from(xpsr & 0x1ff)).ok();
        // This write informs the translator about handler mode.
        write(R::APSR_NZCV, u64::from(xpsr & 0xf000_0000)).ok();
    }
}
