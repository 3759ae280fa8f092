//! The rules for the voltages of the dc link.

use super::or_rule;
use crate::dc_link::{ChopperSettings, DcLinkSettings};
use crate::io::{CONVERTER_CODES, periods};
use crate::settings::Settings;
use crate::supply::Relay;

/// Largest change of a dc link that counts as steady, with 311 V.
const STEADY_V: f32 = 5.0;

impl Settings {
    /// Dc link above which the drive trips, V.
    pub fn dc_over_v(&self) -> f32 {
        let rule = || f32::min(self.share_of_dc_link(400.0), 0.95 * self.dc_link_range_v());
        or_rule(self.limits.dc_over_v, rule)
    }

    /// Dc link below which the drive trips while the outputs are on, V.
    pub fn dc_under_v(&self) -> f32 {
        or_rule(self.limits.dc_under_v, || self.share_of_dc_link(200.0))
    }

    /// Dc link without generating torque, V.
    pub fn dc_high_v(&self) -> f32 {
        let rule = || f32::min(self.share_of_dc_link(390.0), 0.975 * self.dc_over_v());
        or_rule(self.braking.high_v, rule)
    }

    /// Dc link without motoring torque, V.
    pub fn dc_low_v(&self) -> f32 {
        let rule = || f32::max(self.share_of_dc_link(260.0), 1.15 * self.dc_under_v());
        or_rule(self.braking.low_v, rule)
    }

    /// Direct current that is added while generating torque is limited, A.
    pub fn braking_flux_a(&self) -> f32 {
        or_rule(self.braking.flux_a, || self.share_of_rated(1.0))
    }

    /// The precharge relay, which opens where the drive trips.
    pub(crate) fn relay(&self) -> Option<Relay> {
        let (least_v, band_v) = (self.dc_under_v(), self.share_of_dc_link(STEADY_V));
        let (line, time) = (self.scales.dc_link, periods(self.supply.relay_s));
        // The casts saturate.
        let least = (((least_v - line.offset) / line.gain) as u16).min(CONVERTER_CODES);
        (time > 0).then(|| Relay::new(least, (band_v / line.gain) as u16, time))
    }

    /// The limits by the dc link. The chopper conducts from 3 % below the voltage without generating torque on, and
    /// throughout from 0.5 % below.
    pub(crate) fn dc_link_limits(&self) -> DcLinkSettings {
        let (high_v, low_v) = (self.dc_high_v(), self.dc_low_v());
        let s = &self.braking;
        DcLinkSettings {
            from_v: high_v - self.share_of_dc_link(50.0),
            high_v,
            low_v,
            floor_v: 0.25 * low_v + 0.75 * self.dc_under_v(),
            flux_a: self.braking_flux_a(),
            chopper: (s.ohm > 0.0).then_some(ChopperSettings {
                on_v: 0.97 * high_v,
                full_v: 0.995 * high_v,
                resistance: s.ohm,
                energy_j: s.energy_j,
                power_w: s.power_w,
            }),
        }
    }
}
