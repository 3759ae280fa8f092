//! Registers of peripherals that have no other model, and some of their bits.

use super::{bits, offsets};

// Debug support (RM0440, section 47), on which [`crate::chip::debugger`] acts: clocks in sleep, stop and standby;
// peripherals of APB1 and of APB2 that stop while the core is halted.
offsets! { DBG_CR = 0x04, DBG_APB1_FZ = 0x08, DBG_APB2_FZ = 0x10 }
// System configuration (RM0440, section 10): errors that go to the breaks of the timers.
offsets! { CFGR2 = 0x1c }
// CFGR2: a lock-up of the core; a supply that the supply monitor finds too low; an error of the flash that its check code cannot correct.
bits! { pub(crate) CLL = 0, pub(crate) PVDL = 2, pub(crate) ECCL = 3 }
