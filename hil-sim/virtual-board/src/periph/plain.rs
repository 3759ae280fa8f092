//! Peripherals of which nothing but the registers is modelled.

use super::Plain;

const ALL: u32 = u32::MAX;
/// Supply (RM0440, section 6): the regulator is always ready.
pub const PWR: &[Plain] = &[
    (0x00, 0x200, ALL),
    (0x04, 0, ALL),
    (0x08, 0x8000, ALL),
    (0x0c, 0, ALL),
    (0x10, 0, 0),
    (0x14, 0, 0),
    (0x18, 0, 0),
    (0x20, 0, ALL),
    (0x24, 0, ALL),
    (0x28, 0, ALL),
    (0x2c, 0, ALL),
    (0x80, 0x100, ALL),
];
/// Debug support (RM0440, section 47): no debugger is there.
pub const DEBUG: &[Plain] =
    &[(0x00, 0x2019_6469, 0), (0x04, 0, ALL), (0x08, 0, ALL), (0x0c, 0, ALL), (0x10, 0, ALL)];
/// External interrupts (RM0440, section 15): no pin raises one in this firmware.
pub const EXTI: &[Plain] = &[
    (0x00, 0xff82_0000, ALL),
    (0x04, 0, ALL),
    (0x08, 0, ALL),
    (0x0c, 0, ALL),
    (0x14, 0, 0),
    (0x20, 0xffff_ff87, ALL),
    (0x24, 0, ALL),
    (0x28, 0, ALL),
    (0x2c, 0, ALL),
    (0x34, 0, 0),
];
/// System configuration (RM0440, section 10).
pub const SYSCFG: &[Plain] = &[
    (0x00, 0, ALL),
    (0x04, 0x7c00_0001, ALL),
    (0x08, 0, ALL),
    (0x0c, 0, ALL),
    (0x10, 0, ALL),
    (0x14, 0, ALL),
    (CFGR2, 0, ALL),
    (0x1c, 0, ALL),
    (0x20, 0, ALL),
    (0x24, 0, ALL),
];
/// Of the system configuration: errors that go to the breaks of the timers.
pub const CFGR2: u32 = 0x18;
/// CFGR2: a lock-up of the core.
pub const CLL: u32 = 1;
/// CFGR2: an error of the flash that its check code cannot correct.
pub const ECCL: u32 = 1 << 3;
