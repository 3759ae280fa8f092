//! The core: Unicorn 2.1.3 as a Cortex-M4F, with the chip around it.
//!
//! Properties of the emulator: the mode is THUMB without MCLASS and the model is set to Cortex-M4 (with MCLASS it would
//! be an M33). The translator learns about handler mode only from a write to the flags that follows the write to IPSR.
//! Hooks stop the core before the instruction for which they are called. The model of a register must not stop the
//! core, because the core would repeat its access.

mod frame;
mod guard;

use std::cell::Cell;
use std::rc::Rc;

pub use unicorn_engine::RegisterARM as Register;
use unicorn_engine::unicorn_const::{
    Arch, HookType, MemType, Mode, Permission, TlbEntry, TlbType, uc_error,
};
use unicorn_engine::{Context, UcHookId, Unicorn};

use crate::chip::Chip;
use crate::circuit::Circuit;
use crate::cost::{self, Costs};
use crate::memory::{self, Backing};
use frame::BASIC;

/// Index of the Cortex-M4 among the emulator's 32-bit models.
const CORTEX_M4: i32 = 9;
/// Lowest program counter that is an EXC_RETURN.
const EXC_RETURN: u32 = 0xffff_ffe0;
/// The reason for which the core stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The core waits for an interrupt.
    Wait,
    /// The chip needs attention: time of an event, a pended exception, a failure.
    Asked,
    /// The core branched to this EXC_RETURN.
    Return(u32),
    /// The core accessed this address, at which nothing exists.
    Access(u32),
    /// The core accessed this address, which the memory protection denies.
    Denied(u32),
    /// An undefined instruction, or a fetch from an address without memory.
    Instruction,
}

/// Options for counting, which cost speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counting {
    /// Counts the cycles of the code in CCM. Otherwise that code takes no time.
    pub cycles: bool,
    /// Allows the core to stop at every instruction in the flash, not only at the beginning of a block.
    pub every_instruction: bool,
}

/// The emulated core.
pub struct Cpu<C: Circuit = ()> {
    uc: Unicorn<'static, Chip<C>>,
    faulted: Rc<Cell<Option<u32>>>,
    trapped: Rc<Cell<bool>>,
    guard: Option<guard::Guard>,
    suspects: Rc<Suspects>,
    /// The hook for reads from the code area of the flash.
    flash_reads: Option<UcHookId>,
}

/// Blocks and instructions that may begin with the state of a finished IT block.
#[derive(Default)]
struct Suspects {
    /// Number of the next blocks, or instructions if the core can stop at each, that have to be looked at.
    left: Cell<u8>,
    /// Set when a block has to begin again.
    again: Cell<bool>,
}

/// The state of the IT block in XPSR.
const IT_STATE: u32 = 0x0600_fc00;

/// Registers and memories of a stopped core.
pub struct CoreState {
    registers: Context,
    memories: Vec<(u32, Vec<u8>)>,
}

/// Largest number of suspects: after a stop or a look-up of a page in an IT block its four instructions, and the one after it.
const SUSPECTS: u8 = 5;
/// Size of the pieces, bytes, that are compared before they are written, because written code is translated again.
const PIECE: usize = 256;
/// Longest time between two operations of the flash, ticks: 100 ms.
const WRITES: u64 = 100 * 170_000;
/// End of the code in CCM.
const CCM_END: u32 = memory::CCM + memory::CCM_SIZE;
/// Exceptions of the emulator that mean a branch to EXC_RETURN: the documented one, and a fetch from there.
const EXCEPTION_EXIT: [u32; 2] = [8, 3];

impl<C: Circuit> Cpu<C> {
    /// Makes a core with this chip and the memory of the STM32G474RE.
    pub fn new(chip: Chip<C>, counting: Counting) -> Result<Self, uc_error> {
        let mut uc = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, chip)?;
        uc.ctl_set_cpu_model(CORTEX_M4)?;
        for (base, size, backing) in memory::MAP {
            let (base, size) = (u64::from(base), size as usize);
            match backing {
                Backing::Flash => uc.mem_map(base, size, Permission::READ | Permission::EXEC)?,
                Backing::Ram => uc.mem_map(base, size, Permission::ALL)?,
                Backing::Registers => {
                    uc.mmio_map(
                        base,
                        size,
                        Some(move |uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize| {
                            let address = (base + offset) as u32;
                            u64::from(uc.get_data_mut().read(address, size as u8))
                        }),
                        Some(move |uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize, v: u64| {
                            let address = (base + offset) as u32;
                            uc.get_data_mut().write(address, size as u8, v as u32);
                        }),
                    )?;
                }
            }
        }
        // CCM appears at two addresses.
        uc.mmio_map(
            u64::from(memory::CCM_ALIAS),
            memory::CCM_SIZE as usize,
            Some(|uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize| {
                let mut bytes = [0; 8];
                uc.mem_read(u64::from(memory::CCM) + offset, &mut bytes[..size]).ok();
                u64::from_le_bytes(bytes)
            }),
            Some(|uc: &mut Unicorn<Chip<C>>, offset: u64, size: usize, value: u64| {
                let bytes = value.to_le_bytes();
                uc.mem_write(u64::from(memory::CCM) + offset, &bytes[..size]).ok();
            }),
        )?;

        let end = u64::from(memory::RAM + memory::RAM_SIZE - 1);
        let suspects = Rc::new(Suspects::default());
        // A single hook for all code, because the emulator asks each hook at every block whether the block is in its range.
        let from = if counting.every_instruction {
            let flash = (u64::from(memory::FLASH), u64::from(memory::STORED - 1));
            let begun = Rc::clone(&suspects);
            uc.add_code_hook(flash.0, flash.1, move |uc, address, size| {
                if !begun.stops_at(uc, address as u32) && !fetched(uc, address as u32, size) {
                    uc.get_data_mut().instructions(1);
                }
            })?;
            memory::CCM
        } else {
            memory::FLASH
        };
        let flash_size = memory::STORED - memory::FLASH;
        let mut lengths = Costs::new(memory::FLASH, flash_size, |_| 1);
        let mut costs = Costs::new(memory::FLASH, flash_size, |instruction| instruction.cycles);
        let mut fast = Costs::new(memory::CCM, memory::CCM_SIZE, |instruction| instruction.cycles);
        let mut last = 0;
        let (looked_up, begun) = (Rc::clone(&suspects), Rc::clone(&suspects));
        uc.add_block_hook(from.into(), end, move |uc, address, size| {
            let address = address as u32;
            if begun.stops_at(uc, address) {
                return;
            }
            match address {
                memory::FLASH..memory::STORED => {
                    if fetched(uc, address, size) {
                        return;
                    }
                    if uc.get_data().in_counted {
                        let cycles = cost_of(&mut costs, uc, address, size);
                        let wait_states = uc.get_data().flash.wait_states();
                        let cycles = cycles + cost::waits(address, size, wait_states);
                        uc.get_data_mut().block(address, size, cycles);
                        return;
                    }
                    // Main loop and slow interrupts: one cycle per instruction.
                    let instructions = cost_of(&mut lengths, uc, address, size);
                    uc.get_data_mut().instructions(u64::from(instructions));
                    if uc.get_data().watched.is_some() {
                        let cycles = cost_of(&mut costs, uc, address, size);
                        uc.get_data_mut().watch(address, size, cycles);
                    } else if size == 4 && last == address {
                        skip_delay(uc, address);
                    }
                    last = address;
                }
                memory::CCM..CCM_END if counting.cycles && !stopped(uc, address) => {
                    let cycles = cost_of(&mut fast, uc, address, size);
                    uc.get_data_mut().block(address, size, cycles);
                }
                // No code is in RAM: a program that executes there is lost, but time continues.
                memory::RAM.. if !stopped(uc, address) => {
                    uc.get_data_mut().instructions(u64::from(size / 2).max(1));
                }
                _ => {}
            }
        })?;
        let trapped = Rc::new(Cell::new(false));
        let trap = Rc::clone(&trapped);
        uc.add_intr_hook(move |uc, number| {
            // Undefined instructions, supervisor calls, breakpoints.
            trap.set(!EXCEPTION_EXIT.contains(&number));
            uc.emu_stop().ok();
        })?;
        let faulted = Rc::new(Cell::new(None));
        // The emulator writes slowly to a page with a hook, even one of this kind, and to a page that it regards as
        // executable. This hook therefore excludes RAM, and a page becomes executable at its first fetch.
        for (from, to) in [(0, u64::from(memory::RAM - 1)), (end + 1, u64::MAX)] {
            let note = Rc::clone(&faulted);
            uc.add_mem_hook(HookType::MEM_INVALID, from, to, move |_, _, address, _, _| {
                note.set(Some(address as u32));
                false
            })?;
        }
        uc.ctl_tlb_type(TlbType::VIRTUAL)?;
        uc.add_tlb_hook(0, u64::MAX, move |_, paddr, access| {
            looked_up.left.set(SUSPECTS);
            let data = Permission::READ | Permission::WRITE;
            let perms = if access == MemType::FETCH { Permission::ALL } else { data };
            Some(TlbEntry { paddr, perms })
        })?;
        Ok(Self { uc, faulted, trapped, suspects, guard: None, flash_reads: None })
    }

    /// Follows the flash: data reads from the code area are checked only while it is written or has a bad word, because
    /// all memory is slower meanwhile.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn follow_flash(&mut self) -> Result<(), uc_error> {
        let chip = self.chip();
        let wanted =
            chip.flash.has_bad_code() || chip.flash.is_busy(chip.now.saturating_sub(WRITES));
        if wanted == self.flash_reads.is_some() {
            return Ok(());
        }
        self.flash_reads = match self.flash_reads.take() {
            Some(hook) => self.uc.remove_hook(hook).map(|()| None)?,
            None => Some(self.uc.add_mem_hook(
                HookType::MEM_READ,
                memory::FLASH.into(),
                u64::from(memory::STORED - 1),
                |uc, _, address, size, _| {
                    uc.get_data_mut().fetch(address as u32, size as u32);
                    true
                },
            )?),
        };
        // The translation of code decides whether memory accesses are checked.
        self.uc.ctl_flush_tb()
    }

    /// Stores registers and memories; nothing changes the code area of the flash.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn keep(&self) -> Result<CoreState, uc_error> {
        let registers = self.uc.context_init()?;
        let contents = |(base, size): (u32, u32)| {
            Ok((base, self.uc.mem_read_as_vec(u64::from(base), size as usize)?))
        };
        let memories = memory::VOLATILE.into_iter().map(contents).collect::<Result<_, _>>()?;
        Ok(CoreState { registers, memories })
    }

    /// Goes back to a stored state.
    ///
    /// # Errors
    /// An error of the emulator.
    pub fn go_back(&mut self, to: &CoreState) -> Result<(), uc_error> {
        let mut now = vec![0; PIECE];
        for (base, bytes) in &to.memories {
            for (n, piece) in bytes.chunks(PIECE).enumerate() {
                let address = base + (n * PIECE) as u32;
                self.uc.mem_read(u64::from(address), &mut now[..piece.len()])?;
                if now != piece {
                    self.write(address, piece);
                }
            }
        }
        self.uc.context_restore(&to.registers)
    }

    /// Returns the chip.
    pub fn chip(&self) -> &Chip<C> {
        self.uc.get_data()
    }

    /// Returns the chip for changes.
    pub fn chip_mut(&mut self) -> &mut Chip<C> {
        self.uc.get_data_mut()
    }

    /// Runs from the program counter until something stops the core.
    pub fn run(&mut self) -> Stop {
        self.faulted.set(None);
        self.trapped.set(false);
        self.chip_mut().first = true;
        self.chip_mut().core_runs = true;
        self.suspects.left.set(SUSPECTS);
        let result = loop {
            let pc = self.get(Register::PC);
            let result = self.uc.emu_start(u64::from(pc | 1), 0xffff_fffe, 0, 0);
            if !self.suspects.again.replace(false) {
                break result;
            }
            self.set(Register::XPSR, self.get(Register::XPSR) & !IT_STATE);
            // The block was translated with the stale state, and the block before leads to it directly from now on.
            let block = u64::from(self.get(Register::PC));
            self.uc.ctl_remove_cache(block, block + 2).ok();
        };
        let pc = self.get(Register::PC);
        self.chip_mut().core_runs = false;
        if let Some(address) = self.chip_mut().guard_hit.take() {
            return Stop::Denied(address);
        }
        if pc >= EXC_RETURN {
            return Stop::Return(pc | 1);
        }
        match result {
            Ok(()) if self.trapped.get() => Stop::Instruction,
            // A jump to an address without memory, for example by a return address from the modelled page of the guard,
            // which the emulator does not report.
            Ok(()) if self.word(pc & !3).is_none() => Stop::Instruction,
            Ok(()) if self.chip().wants_attention() => Stop::Asked,
            Ok(()) => Stop::Wait,
            Err(_) => self.faulted.get().map_or(Stop::Instruction, Stop::Access),
        }
    }

    /// Returns a register.
    pub fn get(&self, register: Register) -> u32 {
        self.uc.reg_read(register).unwrap_or(0) as u32
    }

    /// Sets a register.
    pub fn set(&mut self, register: Register, value: u32) {
        self.uc.reg_write(register, u64::from(value)).ok();
    }

    /// Reads memory, but no registers; returns `false` if there is no memory.
    pub fn read(&self, address: u32, bytes: &mut [u8]) -> bool {
        self.uc.mem_read(u64::from(address), bytes).is_ok()
    }

    /// Returns a byte of memory.
    pub fn byte(&self, address: u32) -> Option<u8> {
        let mut byte = [0];
        self.read(address, &mut byte).then_some(byte[0])
    }

    /// Returns a word of memory.
    pub fn word(&self, address: u32) -> Option<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes).then(|| u32::from_le_bytes(bytes))
    }

    /// Writes memory, including flash; returns `false` if there is no memory.
    pub fn write(&mut self, address: u32, bytes: &[u8]) -> bool {
        let done = self.uc.mem_write(u64::from(address), bytes).is_ok();
        // Code may have been written.
        let end = u64::from(address) + bytes.len() as u64;
        self.uc.ctl_remove_cache(u64::from(address), end).ok();
        done
    }

    /// Sets the registers as after a reset, with stack pointer and program counter from the vector table.
    pub fn reset(&mut self, vectors: u32) {
        use Register::{BASEPRI, CONTROL, FAULTMASK, FPSCR, PRIMASK};
        for register in BASIC[..6].iter().chain(&[CONTROL, PRIMASK, BASEPRI, FAULTMASK, FPSCR]) {
            self.set(*register, 0);
        }
        self.set_exception(1 << 24);
        let (sp, pc) = (self.word(vectors), self.word(vectors + 4));
        self.set(Register::SP, sp.unwrap_or(0));
        self.set(Register::PC, pc.unwrap_or(0) & !1);
    }
}

/// Stops the core if the chip needs attention: before the block that begins here, which is reached again, and then
/// counted, when the core continues.
#[inline(always)]
fn stopped<C: Circuit>(uc: &mut Unicorn<Chip<C>>, address: u32) -> bool {
    let chip = uc.get_data_mut();
    chip.at = address;
    let stops = chip.stops_here();
    if stops {
        uc.emu_stop().ok();
    }
    stops
}

impl Suspects {
    /// Whether the core was stopped at this address, because it begins with the state of a finished IT block.
    fn stops_at<C: Circuit>(&self, uc: &mut Unicorn<Chip<C>>, address: u32) -> bool {
        let Some(left) = self.left.get().checked_sub(1) else { return false };
        self.left.set(left);
        let stale = is_stale(uc, address);
        if stale {
            self.again.set(true);
            uc.emu_stop().ok();
        }
        stale
    }
}

/// Whether the emulator mistakes the first instructions of a block for those of a finished IT block. This happens if
/// the conditional access in that block was the first one to a page since the emulator dropped its pages, or if the core was
/// stopped within that block, for example by an interrupt.
#[cold]
fn is_stale<C: Circuit>(uc: &mut Unicorn<Chip<C>>, address: u32) -> bool {
    if uc.reg_read(Register::XPSR).unwrap_or(0) as u32 & IT_STATE == 0 {
        return false;
    }
    // An IT block has at most four instructions, so one that contains the block begins within 18 bytes before it.
    let before = uc.mem_read_as_vec(u64::from(address) - 18, 18).unwrap_or_default();
    let contains = |it: usize| {
        let instructions = 4 - before[it].trailing_zeros();
        let mut at = it + 2;
        (0..instructions).any(|_| {
            let begin = at;
            at += if before.get(begin + 1).is_some_and(|&high| high >= 0xe8) { 4 } else { 2 };
            begin == before.len()
        })
    };
    let is_it = |&at: &usize| before[at + 1] == 0xbf && before[at] & 0xf != 0;
    !(0..before.len()).step_by(2).filter(is_it).any(contains)
}

/// As above for code in the flash, which may have to wait for the flash.
#[inline(always)]
fn fetched<C: Circuit>(uc: &mut Unicorn<Chip<C>>, address: u32, size: u32) -> bool {
    if uc.get_data_mut().fetch(address, size) {
        uc.emu_stop().ok();
        return true;
    }
    stopped(uc, address)
}

/// Executes at once the rounds of a delay loop, `subs rN, #1` and `bne` to it, that begin before the next event; all but the last one.
fn skip_delay<C: Circuit>(uc: &mut Unicorn<Chip<C>>, address: u32) {
    let code = uc.mem_read_as_vec(address.into(), 4);
    if let Ok([1, subtract @ 0x38..=0x3f, 0xfd, 0xd1]) = code.as_deref() {
        let register = Register::R0 as i32 + i32::from(subtract & 7);
        let left = uc.reg_read(register).unwrap_or(0);
        let rounds = (uc.get_data().instructions_before_event() / 2).min(left.saturating_sub(2));
        uc.reg_write(register, left - rounds).ok();
        uc.get_data_mut().instructions(2 * rounds);
    }
}

/// Returns the cycles of a block.
#[inline(always)]
fn cost_of<C: Circuit>(costs: &mut Costs, uc: &Unicorn<Chip<C>>, address: u32, size: u32) -> u32 {
    match costs.known(address, size) {
        Some(cost) => cost,
        None => {
            let mut code = vec![0; size as usize];
            uc.mem_read(u64::from(address), &mut code).ok();
            costs.learn(address, &code)
        }
    }
}
