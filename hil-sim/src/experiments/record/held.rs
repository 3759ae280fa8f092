//! Torque held on a shaft that a dynamometer turns.

use crate::prelude::*;

/// Pace of the dynamometer, s, and of the lines of the figures.
const PACE_S: f64 = 0.001;
const SHOWN_S: f64 = 0.5;
/// Time constant of its filter of the slip, s; its gain from the angle of the flux to the electrical speed, 1/s, and the
/// largest part that this has, rad/s; its largest electrical acceleration, rad/s^2, 200 rpm/s on four poles. It is slow
/// against the drive: a faster one answers the noise of the angle with acceleration.
const SLIP_S: f64 = 2.0;
const ANGLE_GAIN: f64 = 3.0;
const ANGLE_MOST: f64 = 4.0;
const ACCELERATION: f64 = 42.0;

/// What is seen while torque is held.
#[derive(Default)]
pub struct Held {
    /// Angle error, electrical degrees; in the mean of the first and of the last minute, or tenth of a shorter time than ten.
    pub error: Stats,
    /// See `error`.
    pub first: Stats,
    /// See `error`.
    pub last: Stats,
    /// Torque of the motor, Nm.
    pub torque: Stats,
    /// Largest angle of the rotor flux from where the dynamometer is to hold it, electrical degrees.
    pub travel_deg: f64,
    /// Mean stator frequency: that of the rotor flux, electrical Hz.
    pub stator_hz: f64,
    /// Speed of the rotor, rpm.
    pub speed: Stats,
    /// Means of angle error, degrees, torque, Nm, and speed, rpm, at their times, s.
    pub lines: [Vec<(f64, f64)>; 3],
    /// The fault with which the drive stopped.
    pub fault: Option<String>,
}

impl Held {
    /// Whether the angle was lost or the drive stopped.
    pub fn is_lost(&self) -> bool {
        self.fault.is_some() || self.error.largest() > LOST_DEG
    }

    /// How far the mean of the last minute, or tenth, is from that of the first, degrees.
    pub fn drift_deg(&self) -> f64 {
        self.last.mean() - self.first.mean()
    }

    /// Watches for some seconds; `speed` gives the dynamometer's electrical speed, rad/s, of time and plant, and `at` is
    /// where it holds the rotor flux, rad.
    ///
    /// # Errors
    /// When the load is refused.
    pub fn watch(
        rig: &mut Rig,
        seconds: f64,
        at: f64,
        mut speed: impl FnMut(f64, &Plant) -> f64,
    ) -> Result<Self, Error> {
        let (mut held, start, end) = (Self::default(), rig.time(), f64::min(60.0, 0.1 * seconds));
        let mut shown = [Stats::default(), Stats::default(), Stats::default()];
        let steps = (seconds / PACE_S).round() as u64;
        let each = (SHOWN_S / PACE_S).min(seconds / PACE_S / 50.0).max(1.0) as u64;
        let (mut turned, mut before) = (0.0, rig.plant.rotor_flux_angle());
        for n in 1..=steps {
            let t = rig.time() - start;
            let turns = speed(t, &rig.plant) / rig.plant.pole_pairs();
            rig.set_load(Load::Speed { speed: turns })?;
            rig.run(PACE_S, |point| {
                held.error.push(point.angle_error_deg);
                if t < end {
                    held.first.push(point.angle_error_deg);
                } else if t >= seconds - end {
                    held.last.push(point.angle_error_deg);
                }
                held.torque.push(point.torque);
                held.speed.push(point.speed_rpm);
                let values = [point.angle_error_deg, point.torque, point.speed_rpm];
                shown.iter_mut().zip(values).for_each(|(mean, value)| mean.push(value));
            });
            let angle = rig.plant.rotor_flux_angle();
            turned += wrapped_degrees(angle - std::mem::replace(&mut before, angle));
            held.stator_hz = turned / 360.0 / (t + PACE_S);
            held.travel_deg = held.travel_deg.max(wrapped_degrees(angle - at).abs());
            if n % each == 0 {
                for (line, mean) in held.lines.iter_mut().zip(&mut shown) {
                    line.push((t, std::mem::take(mean).mean()));
                }
            }
            held.fault = rig.fault();
            if held.fault.is_some() {
                break;
            }
        }
        Ok(held)
    }
}

/// A dynamometer that turns the rotor against the slip, so that the rotor flux stands: zero stator frequency. In steady state the slip is `T r_r/(3/2 P psi^2)`.
pub struct Standstill {
    r_r: f64,
    slip: f64,
    speed: f64,
    /// Where the flux is to stand, rad from phase a.
    pub at: f64,
}

impl Standstill {
    /// For the motor of the configuration, at rest.
    pub fn new(config: &Config) -> Self {
        let at = config.record.flux_deg.to_radians();
        Self { r_r: config.motor.r_r, slip: 0.0, speed: 0.0, at }
    }

    /// The electrical speed of the rotor, rad/s, for the next millisecond.
    pub fn speed(&mut self, plant: &Plant) -> f64 {
        let square = plant.rotor_flux().norm().powi(2);
        let slip = plant.torque() * self.r_r / (1.5 * plant.pole_pairs() * square);
        self.slip += PACE_S / SLIP_S * (slip - self.slip);
        let off = wrapped_degrees(plant.rotor_flux_angle() - self.at).to_radians();
        let wanted = -self.slip - (ANGLE_GAIN * off).clamp(-ANGLE_MOST, ANGLE_MOST);
        let most = ACCELERATION * PACE_S;
        self.speed += (wanted - self.speed).clamp(-most, most);
        self.speed
    }
}

/// Speed of a rotor that goes from `rpm`, on two poles, to its opposite in `seconds`, electrical rad/s.
pub fn reversing(rpm: f64, seconds: f64) -> impl Fn(f64, &Plant) -> f64 {
    move |t, plant| plant.pole_pairs() * rpm * TAU / 60.0 * (1.0 - 2.0 * t / seconds)
}
