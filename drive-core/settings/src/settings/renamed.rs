//! Old names of settings. They stay accepted where a setting is named: at the console, in files, in backups and in records that name it.

/// Names that have changed: the present one and the old one.
pub const RENAMED: [(&str, &str); 5] = [
    ("inverter.switching_khz", "inverter.carrier_khz"),
    ("injection.allowed_deficit", "injection.allowed_loss"),
    ("injection.deficit_s", "injection.loss_s"),
    ("sequence.flying_start", "sequence.catch"),
    ("flux.minimise_loss", "flux.economy"),
];

/// Returns the old name of the setting with this name; the name itself if it never had another one.
pub fn old_name(name: &'static str) -> &'static str {
    RENAMED.iter().find(|(now, _)| *now == name).map_or(name, |(_, old)| old)
}
