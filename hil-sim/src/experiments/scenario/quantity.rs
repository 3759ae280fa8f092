//! The quantities that a scenario can record, judge and count.

use serde::Deserialize;

use crate::error::unknown;
use crate::rig::Point;

/// A sample of a run.
pub struct Seen<'a> {
    /// True values and estimates.
    pub point: &'a Point,
    /// The reference in force, and the actual value of the referenced quantity.
    pub reference: f64,
    /// See `reference`.
    pub actual: f64,
}

/// A quantity.
#[derive(Debug)]
pub struct Quantity {
    /// Name in files; it ends in the unit.
    pub name: &'static str,
    /// Label of its axis.
    pub label: &'static str,
    /// Its value.
    pub of: fn(&Seen<'_>) -> f64,
}

/// All quantities, by name.
#[rustfmt::skip] // one a line
pub const QUANTITIES: &[Quantity] = &[
    Quantity { name: "reference", label: "reference", of: |s| s.reference },
    Quantity { name: "reference_deg", label: "reference (° mechanical)", of: |s| s.reference * 360.0 },
    Quantity { name: "reference_error", label: "actual − reference", of: |s| s.actual - s.reference },
    Quantity { name: "torque_current_a", label: "quadrature current (A)", of: |s| s.point.iq },
    Quantity { name: "torque_current_filtered_reference_a", label: "quadrature current (A)", of: |s| s.point.iq_ref },
    Quantity { name: "torque_current_error_a", label: "quadrature current − reference (A)", of: |s| s.point.iq - s.point.iq_ref },
    Quantity { name: "direct_current_a", label: "direct current (A)", of: |s| s.point.id },
    Quantity { name: "current_a", label: "stator current (A)", of: |s| s.point.current },
    Quantity { name: "torque_nm", label: "torque (Nm)", of: |s| s.point.torque },
    Quantity { name: "torque_by_eq_4_4_nm", label: "torque (Nm)", of: |s| eq_4_4(s.point) },
    Quantity { name: "torque_minus_eq_4_4_nm", label: "torque − Eq. 4.4 (Nm)", of: |s| s.point.torque - eq_4_4(s.point) },
    Quantity { name: "flux_wb", label: "rotor flux (Wb)", of: |s| s.point.flux },
    Quantity { name: "speed_rpm", label: "speed (rpm)", of: |s| s.point.speed_rpm },
    Quantity { name: "speed_estimate_rpm", label: "estimated speed (rpm)", of: |s| s.point.speed_estimate_rpm },
    Quantity { name: "speed_estimate_error_rpm", label: "estimated − true speed (rpm)", of: |s| s.point.speed_estimate_rpm - s.point.speed_rpm },
    Quantity { name: "position_turns", label: "position (turns)", of: |s| s.point.turns },
    Quantity { name: "position_deg", label: "position (° mechanical)", of: |s| s.point.turns * 360.0 },
    Quantity { name: "position_error_deg", label: "position − reference (° mechanical)", of: |s| (s.point.turns - s.reference) * 360.0 },
    Quantity { name: "position_estimate_error_deg", label: "seen − true (° mechanical)", of: |s| (s.point.turns_estimate - s.point.turns) * 360.0 },
    Quantity { name: "angle_error_deg", label: "angle error (° electrical)", of: |s| s.point.angle_error_deg },
    Quantity { name: "saliency_milli", label: "saliency (10⁻³)", of: |s| s.point.saliency * 1e3 },
    Quantity { name: "current_difference_ma", label: "current difference (mA)", of: |s| s.point.delta_i * 1e3 },
    Quantity { name: "carrier_current_a", label: "carrier current (A)", of: |s| s.point.carrier },
    Quantity { name: "saliency_loss", label: "saliency loss", of: |s| s.point.loss },
];

/// Torque by Eq. 4.4 from the currents of the drive and the angle error: 3/2 P psi |i| sin(Delta alpha), times L_m/L_r
/// since psi is the rotor flux; Delta alpha = gamma - e, gamma from the measured currents.
fn eq_4_4(p: &Point) -> f64 {
    let gamma = p.iq.atan2(p.id);
    let length = p.iq.hypot(p.id);
    p.torque_per_flux_ampere * p.flux * length * (gamma - p.angle_error_deg.to_radians()).sin()
}

/// A quantity by its name in a file.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "String")]
pub struct Named(pub &'static Quantity);

impl TryFrom<String> for Named {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let names: Vec<_> = QUANTITIES.iter().map(|quantity| quantity.name).collect();
        let found = QUANTITIES.iter().find(|known| known.name == name);
        found.map(Self).ok_or_else(|| unknown("column", &name, &names))
    }
}
