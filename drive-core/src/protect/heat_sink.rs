//! Checks of the temperature of the heat sink.

use crate::Fault;

/// Checks of the heat sink, in codes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatSink {
    /// Smallest and largest code that does not trip.
    pub window: (u16, u16),
    /// Whether the code falls with the temperature.
    pub hot_is_low: bool,
    /// Code of a heat sink that is hotter than believable.
    pub shorted: u16,
    /// Code at which no current is left.
    pub hot: f32,
    /// Share of the current per code; positive where the code rises with the temperature.
    pub per_code: f32,
}

impl HeatSink {
    /// The fault of a code outside the window.
    pub fn fault(&self, code: u16) -> Fault {
        let (cold, shorted) = if self.hot_is_low {
            (code > self.window.1, code <= self.shorted)
        } else {
            (code < self.window.0, code >= self.shorted)
        };
        match (cold, shorted) {
            (true, _) => Fault::ThermistorOpen,
            (_, true) => Fault::ThermistorShorted,
            _ => Fault::OverTemperature,
        }
    }

    /// Share of the current that is left at a code; 1 or more for all of it, 0 or less for none. It falls straight with the code from where it begins to the
    /// temperature that trips, which is within 0.06 of straight with the temperature.
    pub fn share(&self, code: u16) -> f32 {
        (self.hot - f32::from(code)) * self.per_code
    }
}
