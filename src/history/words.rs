//! The history in words.

use core::fmt;

use drive_core::Fault;

use super::{CHANGED, History};
use crate::settings::keys::{self, Key};

/// The warning about the ripple of the dc link.
pub const RIPPLE: &str =
    "ripple of the dc link above 15 %: aged capacitor, or a mains phase missing";

/// Line number `i` of the history: the totals, then the faults, the latest first.
pub fn line(history: &History, i: usize) -> Option<impl fmt::Display> {
    let fault = i.checked_sub(1).map(|i| history.faults().nth(i));
    // There is no line after the last fault.
    (fault != Some(None)).then_some(fmt::from_fn(move |f| {
        let hours = |s: u32| s as f32 / 3600.0;
        let Some(fault) = fault.flatten() else {
            let (powered, running) = (hours(history.powered_s), hours(history.running_s));
            let starts = history.starts;
            write!(f, "powered {powered:.1} h, with current {running:.1} h, starts {starts}")?;
            let (corrected, ripples) = (history.corrected, history.ripples);
            if corrected > 0 {
                write!(f, "; errors of the flash corrected since the reset: {corrected}")?;
            }
            return if ripples > 0 { write!(f, "; {RIPPLE}: {ripples} times") } else { Ok(()) };
        };
        let (code, at) = (fault.code, hours(60 * fault.powered_min));
        if code == CHANGED {
            let key = u16::try_from(fault.running_s).ok().and_then(keys::find_id);
            let name = key.map_or("a setting", Key::name);
            return write!(f, "at {at:.1} h: the protective setting {name} was changed");
        }
        write!(f, "at {at:.1} h, with current {:.1} h: fault {code}", hours(fault.running_s))?;
        let known = Fault::ALL.iter().find(|known| known.code() == code);
        known.map_or(Ok(()), |known| write!(f, ", {known}"))
    }))
}
