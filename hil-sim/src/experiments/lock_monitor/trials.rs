//! The trials of the experiment, each determined by its seed alone.

use drive_settings::words;

use crate::experiments::statistics::fault_code;
use crate::experiments::steady::{OperatingPoint, at_speed};
use crate::prelude::*;

/// Angle error below which the drive counts as locked, degrees.
pub const LOCKED_DEG: f64 = 15.0;
/// Smallest and largest q-axis current, A.
const IQ_A: (f64, f64) = (0.5, 3.0);
/// Time for which a trial is watched after the angle was forced off, s.
const WATCH_S: f64 = 2.0;

/// Returns a random operating point with a speed within ±`bound` rpm.
pub fn case(seed: u64, bound: f64) -> OperatingPoint {
    let mut random = seeded(seed);
    let sign = sign(&mut random);
    // Every fifth trial has the smallest current, at which a wrong angle causes the smallest torque.
    let least = random.random_range(0..5) == 0;
    let length = if least { IQ_A.0 } else { random.random_range(IQ_A.0..=IQ_A.1) };
    OperatingPoint { rpm: random.random_range(-bound..=bound), iq: sign * length, seed }
}

/// The result of a trial of any part; values that the part does not give have their defaults.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Trial {
    /// Operating point and seed.
    pub case: OperatingPoint,
    /// The fault with which the drive stopped.
    #[serde(with = "fault_code")]
    pub fault: Option<Fault>,
    /// With the angle forced off: the last time, s after that, at which the drive was on with an error of 15° or more.
    pub wrong_s: f64,
    /// Saliency deficit over time; only for the first trial of each offset, for the figure.
    pub loss: Vec<(f64, f64)>,
    /// Disturbance in a run in which the drive must not stop, and the largest deficit that the monitor measured.
    pub kind: Option<HealthyKind>,
    /// See `kind`.
    pub largest_loss: f64,
    /// Largest angle error of such a run, or in the half second after an accepted start, degrees.
    pub largest_deg: f64,
    /// For a shaft that is driven past the limit: acceleration, rpm/s, and time from the limit to the switch-off, s;
    /// zero or less if the drive stopped before the limit.
    pub rpm_per_s: f64,
    /// See `rpm_per_s`.
    pub late_s: f64,
    /// Whether the drive continued after a flying start or a relock on a turning shaft.
    pub accepted: bool,
}

impl Trial {
    /// Whether a drive with its angle forced off was right or off in time.
    pub fn is_in_time(&self) -> bool {
        self.wrong_s <= if self.case.iq.abs() > IQ_A.0 { 0.5 } else { 1.5 }
    }

    /// Whether a start was refused, or led to a right angle.
    pub fn is_honest(&self) -> bool {
        !self.accepted || self.largest_deg < LOCKED_DEG
    }
}

/// Rotates the rotor flux by `degrees` at a random moment.
///
/// # Errors
/// As [`at_speed`], or if the drive stops before that moment.
pub fn forced(config: &Config, case: OperatingPoint, degrees: f64) -> Result<Trial, Error> {
    let mut random = seeded(case.seed ^ 0x5eed);
    let mut rig = at_speed(config, case)?;
    rig.wait(0.8 + random.random_range(0.0..0.2));
    if let Some(fault) = rig.drive.state().fault() {
        let (seed, fault) = (case.seed, fault.code());
        let why = format!("seed {seed}: fault {fault} before the angle was forced off");
        return Err(Error::Refused(why));
    }
    rig.plant.turn_rotor_flux(degrees.to_radians());
    let (start, mut wrong_s, mut loss) = (rig.time(), 0.0, Vec::new());
    while rig.time() < start + WATCH_S && rig.fault().is_none() {
        // One period of the injection: the drive itself acts no more often.
        rig.run(1.0 / 600.0, |p| {
            if p.angle_error_deg.abs() >= LOCKED_DEG {
                wrong_s = p.t - start;
            }
            loss.push((p.t - start, p.loss));
        });
    }
    loss.truncate(loss.len() - loss.len() % 10);
    let loss = loss.chunks(10).map(|c| c[9]).collect();
    Ok(Trial { case, wrong_s, fault: rig.drive.state().fault(), loss, ..Trial::default() })
}

words! {
    /// Disturbance in a run in which the drive must not stop, with its name in legends and tables.
    #[derive(Serialize, Deserialize)]
    pub enum HealthyKind {
        /// No disturbance, at a low speed.
        Slow = "within 150 rpm",
        /// No disturbance.
        Fast = "within 300 rpm",
        /// A reversal of the torque, at a low speed.
        Reversal = "torque reversed, within 150 rpm",
        /// A load step while the speed is regulated.
        LoadStep = "free shaft, load step of 0.6 Nm",
    }
}

/// Runs two seconds, after 0.3 s to settle; the disturbance comes after one second.
///
/// # Errors
/// As [`at_speed`].
pub fn healthy(config: &Config, seed: u64, kind: HealthyKind) -> Result<Trial, Error> {
    let case = case(seed, if kind == HealthyKind::Fast { 300.0 } else { 150.0 });
    let mut result = Trial { case, kind: Some(kind), ..Trial::default() };
    let mut look = |p: &Point| {
        result.largest_loss = result.largest_loss.max(p.loss);
        result.largest_deg = result.largest_deg.max(p.angle_error_deg.abs());
    };
    let mut rig = if kind == HealthyKind::LoadStep {
        load_step(config, case, &mut look)?
    } else {
        let mut rig = at_speed(config, case)?;
        rig.run(1.3, &mut look);
        if kind == HealthyKind::Reversal && rig.fault().is_none() {
            rig.command(&Command::Torque(-case.iq as f32))?;
        }
        rig
    };
    rig.run(1.0, &mut look);
    result.fault = rig.drive.state().fault();
    Ok(result)
}

/// Crossover of the speed loop in the load steps, rad/s, well below that of the tracking loop.
const SPEED_LOOP: f64 = 4.4;
/// Load, Nm.
const LOAD_NM: f64 = 0.6;

/// Regulates the speed by the estimate of the drive; the load comes after one of two seconds.
fn load_step(
    config: &Config,
    case: OperatingPoint,
    look: &mut impl FnMut(&Point),
) -> Result<Rig, Error> {
    let mut rig = at_speed(config, OperatingPoint { iq: 0.0, ..case })?;
    let motor = &config.drive.motor;
    let per_ampere = f64::from(motor.torque_per_ampere(config.drive.i_d()));
    let k_p = f64::from(config.drive.inertia()) * SPEED_LOOP / per_ampere;
    let (mut integral, mut estimate) = (0.0, case.rpm);
    rig.set_load(Load::Free { torque: 0.0 })?;
    let pace = 1.0 / 600.0;
    for n in 0..1380 {
        if rig.fault().is_some() {
            break;
        }
        if n == 600 {
            rig.set_load(Load::Free { torque: config.newton_metres(LOAD_NM) * case.iq.signum() })?;
        }
        let error = (case.rpm - estimate) * TAU / 60.0;
        integral += k_p * SPEED_LOOP / 4.0 * error * pace;
        let i_q = (k_p * error + integral).clamp(-IQ_A.1, IQ_A.1);
        rig.command(&Command::Torque(i_q as f32))?;
        rig.run(pace, |p| {
            estimate = p.speed_estimate_rpm;
            look(p);
        });
    }
    Ok(rig)
}

/// Time for which a drive beyond the limit is watched, s.
pub const OVER_SPEED_S: f64 = 0.5;

/// Accelerates at random from 70 % of `limit` rpm past the limit.
///
/// # Errors
/// As [`at_speed`].
pub fn over_speed(config: &Config, seed: u64, limit: f64) -> Result<Trial, Error> {
    let mut random = seeded(seed ^ 0x0ff);
    let mut case = case(seed, limit);
    case.rpm = 0.7 * limit.copysign(case.rpm);
    let rpm_per_s = 10.0_f64.powf(random.random_range(1.7..3.3));
    let mut rig = at_speed(config, case)?;
    rig.wait(0.5);
    let (mut rpm, mut late_s) = (case.rpm.abs(), 0.0);
    while rig.fault().is_none() && late_s < OVER_SPEED_S {
        rpm += rpm_per_s * 0.001;
        rig.turn(rpm.copysign(case.rpm))?;
        rig.wait(0.001);
        late_s = (rpm - limit) / rpm_per_s;
    }
    Ok(Trial { case, rpm_per_s, late_s, fault: rig.drive.state().fault(), ..Trial::default() })
}

/// Longest relock, s.
const LONGEST_RELOCK_S: f64 = 30.0;

/// Starts a drive, or relocks a running one, at `rpm`.
///
/// # Errors
/// As [`Rig::from_config`] and [`at_speed`].
pub fn start(config: &Config, rpm: f64, seed: u64, relock: bool) -> Result<Trial, Error> {
    let case = OperatingPoint { rpm, iq: if relock { 1.0 } else { 0.0 }, seed };
    let mut result = Trial { case, ..Trial::default() };
    let mut rig = if relock {
        let mut rig = at_speed(config, case)?;
        rig.wait(0.5);
        // The drive refuses a relock while the shaft turns.
        if rig.command(&Command::Relock).is_err() {
            return Ok(result);
        }
        rig.wait_until(LONGEST_RELOCK_S, |state| state.regulates() || state.is_off());
        rig
    } else {
        let mut config = config.clone();
        config.load.mode = LoadMode::Speed;
        config.load.speed_rpm = rpm;
        let mut rig = Rig::from_config(&config, seed)?;
        rig.begin(Mode::Torque)?;
        rig
    };
    if rig.drive.state().regulates() {
        rig.run(0.5, |p| result.largest_deg = result.largest_deg.max(p.angle_error_deg.abs()));
        // A drive that stops itself within this time has not accepted the start.
        result.accepted = rig.fault().is_none();
    }
    Ok(result)
}
