//! Duty cycles as the timer represents them.

use drive_core::Compare;
use motor_plant::InverterSettings;

pub const TOP: u16 = InverterSettings::IDEAL.timer_top;

/// Converts duty cycles to compare values.
pub fn duties([a, b, c]: [f64; 3]) -> Compare {
    let compare = |duty: f64| (duty * f64::from(TOP)).round().clamp(0.0, f64::from(TOP)) as u16;
    Compare { a: compare(a), b: compare(b), c: compare(c), enabled: true }
}
