//! Step 1: the plausibility of the nameplate, and the values that follow from it.

use core::f32::consts::{SQRT_2, TAU};

use super::report::{Quantity, Refusal, SIZE, TIME};
use drive_core::{PERIOD_S, SQRT_3};
use drive_settings::{Nameplate, Settings};

/// Plausible share of the shaft's power in the apparent power: efficiency times power factor.
const POWER: (f32, f32) = (0.15, 0.95);
/// Plausible slip at rated speed.
const SLIP: (f32, f32) = (0.002, 0.15);
/// Largest share of the sensors' range that is used.
const OF_RANGE: f32 = 0.8;
/// Least share of the rated peak current that the sensors have to reach.
const LEAST_CURRENT: f32 = 0.3;

/// Expected range of the rotor time constant, rated rad: 0.02 to 1.4 s at 60 Hz.
const TAU_R: (f32, f32) = (7.5, 528.0);

/// Least ratio of the q-axis and the d-axis current at rated load, which is slip times rotor time constant.
const LEAST_LOAD: f32 = 0.5;

/// Values that follow from the nameplate, the board and the settings in force: safe currents and expected ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plate {
    /// Test current, A peak: the rated current, or less if the sensors do not reach it.
    pub amperes: f32,
    /// Base impedance, ohm.
    pub z_b: f32,
    /// Expected ranges: transient inductance, H, stator and rotor resistance, ohm.
    pub leakage: (f32, f32),
    pub r_s: (f32, f32),
    pub r_r: (f32, f32),
    /// Expected range of the rotor time constant, s.
    pub tau_r: (f32, f32),
    /// Pole pairs by the nameplate, and in force.
    pub pole_pairs: u8,
    pub pole_pairs_in_force: f32,
    /// Rated speed, electrical rad/s.
    pub speed: f32,
    /// Peak of the rated voltage between lines, V.
    pub peak_v: f32,
    /// Rated current, and limit of the q-axis current, A peak.
    pub rated: f32,
    pub i_q_limit: f32,
    /// Rated flux, Wb peak, and largest magnetising current by the rule of `sequence.i_d`, A.
    pub flux: f32,
    pub largest_i_d: f32,
    /// Torque per q-axis current in force, Nm/A.
    pub torque_per_ampere: f32,
    /// Time constant of the analog filter of the currents, control periods.
    pub filter: f32,
    /// Margin of the pulses for noise, A, and their largest voltage, V.
    pub pulse_noise: f32,
    pub pulse_v: f32,
    /// Dead time as a share of the control period.
    pub dead_time: f32,
    /// Nominal dc link, V.
    pub dc_link: f32,
    /// First entry of the nameplate that does not fit the others.
    pub implausible: Option<Quantity>,
}

impl Plate {
    /// Computes the values of the settings.
    pub fn new(settings: &Settings) -> Self {
        let plate = &settings.nameplate;
        let safe = OF_RANGE * settings.sensor_range_a();
        let rated = settings.rated_a();
        let z_b = plate.base_impedance();
        let omega = TAU * plate.frequency_hz;
        let l_b = z_b / omega;
        // The rotor current is at least the one that carries the power at the rated voltage.
        let largest_r_r = plate.slip() * plate.voltage_v * plate.voltage_v / plate.power_w;
        let current = Quantity::new("nameplate.current_a", "A", plate.current_a)
            .allowing((0.0, safe / (LEAST_CURRENT * SQRT_2)));
        let mut entries = power_and_speed(plate).into_iter().chain([current]);
        Self {
            amperes: rated.min(safe).min(settings.trip_a() / 1.15),
            z_b,
            leakage: (0.08 * l_b, 0.8 * l_b),
            r_s: (0.005 * z_b, 0.25 * z_b),
            r_r: (0.001 * z_b, largest_r_r.max(0.1 * z_b)),
            tau_r: (TAU_R.0.min(LEAST_LOAD / plate.slip()) / omega, TAU_R.1 / omega),
            pole_pairs: plate.pole_pairs(),
            pole_pairs_in_force: f32::from(settings.motor.pole_pairs),
            peak_v: SQRT_2 * plate.voltage_v,
            rated,
            i_q_limit: settings.i_q_limit_a(),
            speed: (1.0 - plate.slip()) * omega,
            flux: SQRT_2 / SQRT_3 * plate.voltage_v / omega,
            largest_i_d: settings.largest_i_d(settings.current_limit_a()),
            torque_per_ampere: settings.motor.torque_per_ampere(settings.i_d()),
            filter: settings.current_age_s() / PERIOD_S,
            pulse_noise: settings.share_of_range(0.05),
            pulse_v: settings.share_of_dc_link(60.0),
            dead_time: settings.inverter.dead_time_s / settings.inverter.carrier_s(),
            dc_link: settings.inverter.dc_link_v,
            implausible: entries.find(|entry| !entry.is_allowed()),
        }
    }

    /// Returns the values of the report.
    pub fn values(&self) -> [Quantity; 3] {
        [
            Quantity::new("test current", "A", self.amperes),
            Quantity::new("pole pairs", "", f32::from(self.pole_pairs)),
            Quantity::new("base impedance", "ohm", self.z_b),
        ]
    }
}

/// Returns power and speed of a nameplate, each with the range that the other entries allow.
fn power_and_speed(plate: &Nameplate) -> [Quantity; 2] {
    let apparent = SQRT_3 * plate.voltage_v * plate.current_a;
    let synchronous = plate.speed_rpm / (1.0 - plate.slip());
    let power = (POWER.0 * apparent, POWER.1 * apparent);
    let speed = ((1.0 - SLIP.1) * synchronous, (1.0 - SLIP.0) * synchronous);
    [
        Quantity::new("nameplate.power_w", "W", plate.power_w).allowing(power),
        Quantity::new("nameplate.speed_rpm", "rpm", plate.speed_rpm).allowing(speed),
    ]
}

/// Checks that power and speed of a nameplate fit its other entries.
///
/// # Errors
/// [`Refusal::Plate`].
pub fn check_nameplate(plate: &Nameplate) -> Result<(), Refusal> {
    let implausible = power_and_speed(plate).into_iter().find(|entry| !entry.is_allowed());
    implausible.map_or(Ok(()), |entry| Err(Refusal::Plate(entry)))
}

/// Checks that the motor of these settings can have their nameplate, as the steps of the commissioning check what they find.
///
/// # Errors
/// [`Refusal::Value`].
pub fn check_motor(settings: &Settings) -> Result<(), Refusal> {
    let (plate, motor) = (Plate::new(settings), &settings.motor);
    let coupling = motor.l_m / (motor.l_m + motor.l_lr);
    let r_r = coupling * coupling * motor.r_r;
    Quantity::new("sigma L_s", "H", motor.sigma_l_s()).checked(plate.leakage, SIZE)?;
    Quantity::new("r_s", "ohm", motor.r_s).checked(plate.r_s, SIZE)?;
    Quantity::new("R_R", "ohm", r_r).checked(plate.r_r, SIZE)?;
    Quantity::new("tau_r", "s", motor.tau_r()).checked(plate.tau_r, TIME).map(|_| ())
}
