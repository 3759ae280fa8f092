//! Torque held on a shaft that a dynamometer turns.

use crate::prelude::*;

/// Time step of the dynamometer, s, and of the lines of the figures.
const PACE_S: f64 = 0.001;
const SHOWN_S: f64 = 0.5;
/// Time constant of the dynamometer's slip filter, s; its gain from the flux angle to the electrical speed, 1/s, and
/// the limit of that part, rad/s; its largest electrical acceleration, rad/s^2, which is 200 rpm/s on four poles. The
/// dynamometer is slow compared with the drive, because a faster one would respond to the noise of the angle with
/// acceleration.
const SLIP_S: f64 = 2.0;
const ANGLE_GAIN: f64 = 3.0;
const ANGLE_MOST: f64 = 4.0;
const ACCELERATION: f64 = 42.0;

/// Observations while torque is held.
#[derive(Default)]
pub struct Held {
    /// Angle error, electrical degrees: over the whole time, and over the first and the last minute (or tenth, if the
    /// time is shorter than ten minutes).
    pub error: Stats,
    /// See `error`.
    pub first: Stats,
    /// See `error`.
    pub last: Stats,
    /// Torque of the motor, Nm.
    pub torque: Stats,
    /// Largest distance of the rotor flux angle from its target, electrical degrees.
    pub travel_deg: f64,
    /// Mean stator frequency, which is the frequency of the rotor flux, electrical Hz.
    pub stator_hz: f64,
    /// Speed of the rotor, rpm.
    pub speed: Stats,
    /// Means of angle error, degrees, torque, Nm, and speed, rpm, with their times, s.
    pub lines: [Vec<(f64, f64)>; 3],
    /// The fault with which the drive stopped.
    pub fault: Option<String>,
}

impl Held {
    /// Whether the angle was lost or the drive stopped.
    pub fn is_lost(&self) -> bool {
        is_lost(self.error.largest(), self.fault.is_some())
    }

    /// Difference between the means of the last and the first minute, or tenth, degrees.
    pub fn drift_deg(&self) -> f64 {
        self.last.mean() - self.first.mean()
    }

    /// Watches for some seconds. `speed` computes the dynamometer's electrical speed, rad/s, from time and plant; `at`
    /// is the target angle of the rotor flux, rad.
    ///
    /// # Errors
    /// If the load is refused.
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

/// A dynamometer that turns the rotor against the slip, so that the rotor flux is fixed: zero stator frequency. In
/// steady state the slip is `T r_r/(3/2 P psi^2)`.
pub struct Standstill {
    r_r: f64,
    slip: f64,
    speed: f64,
    /// Target angle of the flux, rad from phase a.
    pub at: f64,
}

impl Standstill {
    /// Makes the dynamometer for the motor of the configuration, at rest.
    pub fn new(config: &Config) -> Self {
        let at = config.record.flux_deg.to_radians();
        Self { r_r: config.motor.r_r, slip: 0.0, speed: 0.0, at }
    }

    /// Returns the electrical speed of the rotor, rad/s, for the next millisecond.
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
