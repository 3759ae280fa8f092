//! Peripherals of which nothing but the registers is modelled.

use super::Plain;

/// Debug support (RM0440, section 47); [`crate::chip::debugger`] acts on it.
pub const DEBUG: &[Plain] = &[
    (0x00, 0x2019_6469, 0),
    (DBG_CR, 0, 0xe7),
    (DBG_APB1_FZ, 0, 0xc060_1c3f),
    (0x0c, 0, 0x2),
    (DBG_APB2_FZ, 0, 0x3c17_2800),
];
/// Of the debug support: clocks in sleep, stop and standby.
pub const DBG_CR: u32 = 0x04;
/// Peripherals of APB1 that stop while the core is halted.
pub const DBG_APB1_FZ: u32 = 0x08;
/// The same of APB2.
pub const DBG_APB2_FZ: u32 = 0x10;
/// External interrupts (RM0440, section 15): no pin raises one in this firmware.
pub const EXTI: &[Plain] = &[
    (0x00, 0xff82_0000, u32::MAX),
    (0x04, 0, u32::MAX),
    (0x08, 0, 0xe07b_ffff),
    (0x0c, 0, 0xe07b_ffff),
    (0x14, 0, 0),
    (0x20, 0xffff_ff87, 0xf3f),
    (0x24, 0, 0xf3f),
    (0x28, 0, 0x303),
    (0x2c, 0, 0x303),
    (0x34, 0, 0),
];
/// System configuration (RM0440, section 10).
pub const SYSCFG: &[Plain] = &[
    (0x00, 0, 0x107),
    (0x04, 0x7c00_0001, 0xfcff_0300),
    (0x08, 0, 0xffff),
    (0x0c, 0, 0xffff),
    (0x10, 0, 0xffff),
    (0x14, 0, 0xffff),
    (0x18, 0, 1),
    (CFGR2, 0, 0xf),
    (0x20, 0, u32::MAX),
    (0x24, 0, 0),
];
/// The backup registers (RM0440, TAMP): one of them.
pub const TAMP: &[Plain] = &[(0x100, 0, u32::MAX)];
/// Of the system configuration: errors that go to the breaks of the timers.
pub const CFGR2: u32 = 0x1c;
/// CFGR2: a lock-up of the core.
pub const CLL: u32 = 1;
/// CFGR2: a supply that the supply monitor finds too low.
pub const PVDL: u32 = 1 << 2;
/// CFGR2: an error of the flash that its check code cannot correct.
pub const ECCL: u32 = 1 << 3;
