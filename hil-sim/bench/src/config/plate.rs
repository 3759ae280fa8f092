//! A motor of which only the nameplate is known.
//!
//! Current and power of the nameplate, at its speed, determine two numbers of the circuit: magnetising reactance and rotor resistance. The
//! others follow by rule: each leakage reactance is 0.09 of the base impedance V/(sqrt(3) I), and the stator has the resistance of the rotor.
//! All motors in the folder `motors` but one have 0.5 to 2 times the estimated stator resistance, 0.6 to 1.1 times the rotor resistance
//! and 0.7 to 1.3 times the magnetising reactance. The circuit of the dissertation's motor does not give its nameplate.

use std::f64::consts::TAU;

use drive_settings::Nameplate;
use drive_settings::tuning::bisected;

use super::Config;
use crate::error::Error;

/// Source of an estimated number.
pub const ESTIMATED: &str = "estimated from the nameplate; `commission` measures it";
/// Leakage reactance of stator and of rotor, per unit.
const LEAKAGE: f64 = 0.09;
/// Range in which the magnetising reactance is looked for, per unit.
const MAGNETISING: (f64, f64) = (0.5, 20.0);
/// Voltage of the dc link relative to the rated voltage: that of a rectified supply.
const DC_LINK: f64 = 1.35;

/// Checks that the entries of the nameplate in force fit each other and the motor.
///
/// # Errors
/// [`Error::Refused`] with what does not fit, its value, and the range that would.
pub fn check(config: &Config) -> Result<(), Error> {
    let plate = &config.drive.nameplate;
    let (pairs, given) = (plate.pole_pairs(), config.motor.pole_pairs);
    drive_commission::check_nameplate(plate).map_err(Error::refused)?;
    if given != u32::from(pairs) {
        let why = format!("frequency and speed of the nameplate make {pairs}");
        return Err(Error::Refused(format!("motor.pole_pairs = {given}: {why}")));
    }
    let units = "the settings are ohm and H of a phase in star connection";
    drive_commission::check_motor(&config.drive)
        .map_err(|refusal| Error::Refused(format!("motor: {refusal}; {units}")))
}

/// Returns the keys that follow from a nameplate: circuit and dc link.
///
/// # Errors
/// [`Error::Refused`] if an entry does not fit the others, or if no circuit draws the current and gives the power at the speed.
pub fn circuit(plate: &Nameplate) -> Result<[(&'static str, f64); 7], Error> {
    drive_commission::check_nameplate(plate).map_err(Error::refused)?;
    let slip = f64::from(plate.slip());
    let [voltage, hertz, power] =
        [plate.voltage_v, plate.frequency_hz, plate.power_w].map(f64::from);
    let power = power / (3_f64.sqrt() * voltage * f64::from(plate.current_a));
    let rated = |r, x_m| rated([r, r, LEAKAGE, LEAKAGE, x_m]);
    let resistance = |x_m| bisected((1e-3, 1.0), 40, &|r| rated(r, x_m).0 < slip).0;
    let (x_m, _) = bisected(MAGNETISING, 40, &|x_m| rated(resistance(x_m), x_m).1 < power);
    let r = resistance(x_m);
    let found = rated(r, x_m);
    if (found.0 / slip - 1.0).abs().max((found.1 / power - 1.0).abs()) > 0.01 {
        let why = "nameplate: no circuit draws this current and gives this power at this speed";
        return Err(Error::Refused(format!("{why}; compare each number, for your connection")));
    }
    let z = f64::from(plate.base_impedance());
    let l = z / (TAU * hertz);
    let all = [
        ("motor.r_s", r * z),
        ("motor.r_r", r * z),
        ("motor.l_ls", LEAKAGE * l),
        ("motor.l_lr", LEAKAGE * l),
        ("motor.l_m", x_m * l),
        ("motor.pole_pairs", plate.pole_pairs().into()),
        ("inverter.dc_link_v", DC_LINK * voltage),
    ];
    Ok(all.map(|(key, value)| (key, format!("{value:.3e}").parse().unwrap_or(value))))
}

/// Returns the slip at which a circuit, in units of its nameplate's impedance, takes the rated current, and the shaft power
/// there relative to the apparent power.
pub fn rated([r_s, r_r, x_s, x_r, x_m]: [f64; 5]) -> (f64, f64) {
    let impedance = |slip: f64| {
        let (r, x) = (r_r / slip, x_m + x_r);
        let share = x_m / (r * r + x * x);
        (share * x_m * r, r_s + share * x_m * r, x_s + share * (r * r + x_r * x))
    };
    let is_below = |slip: f64| {
        let (_, re, im) = impedance(slip);
        re.hypot(im) > 1.0
    };
    let (slip, _) = bisected((1e-5, 1.0), 50, &is_below);
    (slip, (1.0 - slip) * impedance(slip).0)
}
