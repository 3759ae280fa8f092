//! Staged settings: changes that are collected, and put in force together.

use drive_core::learned::Learned;
use drive_settings::entry::Change;
use drive_settings::value::Value;
use drive_settings::{Settings, SettingsError};
use heapless::Vec;
use thiserror::Error;

use super::keys::{self, Key};
use super::{Commander, FirmwareSettings};
use crate::board;

/// Most settings that are set at once.
pub const MOST: usize = 8;

/// Space for the protective settings.
const GUARDED: usize = 48;

/// Settings with their new values.
pub type Assignments = Vec<(Key, Value), MOST>;

/// Settings in force, and the staged copy of them, if there is one.
pub struct Staging {
    in_force: FirmwareSettings,
    staged: Option<Staged>,
    /// Whether the present or last self-commissioning adds to the values learned before.
    again: bool,
    /// Whether the drive has learned since it was given the settings in force, so that it may have other learned values.
    outdated: bool,
    /// Levels of the protective settings, as the console staged them last: no other source can loosen them further.
    bounds: Vec<f32, GUARDED>,
}

struct Staged {
    settings: FirmwareSettings,
    /// Whether `settings.learned` is staged, too. Otherwise the learned values in force stay as long as they are valid for the staged
    /// settings.
    learned: bool,
}

/// Reason why values were not staged.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SetError {
    /// The setting belongs to the board.
    Board(Key),
    /// A value out of range.
    Range(SettingsError),
    /// The first setting would loosen the second one, which is protective.
    Loosens(Key, Key),
}

/// Remarks for the user on settings that have been put in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Applied {
    /// The learned values were dropped, because they were learned with another value of this setting.
    pub forgotten: Option<&'static str>,
    /// Dead time or switching frequency of the timer change at the next reset.
    pub timer: bool,
    /// The analog watchdogs and the comparator follow at the next reset.
    pub protection: bool,
    /// The board is not confirmed with these values.
    pub unconfirmed: bool,
}

/// The protective settings.
pub fn guarded() -> impl Iterator<Item = Key> {
    keys::all().filter(|key| key.guards())
}

impl Staging {
    /// Staging with these settings in force and none staged.
    pub fn new(in_force: FirmwareSettings) -> Self {
        let mut new =
            Self { in_force, staged: None, again: false, outdated: false, bounds: Vec::new() };
        new.bound();
        new
    }

    /// Takes the protection of the latest settings as the loosest that other sources than the console may set.
    fn bound(&mut self) {
        self.bounds = guarded().map(|key| key.level(self.latest())).collect();
    }

    /// The settings in force.
    pub fn in_force(&self) -> &FirmwareSettings {
        &self.in_force
    }

    /// The staged settings; those in force if there are none.
    pub fn latest(&self) -> &FirmwareSettings {
        self.staged.as_ref().map_or(&self.in_force, |staged| &staged.settings)
    }

    /// Whether settings are staged.
    pub fn is_staged(&self) -> bool {
        self.staged.is_some()
    }

    /// Number of settings whose staged value differs from the one in force.
    pub fn count(&self) -> usize {
        keys::all().filter(|key| self.differs(*key)).count()
    }

    /// Whether the staged value of a setting differs from the one in force.
    pub fn differs(&self, key: Key) -> bool {
        key.get(self.latest()) != key.get(&self.in_force)
    }

    /// Stages values: all of them or none. Each must be in its range with the other staged values; the settings as a whole are checked
    /// when they are put in force. Other sources than the console must not loosen a protective setting, not even by its rule. Returns
    /// whether restored learned values are dropped, because they are valid only for the settings that they were restored with.
    ///
    /// # Errors
    /// The first value that is refused.
    pub fn set(&mut self, from: Commander, values: &Assignments) -> Result<bool, SetError> {
        if let Some((key, _)) = values.iter().find(|(key, _)| key.change() == Change::Board) {
            return Err(SetError::Board(*key));
        }
        let staged = Self::staged(&mut self.staged, &self.in_force);
        let mut before = Assignments::new();
        for (key, value) in values {
            // The list has enough space: it has the same size.
            let _ = before.push((*key, key.get(&staged.settings)));
            key.set(&mut staged.settings, *value);
        }
        let ranges = values.iter().try_for_each(|(key, _)| key.check(&staged.settings));
        let checked = ranges.map_err(SetError::Range).and_then(|()| {
            let mut guards = guarded().zip(&self.bounds);
            let loose = guards.find(|(key, bound)| !key.holds(&staged.settings, **bound));
            match (loose, values.first()) {
                (Some((guard, _)), Some((key, _))) if from != Commander::Console => {
                    let itself = values.iter().find(|(key, _)| *key == guard);
                    Err(SetError::Loosens(itself.map_or(*key, |(key, _)| *key), guard))
                }
                _ => Ok(()),
            }
        });
        let mut dropped = false;
        if checked.is_err() {
            // In reverse order, because a setting may be named twice.
            for (key, value) in before.iter().rev() {
                key.set(&mut staged.settings, *value);
            }
        } else if staged.learned && values.iter().any(|(key, _)| matches!(key, Key::Drive(_))) {
            dropped = staged.settings.learned.take().is_some();
        }
        self.drop_if_same();
        if from == Commander::Console {
            self.bound();
        }
        checked.map(|()| dropped)
    }

    /// Stages the settings of the image, without learned values.
    pub fn set_defaults(&mut self) {
        let staged = Self::staged(&mut self.staged, &self.in_force);
        let mut settings = FirmwareSettings::of(self.in_force.board);
        // These are properties of the hardware, not of the settings.
        settings.confirmed = self.in_force.confirmed;
        settings.boot_pin_counts = self.in_force.boot_pin_counts;
        *staged = Staged { settings, learned: true };
        self.drop_if_same();
        self.bound();
    }

    /// Stages the drive settings that the commissioning has found. They are checked when they are put in force.
    pub fn stage(&mut self, found: Settings) {
        let staged = Self::staged(&mut self.staged, &self.in_force);
        let confirmed = staged.settings.board_is_confirmed();
        staged.settings.drive = found;
        // The commissioning has measured its correction of the gains of two sensors against each other, about a per cent.
        if confirmed {
            staged.settings.confirm_board();
        }
        staged.settings.command.wiring_checked = true;
        self.drop_if_same();
        self.bound();
    }

    /// Stages the result of a self-commissioning with the staged settings.
    pub fn restore(&mut self, learned: Learned) {
        let staged = Self::staged(&mut self.staged, &self.in_force);
        (staged.settings.learned, staged.learned) = (Some(learned), true);
        self.drop_if_same();
    }

    /// Drops the staged settings.
    pub fn revert(&mut self) {
        self.staged = None;
        self.bound();
    }

    /// Whether the controllers have to be designed again, for the staged settings or because the drive has learned.
    pub fn needs_design(&self) -> bool {
        let differs = self.staged.as_ref().is_some_and(|Staged { settings, .. }| {
            settings.drive != self.in_force.drive || settings.learned != self.in_force.learned
        });
        differs || self.outdated
    }

    /// The settings to be put in force: the staged ones with the learned values that are valid for them, or those in force once the drive
    /// has learned; `None` if there is nothing to do.
    pub fn prepare(&mut self) -> Option<&mut FirmwareSettings> {
        let Some(Staged { settings, learned }) = &mut self.staged else {
            return self.outdated.then_some(&mut self.in_force);
        };
        if !*learned {
            let holds = settings.drive.learned_with_another(&self.in_force.drive).is_none();
            settings.learned = self.in_force.learned.filter(|_| holds);
        }
        Some(settings)
    }

    /// Takes the [prepared](Self::prepare) settings as those in force.
    pub fn adopt(&mut self) -> Applied {
        self.outdated = false;
        let Some(Staged { settings, .. }) = &self.staged else { return Applied::default() };
        let (old, new) = (&self.in_force.drive, &settings.drive);
        let applied = Applied {
            forgotten: self.in_force.learned.filter(|_| settings.learned.is_none()).map(|_| {
                // The defaults may differ in other settings only.
                new.learned_with_another(old).unwrap_or("set of settings")
            }),
            timer: board::Timer::of(&old.inverter) != board::Timer::of(&new.inverter),
            protection: board::protection(settings.board, old)
                != board::protection(settings.board, new),
            unconfirmed: self.in_force.board_is_confirmed() && !settings.board_is_confirmed(),
        };
        self.in_force = *settings;
        self.staged = None;
        applied
    }

    /// Begins a self-commissioning: `again` at another rotor position, adding to the learned values, or from scratch. If learned values
    /// must not act meanwhile, `configure` is to give the drive the settings without them.
    ///
    /// # Errors
    /// The error of `configure`.
    pub fn begin_learning<E>(
        &mut self,
        again: bool,
        configure: impl FnOnce(&mut FirmwareSettings) -> Result<(), E>,
    ) -> Result<(), E> {
        self.again = again;
        let Some(learned) = self.in_force.learned else { return Ok(()) };
        self.outdated = true;
        if again {
            return Ok(());
        }
        self.in_force.learned = None;
        let configured = configure(&mut self.in_force);
        self.in_force.learned = Some(learned);
        configured
    }

    /// Takes the result of the last self-commissioning, if it was accepted.
    pub fn learned(&mut self, result: &Learned) {
        let again = self.again;
        self.note(|settings| settings.learn(result, again));
    }

    /// Changes the settings in force and the staged ones alike: for values that the firmware itself determines.
    pub fn note(&mut self, change: impl Fn(&mut FirmwareSettings)) {
        change(&mut self.in_force);
        if let Some(staged) = &mut self.staged {
            change(&mut staged.settings);
        }
    }

    fn staged<'a>(staged: &'a mut Option<Staged>, in_force: &FirmwareSettings) -> &'a mut Staged {
        staged.get_or_insert_with(|| Staged { settings: *in_force, learned: false })
    }

    fn drop_if_same(&mut self) {
        if self.staged.as_ref().is_some_and(|staged| staged.settings == self.in_force) {
            self.staged = None;
        }
    }
}
