//! The dc link: stiff, with a ripple, or a capacitor behind a rectifier.

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use crate::Plant;
use crate::error::PlantError;
use crate::settings::{or_zero, settings};

/// The chopper switches off at this fraction of its switch-on voltage.
const CHOPPER_OFF: f64 = 0.98;
/// Range of the link, V.
const RANGE: std::ops::RangeInclusive<f64> = 0.0..=1000.0;

settings! {
    /// Settings of the dc link.
    DcLinkSettings "dc_link." |s| {
        /// Relative amplitude of a sine ripple on a stiff link.
        ripple: f64 = 0.0, 0.0..=0.5, "";
        /// Frequency of that ripple, Hz.
        ripple_hz: f64 = 100.0, 0.1..=3000.0, "Hz";
        /// Capacitor behind a rectifier, F; 0 is a stiff link.
        capacitor: f64 = 0.0, or_zero(s.capacitor, 1e-6..=0.1), "F";
        /// Pulses of the rectifier per mains period: 2 (one phase), 6 (three phases), or 0 for a supply without ripple.
        pulses: u32 = 6, if s.pulses == 2 { 2.0..=2.0 } else { or_zero(s.pulses.into(), 6.0..=6.0) }, "(or 0, 2)";
        /// Frequency of the mains, Hz.
        mains_hz: f64 = 50.0, 1.0..=1000.0, "Hz";
        /// Resistance of mains and rectifier, ohm.
        source: f64 = 1.0, 0.01..=1000.0, "ohm";
        /// Further resistance while the precharge relay is open, ohm; 0 for no relay.
        precharge: f64 = 0.0, 0.0..=1e5, "ohm";
        /// Start and duration of a mains outage, s; a duration of 0 means no outage.
        outage_at: f64 = 0.0, 0.0..=1e6, "s";
        /// See `outage_at`.
        outage: f64 = 0.0, 0.0..=1e6, "s";
        /// Start and duration of a sag of the mains, s; a duration of 0 means no sag.
        sag_at: f64 = 0.0, 0.0..=1e6, "s";
        /// See `sag_at`.
        sag: f64 = 0.0, 0.0..=1e6, "s";
        /// Peak of the rectified mains during the sag, V.
        sag_v: f64 = 0.0, RANGE, "V";
        /// Time in which the mains voltage falls to the sag, and returns, s; within the duration of the sag.
        sag_ramp: f64 = 0.01, 1e-4..=1e6, "s";
        /// Power that other devices take from the link, W.
        load: f64 = 0.0, 0.0..=1e6, "W";
        /// Voltage at which the brake chopper switches on by itself, V; 0 if only the drive commands it.
        chopper_v: f64 = 0.0, RANGE, "V";
        /// Resistor of the chopper, ohm.
        chopper: f64 = 100.0, 0.1..=1e6, "ohm";
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
    pub settings: DcLinkSettings,
    pub nominal: f64,
    /// Duty cycle that the drive commands for the chopper.
    pub duty: f64,
    /// Whether the precharge relay is closed.
    pub relay: bool,
    time: f64,
    braking: bool,
}

impl DcLink {
    pub(crate) fn new(s: &DcLinkSettings, nominal: f64) -> Result<Self, PlantError> {
        s.check()?;
        Ok(Self { settings: *s, nominal, duty: 0.0, relay: false, time: 0.0, braking: false })
    }

    /// Returns the voltage, V, after `h` seconds from `v`, in which the inverter takes the energy `taken`, J. The
    /// rectifier is integrated implicitly, so that stiff mains are allowed.
    pub(crate) fn after(&mut self, v: f64, taken: f64, h: f64) -> f64 {
        let s = &self.settings;
        self.time += h;
        if s.capacitor == 0.0 {
            return self.nominal * (1.0 + s.ripple * (TAU * s.ripple_hz * self.time).cos());
        }
        self.braking =
            s.chopper_v > 0.0 && v > s.chopper_v * if self.braking { CHOPPER_OFF } else { 1.0 };
        let duty = if self.braking { 1.0 } else { self.duty };
        // Other devices stop when the voltage is zero.
        let taken = taken + h * (duty * v * v / s.chopper + if v > 0.0 { s.load } else { 0.0 });
        // The balance is of the capacitor's energy, not of its charge, because this is exact for a constant power.
        let alone = (v * v - 2.0 * taken / s.capacitor).max(0.0).sqrt();
        let mains = self.mains();
        let source = s.source + if self.relay { 0.0 } else { s.precharge };
        let weight = h / (source * s.capacitor);
        let charged = if mains > alone { (alone + weight * mains) / (1.0 + weight) } else { alone };
        charged.clamp(*RANGE.start(), *RANGE.end())
    }

    /// Rectified mains voltage, V.
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
        // Time is never negative.
        let pulses = TAU * s.mains_hz * self.time / sector + 0.5;
        self.peak() * (sector * (pulses.fract() - 0.5)).cos()
    }

    /// Peak of the rectified mains, V.
    fn peak(&self) -> f64 {
        let s = &self.settings;
        let since = self.time - s.sag_at;
        let there = since.min(s.sag - since) / s.sag_ramp;
        self.nominal + (s.sag_v - self.nominal) * there.clamp(0.0, 1.0)
    }
}

impl Plant {
    /// Connects another rectifier and capacitor; the link keeps its voltage.
    ///
    /// # Errors
    /// [`PlantError`] with the setting that is refused.
    pub fn set_supply(&mut self, settings: &DcLinkSettings) -> Result<(), PlantError> {
        settings.check()?;
        self.dc_link.settings = *settings;
        self.moves |= settings.moves();
        Ok(())
    }

    /// Changes only the peak of the rectified mains, V; a capacitor behind the rectifier keeps its voltage. Without a
    /// capacitor it does the same as [`Self::set_dc_link`].
    ///
    /// # Errors
    /// [`PlantError`] outside 0 to 1000 V.
    pub fn set_mains(&mut self, peak: f64) -> Result<(), PlantError> {
        let held = self.dc_link();
        self.set_dc_link(peak)?;
        if self.dc_link.settings.moves() { self.around.inverter.set_dc_link(held) } else { Ok(()) }
    }

    /// Sets the duty cycle of the brake chopper, clamped to 0 to 1.
    pub fn set_chopper(&mut self, duty: f64) {
        self.dc_link.duty = duty.clamp(0.0, 1.0);
    }

    /// Closes or opens the precharge relay.
    pub fn set_relay(&mut self, closed: bool) {
        self.dc_link.relay = closed;
    }
}
