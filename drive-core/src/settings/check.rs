//! Range check of every setting, and comparison of those that learned values depend on.

use super::list::SETTINGS;
use super::{Settings, SettingsError};

impl Settings {
    /// Checks every value against its range, the scales first: the rules of others follow from the sensors' range.
    ///
    /// # Errors
    /// [`SettingsError::Range`] with the first value outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let scales = SETTINGS.iter().filter(|entry| entry.name.starts_with("scales."));
        scales.chain(SETTINGS).try_for_each(|entry| entry.check(self))
    }

    /// Whether results learned with the settings `other` are valid for these settings, too.
    pub fn shares_learning_with(&self, other: &Self) -> bool {
        SETTINGS.iter().all(|entry| !entry.learned || entry.same(self, other))
    }
}
