//! The inverter, averaged over a PWM period.
//!
//! A leg is high for the fraction `c/top` of the period. Two errors reduce the magnitude of its mean voltage, both
//! against the direction of the current. One is the dead time (section 3.9): while both switches are off, the current
//! holds the leg at the rail from which it flows. The other is the residual voltage drop of the switches. The direction
//! is the sign of the actual phase current, smoothed linearly over ±20 mA by default and evaluated at every stage of
//! the integration. A leg that does not switch has no dead-time error.
//!
//! The propagation delay shifts the pulses within the period. Averaged, a fraction delay/T of this period's voltage is
//! replaced by the previous period's voltage, spread over the whole period. To first order in delay/T (1.3 %) this is
//! the same delay.

use drive_core::Compare;

use crate::averaged::{Averaged, SmoothSign};
use crate::complex::{Complex, clarke, phases, square};
use crate::error::{PlantError, check};
use crate::settings::settings;

settings! {
    /// Settings of the inverter.
    InverterSettings "inverter." |s| {
        /// Dc-link voltage, V.
        vdc: f64 = 311.0;
        /// Compare value at which the high side is on for the whole period, with one pulse. The default is 170 MHz / (2 * 6 kHz).
        timer_top: u16 = 14_167, 100.0..=65_535.0, "";
        /// Number of equal pulses of each leg in a period; the compare value gives the width of one pulse.
        pulses: u16 = 1, 1.0..=10.0, "";
        /// Time in which both switches of a leg are off at every edge, us (section 3.9).
        dead_time_us: f64 = 2.2;
        /// Time from the command to the first switching, us (section 3.9).
        propagation_us: f64 = 2.2, 0.0..=10.0, "us";
        /// Voltage drop of the switches against the current, V. Assumed: 40 % of the dead-time error.
        residual_v: f64 = 1.64, 0.0..=20.0, "V";
        /// Further dead time that the drive does not know, us; if negative, the dead time is shorter than the drive assumes.
        extra_dead_time_us: f64 = 0.0, -s.dead_time_us..=10.0, "us";
        /// Capacitance of the output node of each leg, F. During the dead time the current has to charge it, so the
        /// dead-time error of a small current is smaller. Averaged inverter only.
        node_capacitance: f64 = 0.0, 0.0..=if s.switched { 0.0 } else { 1e-6 }, "F";
        /// Current below which the smoothed sign of a phase current is proportional to that current, A.
        smoothing_a: f64 = 0.020, 1e-5..=100.0, "A";
        /// Resistance of a conducting switch, ohm.
        on_resistance: f64 = 0.0, 0.0..=100.0, "ohm";
        /// Further resistance of the line and the winding of each phase, ohm. Averaged inverter only.
        more_ohm: [f64; 3] = [0.0; 3];
        /// Further dead time of each leg, us. Averaged inverter only.
        more_dead_time_us: [f64; 3] = [0.0; 3];
        /// Whether the integration runs between the exact instants of the edges, instead of over averages.
        switched: bool = false;
    }
}

impl InverterSettings {
    /// No dead time, no delay, no voltage drop.
    pub const IDEAL: Self =
        Self { dead_time_us: 0.0, propagation_us: 0.0, residual_v: 0.0, ..Self::DEFAULT };
}

/// The inverter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverter {
    /// Settings; dc-link voltage and dead time act as the fields below have them.
    pub(crate) settings: InverterSettings,
    /// Dc-link voltage, V.
    pub(crate) vdc: f64,
    pub(crate) top: f64,
    /// Dead time, s.
    pub(crate) dead_time: f64,
    pub(crate) sign: SmoothSign,
    /// Compare values of the previous period.
    pub(crate) previous: Compare,
}

impl Inverter {
    /// Makes the inverter with these settings, off.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(s: &InverterSettings) -> Result<Self, PlantError> {
        s.check()?;
        let most = if s.switched { 0.0 } else { 10.0 };
        for more in [s.more_ohm, s.more_dead_time_us].as_flattened() {
            check("inverter.more_ohm, inverter.more_dead_time_us", *more, -most..=most, "")?;
        }
        let mut inverter = Self {
            settings: *s,
            vdc: 0.0,
            top: 0.0,
            dead_time: 0.0,
            sign: SmoothSign::new(s.smoothing_a),
            previous: Compare::OFF,
        };
        inverter.set_dc_link(s.vdc)?;
        inverter.set_dead_time(s.dead_time_us)?;
        inverter.set_pulses(s.pulses);
        Ok(inverter)
    }

    /// Changes the number of pulses in a period.
    pub fn set_pulses(&mut self, pulses: u16) {
        self.settings.pulses = pulses.max(1);
        self.top = f64::from(self.settings.timer_top / self.settings.pulses);
    }

    /// Changes the dc-link voltage, V.
    ///
    /// # Errors
    /// [`PlantError`] outside 0 to 1000 V.
    pub fn set_dc_link(&mut self, vdc: f64) -> Result<(), PlantError> {
        check("inverter.vdc", vdc, 0.0..=1000.0, "V")?;
        self.vdc = vdc;
        Ok(())
    }

    /// Changes the dead time, us; the extra dead time is added to it.
    ///
    /// # Errors
    /// [`PlantError`] outside 0 to 10 us.
    pub fn set_dead_time(&mut self, us: f64) -> Result<(), PlantError> {
        check("inverter.dead_time_us", us, 0.0..=10.0, "us")?;
        self.dead_time = (us + self.settings.extra_dead_time_us) * 1e-6;
        Ok(())
    }

    /// Power that the switches dissipate at this current, W. It is zero while the outputs are off, because the diodes
    /// are ideal. The dead time costs voltage but no energy.
    pub(crate) fn conduction_loss(&self, i: Complex) -> f64 {
        if !self.previous.enabled {
            return 0.0;
        }
        let magnitudes: f64 = phases(i).iter().map(|i| i.abs()).sum();
        self.settings.residual_v * magnitudes + 1.5 * self.settings.on_resistance * square(i)
    }

    /// Fraction of the period for which each leg is commanded high.
    fn duties(&self, compare: &Compare) -> [f64; 3] {
        let inverse = 1.0 / self.top;
        [compare.a, compare.b, compare.c].map(|c| (f64::from(c) * inverse).min(1.0))
    }

    /// Computes the averages of a period of `period` seconds with these compare values, outputs on.
    pub(crate) fn averaged(&self, compare: &Compare, period: f64) -> Averaged {
        let (s, duties) = (&self.settings, self.duties(compare));
        let mut v = clarke(duties);
        if self.previous.enabled {
            let blend = s.propagation_us * 1e-6 / period;
            v += (clarke(self.duties(&self.previous)) - v) * blend;
        }
        let pulses = f64::from(s.pulses);
        // A pulse shorter than the dead time vanishes, so the dead time cannot take more than the pulse.
        let taken = |leg: usize, available: f64| {
            let dead = (self.dead_time + s.more_dead_time_us[leg] * 1e-6) * pulses / period;
            let switches = duties[leg] > 0.0 && duties[leg] < 1.0;
            if switches { self.vdc * dead.max(0.0).min(available) } else { 0.0 }
        };
        let charge = s.node_capacitance * self.vdc;
        Averaged {
            inverse_knee: if charge > 0.0 { self.dead_time.max(1e-9) / charge } else { 0.0 },
            residual: s.residual_v,
            sign: self.sign,
            on_resistance: s.on_resistance,
            resistances: s.more_ohm,
            v: v * self.vdc,
            lost: std::array::from_fn(|k| taken(k, duties[k]) + s.residual_v),
            gained: std::array::from_fn(|k| taken(k, 1.0 - duties[k]) + s.residual_v),
        }
    }
}
