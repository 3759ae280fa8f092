//! Requests to the command arbiter, its replies, and the reasons for which it refuses.

use drive_commission::Step;
use drive_core::homing::{OutOfRange, Plan};
use drive_core::{Mode, Stop};
use drive_settings::SettingsError;
use thiserror::Error;

use super::handle::CommandError;
use crate::boards::Board;
use crate::settings::Commander;
use crate::settings::keys::Key;
use crate::settings::staging::{Applied, SetError};
use crate::store::FlashError;

/// A request.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Put the staged settings in force, then start in a mode; for the self-commissioning use [`Learn`](Self::Learn).
    Start(Mode),
    /// Learn the motor's saliency: from scratch, or again at another rotor position on top of what is learned.
    Learn {
        /// On top of what is learned.
        again: bool,
    },
    /// Put the staged settings in force, then commission, from the first of these steps to the last.
    Commission(Step, Step),
    /// Put the results of the commissioning in force, and save.
    Accept,
    /// Stop in this way.
    Stop(Stop),
    /// Magnetise again and check that the flux is tracked.
    Relock,
    /// Set the q-axis current, A.
    Torque(f32),
    /// Set the speed, mechanical rpm.
    Speed(f32),
    /// Turn at this speed, mechanical rpm, while it is repeated.
    Jog(f32),
    /// Set the position, mechanical turns from the start.
    Position(f32),
    /// Look for a stop of the shaft.
    Home(Plan),
    /// Clear the latched fault.
    Clear,
    /// Stage the settings of the image.
    Defaults,
    /// Put the staged settings in force.
    Apply,
    /// Put the staged settings in force, without the lines of the backup that were refused.
    ApplyRest,
    /// Drop the staged settings.
    Revert,
    /// Put the staged settings in force and save all, with what was learned.
    Save,
    /// Send typed characters back, or not.
    Echo(bool),
    /// Reset the controller; true if unsaved settings may be lost.
    Reboot(bool),
    /// Reset the controller into ST's loader: the gate drivers have no supply.
    Update,
    /// Begin a backup: check that the lines that follow belong to this board. `None` is a board that this firmware does not know.
    BoardIs(Option<&'static Board>),
    /// Note that the bench steps of the board were done, and save.
    Confirm,
}

impl Order {
    /// Whether the request ends with the motor energised.
    pub fn starts(&self) -> bool {
        matches!(self, Self::Start(_) | Self::Learn { .. } | Self::Commission(..))
    }

    /// Whether only the commander may make the request. Anybody may stop the drive; the console may also clear a fault, and make all
    /// requests that need the drive off.
    pub fn is_for_the_commander(&self, from: Commander) -> bool {
        if from != Commander::Console {
            return !matches!(self, Self::Stop(_));
        }
        let moves = matches!(
            self,
            Self::Relock
                | Self::Torque(_)
                | Self::Speed(_)
                | Self::Jog(_)
                | Self::Position(_)
                | Self::Home(_)
        );
        self.starts() || moves
    }
}

/// A request was carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// As requested.
    Done,
    /// With this set-point instead of the requested one, and its unit.
    Limited(f32, &'static str),
    /// The request waits until the answer has been sent, because controllers are designed for seconds. The final answer follows.
    Designing,
    /// The drive starts with a check of the wiring.
    WiringFirst,
    /// The commissioning is going to turn the shaft.
    ShaftTurns,
    /// Values are staged.
    Staged,
    /// The staged values equal those in force.
    AsInForce,
    /// Staged; this setting takes effect at the next reset, if saved.
    StagedForReset(Key),
    /// Staged; the board has to be confirmed again.
    Unconfirmed,
    /// Staged; restored learned values belong to other settings and are dropped.
    RestoredDropped,
    /// Nothing was staged.
    NothingStaged,
    /// This number of staged values is dropped.
    Dropped(usize),
    /// In force, with these remarks.
    Applied(Applied),
    /// The board is confirmed, with the boot pin in use.
    BootPin,
    /// The chip is about to be reset.
    Rebooting,
    /// The chip is about to be reset into ST's loader.
    Loader,
}

/// Reason why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Refusal {
    /// The drive refuses it, or does not answer.
    Command(#[from] CommandError),
    /// The drive is not off.
    MustBeOff,
    /// Another side commands.
    Authority(Commander),
    /// The controllers cannot be designed for the staged settings.
    Design(SettingsError),
    /// A value was not staged.
    Set(#[from] SetError),
    /// The settings were not saved.
    Flash(#[from] FlashError),
    /// Settings of another board.
    WrongBoard {
        /// The board of the lines; `None` if this firmware does not know it.
        theirs: Option<&'static str>,
        /// This board.
        own: &'static str,
    },
    /// The settings in the flash are of another board.
    SavedOn {
        /// The board of the settings.
        theirs: &'static str,
        /// The board of the image.
        own: &'static str,
    },
    /// This number of lines of a backup was refused.
    LeftOut(u16),
    /// The board is not confirmed.
    NotConfirmed,
    /// Values are staged.
    Staged,
    /// The commissioning has found nothing new.
    NothingFound,
    /// There are no learned values to add to.
    NothingLearned,
    /// A number of a homing is out of range.
    Homing(#[from] OutOfRange),
    /// Changes would be lost.
    Unsaved,
    /// The dc link, V, is charged.
    Charged(f32),
    /// The bus tries to set a setting of the hardware.
    Hardware(Key),
    /// The bus commands a run that needs a stop before it: after a stop from elsewhere, or by the states of CiA 402.
    Ended,
    /// A module does not let the drive run.
    Held(&'static str),
    /// A stop came before the controllers for a start were designed.
    Stopped,
    /// A fault of the power stage is not cleared for this number of seconds.
    TooOften(u32),
    /// The reference of a module was lost.
    Reference(&'static str),
}

/// Highest dc link voltage with ST's loader, V.
pub const LOADER_DC_LINK_V: f32 = 20.0;
