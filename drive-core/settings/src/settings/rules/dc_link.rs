//! Rules for the voltages of the dc link.

use crate::settings::Settings;
use crate::settings::numbers::{HIGH_OF_TRIP, LOW_OF_TRIP, MARGIN};
use drive_core::blocks::Power;
use drive_core::{ChopperSettings, DcLimit, DcLinkSettings, PowerLimit, Relay, periods};

/// Highest trip voltage of the dc link, relative to the maximum operating voltage.
pub const OVER_OF_HIGHEST: f32 = 1.05;
/// Maximum operating voltage, relative to the highest nominal voltage. Generating torque is limited in a band between them.
pub const HIGHEST_OF_NOMINAL: f32 = 1.06;
/// Band in which generating torque is limited, relative to the distance from the nominal voltage. At speed the band is
/// 1.4 times as wide and still above the nominal voltage.
const BAND: f32 = 0.64;
/// Largest change of the voltage for which a dc link of 311 V counts as steady.
const STEADY_V: f32 = 5.0;

impl Settings {
    /// Returns the maximum operating voltage of the dc link, V.
    pub fn highest_dc_link_v(&self) -> f32 {
        self.scales.dc_link.at(self.scales.dc_link_highest)
    }

    /// Returns the largest nominal dc link, V.
    pub(in crate::settings) fn dc_link_max_v(&self) -> f32 {
        f32::min(self.highest_dc_link_v() / HIGHEST_OF_NOMINAL, 1000.0)
    }

    /// Returns the largest trip voltage of the dc link, V.
    pub(in crate::settings) fn dc_over_max_v(&self) -> f32 {
        f32::min(OVER_OF_HIGHEST * self.highest_dc_link_v(), self.dc_link_range_v())
    }

    /// Returns the range of `limits.dc_over_v`. It leaves room for `braking.high_v`, which follows from it or is set.
    pub(in crate::settings) fn dc_over_range(&self) -> (f32, f32) {
        let high = self.braking.high_v.map_or(HIGH_OF_TRIP, |_| 1.0);
        ((1.0 + MARGIN) / high * self.inverter.dc_link_v, self.dc_over_max_v())
    }

    /// Returns the range of `limits.dc_under_v`. It leaves room for `braking.low_v`, which follows from it or is set.
    pub(in crate::settings) fn dc_under_range(&self) -> (f32, f32) {
        let low = self.braking.low_v.map_or(LOW_OF_TRIP, |_| 1.0 + MARGIN);
        (5.0, f32::min((1.0 - MARGIN) / low * self.inverter.dc_link_v, self.dc_over_v()))
    }

    /// Returns the copper loss of the d-axis current, W.
    pub(in crate::settings) fn magnetising_w(&self) -> f32 {
        1.5 * self.motor.r_s * self.i_d() * self.i_d()
    }

    /// Returns the limits of dc current and power, if there are any.
    pub(crate) fn power_limit(&self) -> Option<PowerLimit> {
        let [motoring, generating] = self.dc_limits();
        let built = Power::IN_BUILD.filter(|_| self.limits_power())?;
        Some(PowerLimit { built, motoring, generating })
    }

    /// Whether dc current or power are limited.
    pub(in crate::settings) fn limits_power(&self) -> bool {
        self.dc_limits() != [DcLimit::NONE; 2]
    }

    /// Returns the limits motoring and generating.
    fn dc_limits(&self) -> [DcLimit; 2] {
        let s = &self.limits;
        [(s.dc_motoring_a, s.motoring_w), (s.dc_generating_a, s.generating_w)]
            .map(|(current_a, power_w)| DcLimit { current_a, power_w })
    }

    /// Returns the precharge relay, which opens at the trip voltage.
    pub(crate) fn relay(&self) -> Option<Relay> {
        let band_v = self.share_of_dc_link(STEADY_V);
        Relay::new(self.dc_under_v(), band_v, periods(self.supply.relay_s))
    }

    /// Returns the limits by the dc link. The chopper begins to conduct 3 % below the braking limit, and conducts
    /// all the time from 0.5 % below it.
    pub(crate) fn dc_link_limits(&self) -> DcLinkSettings {
        let (high_v, low_v) = (self.dc_high_v(), self.dc_low_v());
        let s = &self.braking;
        let band_v =
            f32::min(self.share_of_dc_link(50.0), BAND * (high_v - self.inverter.dc_link_v));
        DcLinkSettings {
            from_v: high_v - band_v,
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
