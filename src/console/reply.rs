//! Replies: settings, the text of a fault, and the result of a self-commissioning.

use core::fmt;

use drive_core::Fault;
use drive_core::learned::{Fitted, Learned};
use drive_settings::Settings;
use drive_settings::entry::Change;
use drive_settings::value::Value;

use crate::settings::FirmwareSettings;
use crate::settings::keys::Key;
use crate::settings::staging::Staging;

/// A setting with its unit and the allowed values. They are computed before anything is printed, because both the printing and the range
/// need much stack.
pub struct Setting {
    key: Key,
    value: Value,
    number: Option<f32>,
    range: Option<(f32, f32)>,
    /// The value in force, if another is staged.
    in_force: Option<Value>,
}

impl Setting {
    /// The setting of this key.
    pub fn new(key: Key, settings: &Staging) -> Self {
        let latest = settings.latest();
        Self {
            key,
            value: key.get(latest),
            number: key.number(latest),
            range: key.range(latest),
            in_force: settings.differs(key).then(|| key.get(settings.in_force())),
        }
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.key.name(), self.value)?;
        if let (Value::Auto, Some(number)) = (self.value, self.number) {
            write!(f, ": {number}")?;
        }
        if !self.key.unit().is_empty() {
            write!(f, " {}", self.key.unit())?;
        }
        match (self.value, self.range) {
            (Value::Word(_), _) => {
                f.write_str(" (one of:")?;
                self.key.words().iter().try_for_each(|word| write!(f, " {word}"))?;
                f.write_str(")")?;
            }
            (_, Some((min, max))) => write!(f, " ({min} to {max})")?,
            (_, None) => {}
        }
        self.in_force.map_or(Ok(()), |value| write!(f, "; staged, in force: {value}"))
    }
}

/// A setting as a JSON object.
pub struct Description {
    setting: Setting,
    default: Value,
}

impl Description {
    /// The setting of this key.
    pub fn new(key: Key, settings: &Staging) -> Self {
        let default = key.get(&FirmwareSettings::of_the_board());
        Self { setting: Setting::new(key, settings), default }
    }
}

/// A value in JSON.
fn json(f: &mut fmt::Formatter<'_>, value: Value) -> fmt::Result {
    match value {
        Value::Number(_) | Value::Whole(_) => write!(f, "{value}"),
        Value::Auto | Value::Word(_) => write!(f, "\"{value}\""),
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Setting { key, value, number, range, in_force } = &self.setting;
        let kind = match self.default {
            Value::Word(_) => "word",
            Value::Whole(_) => "whole",
            Value::Number(_) | Value::Auto => "number",
        };
        let change = match key.change() {
            Change::WhileOff => "off",
            Change::FromReset => "reset",
            Change::Board => "board",
        };
        write!(f, "{{\"name\":\"{}\",\"number\":{}", key.name(), key.id())?;
        write!(f, ",\"unit\":\"{}\"", key.unit())?;
        write!(f, ",\"type\":\"{kind}\",\"auto\":{}", key.has_rule())?;
        match range {
            Some((min, max)) => write!(f, ",\"min\":{min},\"max\":{max}")?,
            None => f.write_str(",\"min\":null,\"max\":null")?,
        }
        f.write_str(",\"words\":[")?;
        for (i, word) in key.words().iter().enumerate() {
            write!(f, "{}\"{word}\"", if i > 0 { "," } else { "" })?;
        }
        f.write_str("],\"value\":")?;
        json(f, *value)?;
        f.write_str(",\"effective\":")?;
        json(f, number.map_or(*value, Value::Number))?;
        f.write_str(",\"default\":")?;
        json(f, self.default)?;
        write!(f, ",\"change\":\"{change}\",\"learned\":{}", key.learned())?;
        write!(f, ",\"staged\":{},\"help\":\"{}\"}}", in_force.is_some(), key.help())
    }
}

/// Line number `i` of the text of a fault, after its first line: the causes, the likely ones first, and the cure.
pub fn fault(fault: Fault, i: usize) -> Option<impl fmt::Display> {
    let causes = fault.causes();
    (i <= causes.len()).then_some(fmt::from_fn(move |f| match causes.get(i) {
        Some(cause) => write!(f, "cause {}: {cause}", i + 1),
        None => write!(f, "cure: {}", fault.cure()),
    }))
}

/// Line number `i` of the result of a self-commissioning; `None` after the last line. The fitted values come first, then the torque
/// ripple, then a table of saliency offset, saliency sensitivity and injection current over the q-axis current.
pub fn learned(
    result: &Learned,
    believable: bool,
    drive: &Settings,
    i: u16,
) -> Option<impl fmt::Display> {
    let lines = 3 + result.reference.points().len().min(result.points + 1);
    let line = usize::from(i);
    (line < lines).then_some(fmt::from_fn(move |f| match line {
        0 => {
            f.write_str(if believable { "" } else { "not used: " })?;
            write!(f, "{result}; spread {:.5}; ", result.spread)?;
            write!(
                f,
                "rotor positions {}; asymmetry {:.5}; ",
                result.positions,
                result.asymmetry.size()
            )?;
            fitted(f, "gain mismatch", &result.gain_mismatch)?;
            fitted(f, "current saliency", &result.current_saliency)?;
            write!(f, "flux saliency {:.5}", result.flux_saliency)
        }
        1 => write!(f, "{}", ripple(drive, result)),
        2 => f.write_str("i_q,reference,slope,carrier"),
        _ => point(f, result, line - 3),
    }))
}

/// The torque ripple of the injection with a learned result.
pub fn ripple(drive: &Settings, result: &Learned) -> impl fmt::Display {
    let nm = drive.injection_nm(&result.reference);
    let pct = 100.0 * nm / drive.nameplate.torque_nm();
    fmt::from_fn(move |f| write!(f, "torque ripple {nm:.3} Nm ({pct:.1} % of rated, at 600 Hz)"))
}

/// Writes a fitted value under its name.
fn fitted(f: &mut fmt::Formatter<'_>, name: &str, fitted: &Fitted) -> fmt::Result {
    let unused = if fitted.accepted { "" } else { ", not used" };
    write!(f, "{name} {:.5} (misfit {:.5}{unused}); ", fitted.value, fitted.misfit)
}

/// Writes a row of the table.
fn point(f: &mut fmt::Formatter<'_>, result: &Learned, index: usize) -> fmt::Result {
    let reference = result.reference.points()[index];
    write!(f, "{:.2},{reference:.5}", result.reference.grid().current(index))?;
    // If a table was not learned, the field is empty and the setting applies.
    let tables =
        [result.slope.map(|table| *table.points()), result.carrier.map(|table| *table.points())];
    for table in tables {
        match table {
            Some(points) => write!(f, ",{:.5}", points[index])?,
            None => f.write_str(",")?,
        }
    }
    Ok(())
}
