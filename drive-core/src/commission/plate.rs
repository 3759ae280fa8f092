//! Step 1: what follows from the nameplate, and whether it is plausible.

use core::f32::consts::{SQRT_2, TAU};

use super::report::{Quantity, Refusal, Report, Step};
use crate::math::frames::SQRT_3;
use crate::settings::Settings;

/// Plausible share of the shaft's power in the apparent power: efficiency times power factor.
const POWER: (f32, f32) = (0.15, 0.95);
/// Plausible slip at rated speed.
const SLIP: (f32, f32) = (0.002, 0.15);
/// Largest share of the sensors' range that is used.
const OF_RANGE: f32 = 0.8;
/// Least share of the rated peak current that the sensors have to reach.
const LEAST_CURRENT: f32 = 0.3;

/// Safe currents and expected ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plate {
    /// Current of the tests, A peak: the rated one, or less where the sensors do not reach it.
    pub amperes: f32,
    /// Base impedance, ohm.
    pub z_b: f32,
    /// Base inductance, H.
    pub l_b: f32,
    /// Pairs of poles.
    pub pole_pairs: u8,
    /// Peak of the rated voltage between lines, V.
    pub peak_v: f32,
    /// Rated current, A peak, and rated flux, Wb peak.
    pub rated: f32,
    pub flux: f32,
}

impl Plate {
    pub fn new(settings: &Settings) -> Result<Self, Refusal> {
        let plate = &settings.nameplate;
        let checked = |name, unit, value: f32, min: f32, max: f32| {
            if value >= min && value <= max {
                Ok(())
            } else {
                Err(Refusal::Plate { name, unit, value, min, max })
            }
        };
        let apparent = SQRT_3 * plate.voltage_v * plate.current_a;
        let (least, most) = (POWER.0 * apparent, POWER.1 * apparent);
        checked("nameplate.power_w", "W", plate.power_w, least, most)?;
        let pairs = libm::roundf(60.0 * plate.frequency_hz / plate.speed_rpm);
        let pairs = if pairs >= 1.0 { pairs } else { 1.0 };
        let synchronous = 60.0 * plate.frequency_hz / pairs;
        let (least, most) = ((1.0 - SLIP.1) * synchronous, (1.0 - SLIP.0) * synchronous);
        checked("nameplate.speed_rpm", "rpm", plate.speed_rpm, least, most)?;
        let safe = OF_RANGE * settings.sensor_range_a();
        let most = safe / (LEAST_CURRENT * SQRT_2);
        checked("nameplate.current_a", "A", plate.current_a, 0.0, most)?;
        let rated = settings.rated_a();
        let z_b = plate.base_impedance();
        Ok(Self {
            amperes: rated.min(safe).min(settings.trip_a() / 1.15),
            z_b,
            l_b: z_b / (TAU * plate.frequency_hz),
            pole_pairs: pairs as u8,
            peak_v: SQRT_2 * plate.voltage_v,
            rated,
            flux: SQRT_2 / SQRT_3 * plate.voltage_v / (TAU * plate.frequency_hz),
        })
    }

    pub fn report(&self) -> Report {
        Report::new(
            Step::Nameplate,
            [
                Quantity::new("test current", "A", self.amperes),
                Quantity::new("pole pairs", "", f32::from(self.pole_pairs)),
                Quantity::new("base impedance", "ohm", self.z_b),
            ],
        )
    }

    /// Expected range of a resistance or an inductance, as shares of the base.
    pub fn leakage(&self) -> (f32, f32) {
        (0.08 * self.l_b, 0.8 * self.l_b)
    }

    pub fn r_s(&self) -> (f32, f32) {
        (0.005 * self.z_b, 0.25 * self.z_b)
    }

    pub fn r_r(&self) -> (f32, f32) {
        (0.001 * self.z_b, 0.1 * self.z_b)
    }

    /// Expected range of the rotor time constant, s.
    pub const TAU_R: (f32, f32) = (0.02, 1.4);
}
