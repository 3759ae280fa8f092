//! The dc link: stiff, with a ripple, or a capacitor behind a rectifier.

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use serde::{Deserialize, Serialize};

use crate::Plant;
use crate::error::{PlantError, check};

/// The chopper goes off at this fraction of the voltage at which it goes on.
const CHOPPER_OFF: f64 = 0.98;
/// Range of the link, V.
const RANGE: std::ops::RangeInclusive<f64> = 0.0..=1000.0;

/// Settings of the dc link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DcLinkSettings {
    /// Relative amplitude of a sine ripple on a stiff link.
    pub ripple: f64,
    /// Its frequency, Hz.
    pub ripple_hz: f64,
    /// Capacitor behind a rectifier, F; 0 is a stiff link.
    pub capacitor: f64,
    /// Pulses of the rectifier per mains period: 2 (one phase), 6 (three phases), or 0 for a supply without ripple.
    pub pulses: u32,
    /// Frequency of the mains, Hz.
    pub mains_hz: f64,
    /// Resistance of mains and rectifier, ohm.
    pub source: f64,
    /// Resistance more while the precharge relay is open, ohm; 0 without a relay.
    pub precharge: f64,
    /// Start and duration of a mains outage, s; none with a duration of 0.
    pub outage_at: f64,
    /// See `outage_at`.
    pub outage: f64,
    /// Start and duration of a sag of the mains, s; none with a duration of 0.
    pub sag_at: f64,
    /// See `sag_at`.
    pub sag: f64,
    /// Peak of the rectified mains meanwhile, V.
    pub sag_v: f64,
    /// Time in which the sag comes, and goes, s; within its duration.
    pub sag_ramp: f64,
    /// Power that others take from the link, W.
    pub load: f64,
    /// Voltage at which the brake chopper goes on by itself, V; 0 for one that the drive alone commands.
    pub chopper_v: f64,
    /// Its resistor, ohm.
    pub chopper: f64,
}

impl Default for DcLinkSettings {
    fn default() -> Self {
        Self {
            ripple: 0.0,
            ripple_hz: 100.0,
            capacitor: 0.0,
            pulses: 6,
            mains_hz: 50.0,
            source: 1.0,
            precharge: 0.0,
            outage_at: 0.0,
            outage: 0.0,
            sag_at: 0.0,
            sag: 0.0,
            sag_v: 0.0,
            sag_ramp: 0.01,
            load: 0.0,
            chopper_v: 0.0,
            chopper: 100.0,
        }
    }
}

impl DcLinkSettings {
    /// Whether the voltage changes at all.
    pub(crate) fn moves(&self) -> bool {
        self.ripple != 0.0 || self.capacitor != 0.0
    }
}

/// The dc link. Its nominal voltage is the peak of the rectified mains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DcLink {
    settings: DcLinkSettings,
    pub nominal: f64,
    /// Duty that the drive gives the chopper.
    pub duty: f64,
    /// Whether the precharge relay is closed.
    pub relay: bool,
    time: f64,
    braking: bool,
}

impl DcLink {
    pub(crate) fn new(s: &DcLinkSettings, nominal: f64) -> Result<Self, PlantError> {
        check("dc_link.ripple", s.ripple, 0.0..=0.5, "")?;
        check("dc_link.ripple_hz", s.ripple_hz, 0.1..=3000.0, "Hz")?;
        if s.capacitor != 0.0 {
            check("dc_link.capacitor", s.capacitor, 1e-6..=0.1, "F")?;
        }
        if s.pulses != 0 && s.pulses != 2 {
            check("dc_link.pulses", f64::from(s.pulses), 6.0..=6.0, "(or 0, 2)")?;
        }
        check("dc_link.mains_hz", s.mains_hz, 1.0..=1000.0, "Hz")?;
        check("dc_link.source", s.source, 0.01..=1000.0, "ohm")?;
        check("dc_link.precharge", s.precharge, 0.0..=1e5, "ohm")?;
        check("dc_link.outage_at", s.outage_at, 0.0..=1e6, "s")?;
        check("dc_link.outage", s.outage, 0.0..=1e6, "s")?;
        check("dc_link.sag_at", s.sag_at, 0.0..=1e6, "s")?;
        check("dc_link.sag", s.sag, 0.0..=1e6, "s")?;
        check("dc_link.sag_v", s.sag_v, RANGE, "V")?;
        check("dc_link.sag_ramp", s.sag_ramp, 1e-4..=1e6, "s")?;
        check("dc_link.load", s.load, 0.0..=1e6, "W")?;
        check("dc_link.chopper_v", s.chopper_v, RANGE, "V")?;
        check("dc_link.chopper", s.chopper, 0.1..=1e6, "ohm")?;
        Ok(Self { settings: *s, nominal, duty: 0.0, relay: false, time: 0.0, braking: false })
    }

    /// Whether the voltage changes at all.
    pub(crate) fn moves(&self) -> bool {
        self.settings.moves()
    }

    /// Voltage after `h` seconds from `v`, V, in which the inverter takes the energy `taken`, J. The rectifier is
    /// integrated implicitly, so a stiff mains is allowed.
    pub(crate) fn after(&mut self, v: f64, taken: f64, h: f64) -> f64 {
        let s = &self.settings;
        self.time += h;
        if s.capacitor == 0.0 {
            return self.nominal * (1.0 + s.ripple * (TAU * s.ripple_hz * self.time).cos());
        }
        self.braking =
            s.chopper_v > 0.0 && v > s.chopper_v * if self.braking { CHOPPER_OFF } else { 1.0 };
        let duty = if self.braking { 1.0 } else { self.duty };
        // What others take stops with the voltage.
        let taken = taken + h * (duty * v * v / s.chopper + if v > 0.0 { s.load } else { 0.0 });
        // The energy of the capacitor is balanced, not its charge: exact for a constant power.
        let alone = (v * v - 2.0 * taken / s.capacitor).max(0.0).sqrt();
        let mains = self.mains();
        let source = s.source + if self.relay { 0.0 } else { s.precharge };
        let weight = h / (source * s.capacitor);
        let charged = if mains > alone { (alone + weight * mains) / (1.0 + weight) } else { alone };
        charged.clamp(*RANGE.start(), *RANGE.end())
    }

    /// Rectified mains, V.
    fn mains(&self) -> f64 {
        let s = &self.settings;
        let since = self.time - s.outage_at;
        if since >= 0.0 && since < s.outage {
            return 0.0;
        }
        if s.pulses == 0 {
            return self.peak();
        }
        let sector = if s.pulses == 2 { PI } else { FRAC_PI_3 };
        // Time is not negative.
        let pulses = TAU * s.mains_hz * self.time / sector + 0.5;
        self.peak() * (sector * (pulses.fract() - 0.5)).cos()
    }

    /// Its peak, V.
    fn peak(&self) -> f64 {
        let s = &self.settings;
        let since = self.time - s.sag_at;
        let there = since.min(s.sag - since) / s.sag_ramp;
        self.nominal + (s.sag_v - self.nominal) * there.clamp(0.0, 1.0)
    }
}

impl Plant {
    /// Changes the peak of the rectified mains alone, V, behind which a capacitor keeps its voltage; without one as
    /// [`Self::set_dc_link`].
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] outside 0 to 1000 V.
    pub fn set_mains(&mut self, peak: f64) -> Result<(), PlantError> {
        let held = self.dc_link();
        self.set_dc_link(peak)?;
        if self.dc_link.moves() { self.around.inverter.set_dc_link(held) } else { Ok(()) }
    }

    /// Sets the duty of the brake chopper, 0 to 1; what is beyond counts as the nearer end.
    pub fn set_chopper(&mut self, duty: f64) {
        self.dc_link.duty = duty.clamp(0.0, 1.0);
    }

    /// Closes or opens the precharge relay.
    pub fn set_relay(&mut self, closed: bool) {
        self.dc_link.relay = closed;
    }
}
