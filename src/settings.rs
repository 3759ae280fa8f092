//! The settings of the firmware: those of the drive, those of the firmware around it, and the values learned on the motor. [`keys`] lists
//! them by name.

pub mod command;
pub mod keys;
pub(crate) mod own;
pub mod staging;
#[cfg(test)]
mod tests;

use drive_core::Coefficients;
use drive_core::learned::Learned;
use drive_settings::value::Words;
use drive_settings::{Inverter, Settings, SettingsError, words};

use crate::ModuleSettings;
use crate::board;
use crate::boards::{Board, SELECTED};

/// Reason why an image refuses a commander.
const LEFT_OUT: &str = "this image is built without it";
/// Reason why a board refuses a switching frequency.
const TOO_FAST: &str = "the switches of the board do not take it; set a lower one";

/// All settings of the firmware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirmwareSettings {
    /// The board that the settings belong to.
    pub board: &'static Board,
    /// Settings of the drive.
    pub drive: Settings,
    /// Settings of the firmware around the drive.
    pub command: command::Settings,
    /// The [confirmation](crate::boards::Board::confirmation) of the board whose bench steps were done; 0: none.
    pub confirmed: u32,
    /// Settings of the modules.
    pub modules: ModuleSettings,
    /// Whether a pin selects at a reset the program that starts: see [`board::boot_pin_counts`]. It is a state of the chip, which is not
    /// saved.
    pub boot_pin_counts: bool,
    /// Accepted result of a self-commissioning with these settings; it overrides them where both give a value.
    pub learned: Option<Learned>,
}

words! {
    /// The source of starts and set-points. Anybody may stop the drive.
    #[derive(Default)]
    pub enum Commander {
        /// The console.
        #[default]
        Console = "console",
        /// The bus.
        Bus = "bus",
        /// The terminals.
        Terminals = "strip",
    }
}

/// Silence of a commanding bus after which the drive stops, s, unless `command.timeout_s` sets another time.
pub const BUS_SILENT_S: f32 = 1.0;

impl FirmwareSettings {
    /// The defaults of the board that the firmware is built for.
    pub fn of_the_board() -> Self {
        Self::of(SELECTED)
    }

    /// The defaults of any board.
    pub fn of(board: &'static Board) -> Self {
        let drive = board::settings_of(board);
        let (command, modules) = (command::Settings::default(), ModuleSettings::default());
        Self { board, drive, command, confirmed: 0, modules, boot_pin_counts: true, learned: None }
    }

    /// Whether the bench steps of the board were done, with its values, the [hardware settings](keys::Key::hardware) and the option bytes
    /// as they are now.
    pub fn board_is_confirmed(&self) -> bool {
        self.confirmed == self.confirmation()
    }

    /// Notes that the bench steps of the board were done.
    pub fn confirm_board(&mut self) {
        self.confirmed = self.confirmation();
    }

    fn confirmation(&self) -> u32 {
        let hardware = keys::all().filter(|key| key.hardware()).map(|key| key.to_bits(self));
        // The trip in effect, because its rule follows the nameplate, which anybody may set.
        let trip = self.drive.trip_a().to_bits();
        self.board.confirmation(hardware.chain([trip, u32::from(self.boot_pin_counts)]))
    }

    /// Takes the result of a self-commissioning, if it was accepted. It replaces the values learned before, or adds to them if it was
    /// learned `again` with them in force.
    pub fn learn(&mut self, result: &Learned, again: bool) {
        if result.verdict.is_accepted() {
            let before = self.learned.filter(|_| again);
            self.learned = Some(before.map_or(*result, |before| result.on_top_of(&before)));
        }
    }

    /// Checks every value against its range and computes the coefficients of the drive.
    ///
    /// # Errors
    /// The first value out of range, or the design rule that cannot be met.
    pub fn build(&self) -> Result<Coefficients, SettingsError> {
        let mut own = *self;
        own.build_for(&board::Timer::of(&self.drive.inverter))
    }

    /// As [`build`](Self::build), for a timer whose dead time or switching frequency differs from the setting, because it takes new ones
    /// only at a reset.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_for(&mut self, timer: &board::Timer) -> Result<Coefficients, SettingsError> {
        self.check()?;
        // Changed in place and back, as the coefficients are, because copies would take 2 KiB more of the stack.
        let own = self.drive.inverter;
        let &board::Timer { dead_time_s, switching_khz, .. } = timer;
        self.drive.inverter = Inverter { dead_time_s, switching_khz, ..own };
        let mut built = self.drive.build();
        self.drive.inverter = own;
        if let (Ok(coefficients), Some(learned)) = (&mut built, &self.learned) {
            coefficients.take(learned);
        }
        built
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn check(&self) -> Result<(), SettingsError> {
        self.drive.check()?;
        let carrier = self.drive.inverter.switching_khz;
        if carrier > self.board.carrier_max_khz {
            return Err(SettingsError::Word("inverter.switching_khz", carrier.word(), TOO_FAST));
        }
        let commander = self.command.commander;
        if !crate::has(commander) {
            return Err(SettingsError::Word("bus.commands", commander.word(), LEFT_OUT));
        }
        // The ranges of the board are narrower.
        keys::all().try_for_each(|key| key.check(self))
    }
}
