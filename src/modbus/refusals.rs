//! The numbers of refusals in the register of the bus.

use drive_core::Refused;

use crate::desk::handle::CommandError;
use crate::desk::order::Refusal;
use crate::settings::staging::SetError;

impl Refusal {
    /// Number of the refusal in the register of the bus, and its meaning there. A number keeps its meaning.
    pub fn code(&self) -> u16 {
        match self {
            Self::Authority(_) => 1,
            Self::MustBeOff => 2,
            Self::NotConfirmed | Self::SavedOn { .. } => 3,
            Self::NothingLearned | Self::Command(CommandError::Refused(Refused::NotLearned)) => 4,
            Self::Command(CommandError::Refused(Refused::Fault(_))) => 5,
            Self::Set(SetError::Loosens(..)) => 17,
            Self::Set(_) | Self::Design(_) => 6,
            Self::Hardware(_) => 7,
            Self::Flash(_) => 8,
            Self::Ended => 9,
            Self::Command(CommandError::NoAnswer | CommandError::NotStarted(_)) => 10,
            Self::Command(CommandError::Refused(_)) => 11,
            Self::Held(_) => 13,
            Self::Reference(_) => 14,
            Self::Stopped => 15,
            Self::TooOften(_) => 16,
            _ => 12,
        }
    }
}
