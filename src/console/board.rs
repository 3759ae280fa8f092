//! The text of the board: its assumptions, and whether they are confirmed.

use core::fmt;

use crate::boards::{Board, Currents, Source};
use crate::settings::FirmwareSettings;

impl Board {
    /// The assumed items, each with the bench step that shows whether it holds.
    pub fn assumptions(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        self.sources().into_iter().filter_map(|(item, source)| match source? {
            Source::Assumed(step) => Some((item, step)),
            Source::Read(_) => None,
        })
    }

    /// The items of the power stage with their sources; the source is `None` for an item that the board does not have.
    pub fn sources(&self) -> [(&'static str, Option<Source>); 15] {
        let Currents { a, b, shunts } = &self.currents;
        [
            ("high sides: level that switches on", Some(self.high.on_at.source)),
            ("low sides: level that switches on", Some(self.low.on_at.source)),
            ("fault input: level that trips", Some(self.fault.trips_at.source)),
            ("fault input: resistor", Some(self.fault.pull_ohm.source)),
            ("dead time", Some(self.dead_time_s.source)),
            ("scale of current a", Some(a.line.source)),
            ("scale of current b", Some(b.line.source)),
            ("scale of current c", shunts.map(|shunts| shunts.c.line.source)),
            ("settling of the shunts", shunts.map(|shunts| shunts.settle_s.source)),
            ("scale of the dc link", Some(self.dc_link.line.source)),
            ("maximum operating voltage", Some(self.dc_link_limits.operation.source)),
            ("switches withstand", Some(self.dc_link_limits.switches.source)),
            ("capacitors withstand", Some(self.dc_link_limits.capacitors.source)),
            ("over-current shut-down", self.over_current.map(|shut_down| shut_down.source)),
            ("thermistor", Some(self.ntc.source)),
        ]
    }
}

/// The boot pin at a reset, by whether it counts. ST's loader holds PA9, a gate, at a high level (AN2606).
const BOOT_PIN: [&str; 2] = [
    "boot pin: not in use (option bytes nSWBOOT0 = 0, nBOOT0 = 1)",
    "boot pin: PB8 high at a reset starts ST's loader, which switches a gate on (PA9): 10 kOhm from PB8 to ground; \
     `STM32_Programmer_CLI -c port=SWD -ob nSWBOOT0=0 nBOOT0=1`, or in OpenOCD \
     `stm32l4x option_write 0 0x20 0x08000000 0x0c000000; stm32l4x option_load 0`, ends that",
];

/// Line number `i` of the text of the board: its name, its assumptions with the bench step for each, the boot pin, and whether all of it
/// is confirmed.
pub fn line(settings: &FirmwareSettings, i: usize) -> Option<impl fmt::Display> {
    let (board, boot_pin) = (settings.board, usize::from(settings.boot_pin_counts));
    let confirmed = settings.board_is_confirmed();
    let count = board.assumptions().count();
    (i < count + 3).then_some(fmt::from_fn(move |f| {
        if i == 0 {
            return write!(f, "board {}: {}", board.name, board.title);
        }
        match board.assumptions().nth(i - 1) {
            Some((item, step)) => write!(f, "assumed {item}; bench: {step}"),
            None if i == count + 1 => f.write_str(BOOT_PIN[boot_pin]),
            None if confirmed => f.write_str("confirmed"),
            None => f.write_str("not confirmed: the drive does not start; `confirm board` when all bench steps are done"),
        }
    }))
}
