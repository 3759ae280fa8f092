//! Checks of the temperature of the heat sink.

use crate::Fault;

/// Checks of the heat sink, in ADC counts.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HeatSink {
    /// Smallest and largest ADC counts that do not trip.
    pub window: (u16, u16),
    /// Whether the ADC counts fall with the temperature.
    pub hot_is_low: bool,
    /// ADC counts of the hottest plausible heat sink.
    pub shorted: u16,
    /// ADC counts at which no current is left.
    pub hot: f32,
    /// Share of the current per ADC count; positive if the counts rise with the temperature.
    pub per_code: f32,
}

impl HeatSink {
    /// Returns the fault of ADC counts outside the window.
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

    /// Returns the share of the current that is left at these ADC counts; 1 or more for all of it, 0 or less for none. The share falls
    /// linearly with the counts from the beginning of the derating to the trip temperature, which is within 0.06 of a linear fall with the
    /// temperature.
    pub fn share(&self, code: u16) -> f32 {
        (self.hot - f32::from(code)) * self.per_code
    }
}
