//! Refusal of keys that an experiment does not use.

use crate::config::{assigned, file, keys_of};
use crate::prelude::*;

/// Checks that each key set by `--set` or `--seconds` is used by one of the experiments that `name` stands for. A
/// configuration file may describe more than one experiment needs. Its unused keys are only reported on standard error,
/// unless they do not change the configuration.
///
/// # Errors
/// [`Error::Refused`]; as [`assigned`], [`keys_of`] and [`file::read`].
pub fn check(name: &str, experiments: &[&Experiment], input: &Input) -> Result<(), Error> {
    let is_used = |key: &str| -> Result<bool, Error> {
        let keys = keys_of(key)?;
        Ok(experiments.iter().any(|experiment| keys.iter().any(|key| experiment.uses_key(*key))))
    };
    let mut names: Vec<&str> = Vec::new();
    for assignment in &input.assignments {
        names.push(assigned(assignment)?.0);
    }
    names.extend(input.seconds.map(|_| "seconds"));
    names.extend(input.plant.as_ref().map(|_| "plant"));
    for key in names {
        if !is_used(key)? {
            let uses = match experiments {
                [one] => one.uses_text(),
                _ => "see `list --json`".to_owned(),
            };
            let (name, key) = (cut(name), cut(key));
            return Err(Error::Refused(format!("{name} does not use `{key}`; it uses: {uses}")));
        }
    }
    let Some(path) = &input.config else { return Ok(()) };
    let mut config = Config::of_motor(input.motor.as_deref())?;
    let mut unused = Vec::new();
    for assignment in file::read(path)? {
        let before = config.clone();
        config.set(&assignment.name, assignment.value)?;
        if config != before && !is_used(&assignment.name)? {
            unused.push(assignment.name);
        }
    }
    if !unused.is_empty() && !input.quiet {
        let (unused, path) = (unused.join(", "), path.display());
        eprintln!("{}", message(format_args!("note: {name} does not use {unused} of {path}")));
    }
    Ok(())
}
