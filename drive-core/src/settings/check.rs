//! Range check of every setting, and comparison of those that learned values depend on.

use super::list::SETTINGS;
use super::{Settings, SettingsError};

impl Settings {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`SettingsError::Range`] with the first value outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        SETTINGS.iter().try_for_each(|entry| entry.check(self))
    }

    /// Whether results learned with the settings `other` are valid for these settings, too.
    pub fn shares_learning_with(&self, other: &Self) -> bool {
        SETTINGS.iter().all(|entry| !entry.learned || entry.same(self, other))
    }
}
