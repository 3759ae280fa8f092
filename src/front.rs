//! The user interfaces of the firmware: command arbiter, console, field bus and terminals, and the order in which the main loop
//! serves them.

use crate::console::Console;
use crate::console::handle::{Firmware, Port};
use crate::desk::Desk;
use crate::modbus::{self, Bus};
use crate::settings::FirmwareSettings;
use crate::terminals::{self, Terminals};

/// The command arbiter with its interfaces, see the head of the module.
pub struct Front {
    /// The command arbiter.
    pub desk: Desk,
    /// The console.
    pub console: Console,
    /// The field bus.
    pub bus: Bus,
    /// The terminals.
    pub terminals: Terminals,
}

impl Front {
    /// The interfaces of a drive with these settings.
    pub fn new(settings: FirmwareSettings) -> Self {
        let (desk, console) = (Desk::new(settings), Console::default());
        Self { desk, console, bus: Bus::default(), terminals: Terminals::default() }
    }

    /// Runs one pass of the main loop. It takes seconds if controllers are designed; meanwhile the port `line` of the bus,
    /// which a board may lack, answers by itself. `now_ms` wraps.
    pub fn pass(
        &mut self,
        port: &mut impl Port,
        mut line: Option<&mut impl modbus::Port>,
        contacts: &mut impl terminals::Port,
        drive: &mut impl Firmware,
        now_ms: u32,
    ) {
        let Self { desk, console, bus, terminals } = self;
        desk.poll_drive(drive, now_ms);
        terminals.read_motor(contacts, desk, drive, now_ms);
        console.poll(port, desk, drive, now_ms);
        line.iter_mut().for_each(|line| bus.serve(*line, desk, drive, now_ms));
        terminals.serve(contacts, desk, drive, now_ms);
        if desk.is_busy() && console.has_said_all() {
            // A frame that came since the bus was served would wait for seconds.
            line.iter_mut().for_each(|line| {
                line.set_busy(true);
                bus.serve(*line, desk, drive, now_ms);
            });
            desk.run_pending(drive, now_ms);
            bus.end_design(desk);
            line.iter_mut().for_each(|line| line.set_busy(false));
        } else {
            desk.watch_silence(drive, now_ms);
        }
    }
}
