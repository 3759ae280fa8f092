//! The largest torque of a drive at standstill: its value, the limiting factor, and the remedies.

use std::f64::consts::SQRT_2;

use super::battery::learned_drive;
use super::course::{allowed_a, torque_limit_a, torque_nm};
use crate::prelude::*;

/// Relative difference below which two values are the same limit.
const SAME: f64 = 2e-3;
/// Share of the most useful magnetising current below which a larger one is the first remedy.
const LOW_FLUX: f64 = 0.9;
/// A q-axis current beyond all limits, A on the dissertation's motor: the drive gives as much as it can.
pub const BEYOND_A: f64 = 100.0;

/// A torque limit.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueLimit {
    /// q-axis current, A peak.
    pub i_q: f64,
    /// Torque at the right angle, Nm.
    pub nm: f64,
    /// Torque in % of the rated torque.
    pub percent: f64,
    /// The limiting factor, in words.
    pub binds: String,
    /// Remedies that increase the torque, in words.
    pub more: String,
}

/// Returns the drive of a configuration, off, which has learned if it can, and its torque limit.
///
/// # Errors
/// If settings or plant are refused, or the drive does not learn.
pub fn learned_limit(config: &Config, seed: u64) -> Result<(Drive, TorqueLimit), Error> {
    let refused = |fault| Error::Refused(format!("the drive does not learn: fault {fault}"));
    let drive = learned_drive(config, seed)?.map_err(refused)?;
    let limit = TorqueLimit::new(config, allowed_a(&drive, config.amperes(BEYOND_A))?);
    Ok((drive, limit))
}

impl TorqueLimit {
    /// Computes the limit of a drive with at most this q-axis current, A peak.
    pub fn new(config: &Config, i_q: f64) -> Self {
        let nm = torque_nm(config, i_q);
        let (binds, by_current) = binding(config, i_q);
        let more = more(config, by_current);
        Self { i_q, nm, percent: 100.0 * nm / config.rated_nm(), binds, more }
    }

    /// Returns this limit, or the limit of this share of the rated torque, %, if that is smaller.
    pub fn at_most(self, percent: f64) -> Self {
        let share = (percent / self.percent).min(1.0);
        let Self { i_q, nm, binds, more, .. } = self;
        let binds = if share < 1.0 { "`record.torque_pct`".to_owned() } else { binds };
        Self { i_q: share * i_q, nm: share * nm, percent: self.percent.min(percent), binds, more }
    }

    /// Describes the limit in words.
    pub fn text(&self, config: &Config) -> String {
        let Self { i_q, nm, percent, binds, more } = self;
        format!(
            "Torque limit at rest: {nm:.2} Nm, {percent:.0} % of the rated torque of {:.1} Nm, by {i_q:.2} A of q-axis current \
             at {:.2} A of magnetising current. Limited by: {binds}. {more}",
            config.rated_nm(),
            config.drive.i_d()
        )
    }
}

/// Returns the limiting factor, and whether a larger `limits.current_a` raises it.
fn binding(config: &Config, i_q: f64) -> (String, bool) {
    let drive = &config.drive;
    let (limit, largest) = (f64::from(drive.current_limit_a()), torque_limit_a(config));
    let is = |other: f64| (i_q / other - 1.0).abs() < SAME;
    let step = f64::from(drive.grid().step_a());
    if is(largest) {
        let range = f64::from(drive.sensor_range_a());
        let what = match drive.better_sensors() {
            Some(_) => format!(
                "the current limit of {limit:.2} A, which comes from the sensors (`measurement.range_a` = {range:.2} A)"
            ),
            None => format!("the current limit of {limit:.2} A (`limits.current_a`)"),
        };
        (what, true)
    } else if is((largest / step).floor() * step) {
        ("the last learned q-axis current, by `limits.current_a`".to_owned(), true)
    } else {
        ("the learned saliency sensitivity (slope), which is too small beyond".to_owned(), false)
    }
}

fn more(config: &Config, by_current: bool) -> String {
    let (drive, plate) = (&config.drive, &config.drive.nameplate);
    let i_d = f64::from(drive.i_d());
    let rated_flux =
        f64::from(plate.voltage_v) * (2.0_f64 / 3.0).sqrt() / (TAU * f64::from(plate.frequency_hz));
    let of_rated_flux = rated_flux / config.motor.l_m;
    let is_low = i_d < LOW_FLUX * of_rated_flux.min(f64::from(drive.rated_a()) / SQRT_2);
    let by_rule = drive.sequence.flux == Flux::High && drive.sequence.i_d.is_none();
    if by_current && (by_rule || !is_low) {
        return match drive.better_sensors() {
            Some((range_a, percent)) => {
                format!("More: `measurement.range_a` = {range_a:.1} A would allow {percent:.0} %.")
            }
            None => "More: a larger `limits.current_a`.".to_owned(),
        };
    }
    let how = if by_rule { "" } else { "`sequence.flux=high` with `sequence.i_d=auto`, or " };
    format!(
        "More: a larger magnetising current, which is {:.0} % of that of the rated flux: {how}a larger `sequence.i_d`.",
        100.0 * i_d / of_rated_flux
    )
}
