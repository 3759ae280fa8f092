//! Replies: the status line, settings, and the result of a learning.

use core::fmt;

use drive_core::identify::learning::{Fitted, Learned};
use drive_core::io::PERIOD_S;
use drive_core::settings::Scales;
use drive_core::settings::value::Value;

use crate::board::CYCLES_PER_US;
use crate::link::Status;
use crate::settings::FirmwareSettings;
use crate::settings::keys::Key;

/// Writes the status line: `stack` is the most bytes used and the size.
///
/// # Errors
/// Those of the formatter.
pub fn status(
    f: &mut fmt::Formatter<'_>,
    s: &Status,
    scales: &Scales,
    (used, size): (usize, usize),
) -> fmt::Result {
    let t = &s.telemetry;
    let rpm = t.rotor_freq * (60.0 / PERIOD_S);
    // Dc link and heat sink from the sample: the drive's own values stand still while it is off.
    let dc_link = scales.dc_link.at(s.sample.dc_link);
    let latency_us = s.worst_latency as f32 / CYCLES_PER_US as f32;
    write!(f, "{}; i_d {:.2} A, i_q {:.2} of ", s.state, t.current.d, t.current.q)?;
    write!(f, "{:.2} A, rotor {rpm:.1} rpm electrical, dc link {dc_link:.0} V, ", t.reference.q)?;
    write!(f, "heat sink {:.0} degC; ", scales.ntc.celsius(s.sample.heat_sink))?;
    write!(f, "{} of {} cycles, latest start {latency_us:.1} us, ", s.last_cycles, s.worst_cycles)?;
    write!(f, "stack {used} of {size}")
}

/// A setting with its unit and the allowed values. They are computed before anything is printed, because printing
/// needs much stack and so does the range.
pub struct Setting {
    key: Key,
    value: Value,
    number: Option<f32>,
    range: Option<(f32, f32)>,
}

impl Setting {
    /// The setting of this key.
    pub fn new(key: Key, settings: &FirmwareSettings) -> Self {
        Self {
            key,
            value: key.get(settings),
            number: key.number(settings),
            range: key.range(settings),
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
                f.write_str(")")
            }
            (_, Some((min, max))) => write!(f, " ({min} to {max})"),
            (_, None) => Ok(()),
        }
    }
}

/// Line number `i` of the result of a learning; `None` behind the last line. The fitted values come first, then a table
/// of the reference and the carrier current over the torque current.
pub fn learned(result: &Learned, believable: bool, i: u16) -> Option<impl fmt::Display> {
    let lines = 2 + result.reference.points().len().min(result.points + 1);
    let line = usize::from(i);
    (line < lines).then_some(fmt::from_fn(move |f| match line {
        0 => {
            f.write_str(if believable { "" } else { "not believable, not used: " })?;
            write!(f, "asymmetry {:.5}; ", result.asymmetry)?;
            fitted(f, "gain mismatch", &result.gain_mismatch)?;
            fitted(f, "current saliency", &result.current_saliency)?;
            write!(f, "flux saliency {:.5}", result.flux_saliency)
        }
        1 => f.write_str("i_q,reference,carrier"),
        _ => point(f, result, line - 2),
    }))
}

/// Writes a fitted value under its name.
fn fitted(f: &mut fmt::Formatter<'_>, name: &str, fitted: &Fitted) -> fmt::Result {
    let unused = if fitted.accepted { "" } else { ", not used" };
    write!(f, "{name} {:.5} (misfit {:.5}{unused}); ", fitted.value, fitted.misfit)
}

/// Writes a row of the table.
fn point(f: &mut fmt::Formatter<'_>, result: &Learned, index: usize) -> fmt::Result {
    let reference = result.reference.points()[index];
    write!(f, "{:.2},{reference:.5},", result.reference.grid().current(index))?;
    match &result.carrier {
        Some(table) => write!(f, "{:.5}", table.points()[index]),
        // Not learned: the setting holds.
        None => Ok(()),
    }
}
