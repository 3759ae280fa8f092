//! The linear model of sensorless tracking, which predicts the error of the flux angle after a small disturbance.
//!
//! Everything that affects the angle is linearised about an operating point `i_d, i_q` and stepped at the control rate.
//! The variables are deviations, with `e` true minus estimated flux angle in rad, `w` electrical rotor speed, `m`
//! magnetising current (rotor flux over L_m):
//!
//! ```text
//! currents in the flux frame   i_d' = i_q e             i_q' = di_q - i_d e
//! rotor                        T_r dm/dt = i_d' - m      slip = (i_q' - i_q/i_d m) / (T_r i_d)
//! shaft                        J/P dw/dt = 3/2 P L_m^2/L_r (i_d i_q' + i_q m) - T_L - B w/P
//! slip fed forward             s_ff = r / (T_r,believed i_d)     r: filtered reference of i_q
//! observed                     x = MA20 MA20 ( e + c (r - di_q) )   c = dq/di_q over 2 |a_psi|
//! tracking                     da/dt = c w_n^3 x      dw_i/dt = a + (1 + 2 c) w_n^2 x
//! angle                        de/dt = w + slip - w_i - s_ff - (2 + c) w_n g x
//! ```
//!
//! The current loop is the drive's: PI, filter, one period of delay, plant of first order. The speed loop, if there is
//! one, uses the mean of `w_i + (2 + c) w_n g x` over its period.

use drive_core::filter::{LPF, LpfState};
use drive_core::flux::GainSchedule;
use drive_core::io::PERIOD_S;
use drive_settings::tuning::{self, CurrentLoopDesign, MotionDesign, SpeedSource};

use crate::prelude::*;

/// A disturbance at time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// Step of the q-axis current reference, A; the shaft is locked.
    TorqueCurrent(f64),
    /// Step of the load, Nm; the drive regulates the speed.
    Load(f64),
}

/// The model about one operating point.
#[derive(Clone, Debug)]
pub struct LinearModel {
    i_d: f64,
    i_q: f64,
    /// Rotor time constant: true, and as assumed by the drive, s.
    t_r: [f64; 2],
    /// Torque constant 3/2 P Lm^2/Lr, Nm per square ampere.
    torque: f64,
    mechanics: MechanicsSettings,
    pole_pairs: f64,
    plant: FirstOrder,
    current: CurrentLoopDesign,
    speed: MotionDesign,
    /// Natural frequency of the tracking loop, rad/s.
    w_n: f64,
    /// Apparent angle error per difference of the q-axis current, rad/A.
    apparent_angle: f64,
}

/// Response of the model, one value per control period.
#[derive(Clone, Debug, Default)]
pub struct LinearResponse {
    /// Angle error, electrical degrees.
    pub angle_deg: Vec<f64>,
    /// Speed of the rotor, rpm.
    pub speed_rpm: Vec<f64>,
}

impl LinearModel {
    /// Makes the model about the q-axis current `i_q`, for a drive with these settings on this machine.
    ///
    /// # Errors
    /// [`Error::Refused`] if the drive or the design refuses the settings.
    pub fn new(
        machine: &MachineSettings,
        mechanics: &MechanicsSettings,
        settings: &Settings,
        i_q: f64,
    ) -> Result<Self, Error> {
        sim_bench::config::built(settings)?;
        let MachineSettings { rs: r_s, rr: r_r, lm: l_m, lls: l_ls, llr: l_lr, .. } = *machine;
        let circuit = tuning::EquivalentCircuit { r_s, r_r, l_m, l_ls, l_lr };
        let plant = tuning::motor_plant(&circuit, f64::from(PERIOD_S)).map_err(Error::refused)?;
        let schedule = GainSchedule::new(&settings.reference(), &settings.slope());
        // Over half the distance of the table's points to either side.
        let half = 0.5 * settings.reference().grid().step_a();
        let here = schedule.at(i_q as f32);
        let (before, after) = (schedule.at(i_q as f32 - half), schedule.at(i_q as f32 + half));
        let l_r = machine.llr + machine.lm;
        let pole_pairs = f64::from(machine.pole_pairs);
        Ok(Self {
            i_d: settings.i_d().into(),
            i_q,
            t_r: [l_r / machine.rr, settings.motor.tau_r().into()],
            torque: 1.5 * pole_pairs * machine.lm * machine.lm / l_r,
            mechanics: *mechanics,
            pole_pairs,
            plant,
            current: settings.current_loops().map_err(Error::refused)?[1],
            speed: settings.motion_loops().map_err(Error::refused)?,
            w_n: TAU * f64::from(settings.injection.synchronous.bandwidth_hz),
            apparent_angle: f64::from(here.gain * (before.reference - after.reference)) / 0.25,
        })
    }

    /// Computes the response to a disturbance over some seconds.
    pub fn response(&self, disturbance: Disturbance, seconds: f64) -> LinearResponse {
        let t = f64::from(PERIOD_S);
        let (i_d, i_q, [t_r, believed_t_r]) = (self.i_d, self.i_q, self.t_r);
        let (mut reference, free, load) = match disturbance {
            Disturbance::TorqueCurrent(step) => (step, false, 0.0),
            Disturbance::Load(torque) => (0.0, true, torque),
        };
        let mut response = LinearResponse::default();
        let (mut low_pass, mut seen) = (LpfState::default(), [MovingAverage::default(); 2]);
        let (mut filtered, mut current, mut error) = (0.0, 0.0, 0.0);
        let (mut voltage, mut acting) = (0.0, 0.0);
        let (mut e, mut m, mut w) = (0.0, 0.0, 0.0);
        let (mut w_i, mut acceleration) = (0.0, 0.0);
        let (mut rotor, mut moved, mut speed, mut speed_error) = (0.0, 0.0, 0.0, 0.0);
        let divider = (self.speed.gains.period_s / t).round() as usize;
        for k in 0..(seconds / t).round() as usize {
            response.angle_deg.push(e * 360.0 / TAU);
            response.speed_rpm.push(w * 60.0 / TAU / self.pole_pairs);
            if free && k % divider == 0 {
                // in turns/s, as in the controller
                let now = match self.speed.source {
                    SpeedSource::Estimate { .. } => rotor,
                    _ => moved / self.speed.gains.period_s,
                } / (TAU * self.pole_pairs);
                speed += self.speed.gains.smoothing * (now - speed);
                reference -= self.speed.gains.k_c * (speed - self.speed.gains.z_c * speed_error);
                (speed_error, moved) = (speed, 0.0);
            }

            // Current loop.
            let r = filtered;
            filtered += (1.0 - self.current.z_c) * (reference - r);
            let measured = LPF.step(&mut low_pass, AlphaBeta::new(current as f32, 0.0)).alpha;
            let now = r - f64::from(measured);
            voltage += self.current.k_c * (now - self.current.z_c * error);
            error = now;

            // Observed angle error, and the tracking loop.
            let x = e + self.apparent_angle * (r - current);
            let x = seen.iter_mut().fold(x, |x, average| average.step(x));
            let w_n = self.w_n;
            acceleration += t * w_n.powi(3) * x;
            w_i += t * (acceleration + 2.0 * w_n * w_n * x);
            rotor = w_i + 2.0 * w_n * x;
            moved += t * rotor;
            let fed_forward = r / (believed_t_r * i_d);

            // The machine.
            let (d, q) = (i_q * e, current - i_d * e);
            let slip = (q - i_q / i_d * m) / (t_r * i_d);
            let torque = self.torque * (i_d * q + i_q * m) - load;
            e += t * (w + slip - rotor - fed_forward);
            m += t * (d - m) / t_r;
            if free {
                let friction = self.mechanics.friction * w / self.pole_pairs;
                w += t * self.pole_pairs * (torque - friction) / self.mechanics.inertia;
            }
            current = self.plant.p * current + self.plant.k * acting;
            acting = voltage;
        }
        response
    }
}

/// Moving mean over the last 20 samples.
#[derive(Clone, Copy, Debug, Default)]
struct MovingAverage {
    ring: [f64; 20],
    index: usize,
    sum: f64,
}

impl MovingAverage {
    fn step(&mut self, x: f64) -> f64 {
        self.sum += x - std::mem::replace(&mut self.ring[self.index], x);
        self.index = (self.index + 1) % self.ring.len();
        self.sum / self.ring.len() as f64
    }
}
