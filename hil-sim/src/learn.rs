//! Learning the reference of the synchronous demodulation with the shaft locked.

use drive_core::{Command, Mode};

use crate::config::{AngleSource, Config, Demodulator, LoadMode};
use crate::error::Error;
use crate::rig::Rig;
use crate::stats::Stats;

/// Distance of the points, A.
const STEP_A: f64 = 0.25;
/// Last point, A: what the limits of the drive leave beside the magnetising current.
const LAST_A: f64 = 3.25;
/// Time for flux and averages to settle at each point, and to average, s.
const SETTLE_S: f64 = 0.6;
const AVERAGE_S: f64 = 0.5;

/// One point of the table.
#[derive(Clone, Copy, Debug)]
pub struct Learned {
    /// Current on the quadrature axis, A.
    pub i_q: f64,
    /// The saliency seen at the right angle.
    pub q: f64,
    /// How much it scattered, rms.
    pub scatter: f64,
    /// Carrier current along the injection axis, A.
    pub carrier: f64,
}

/// The saliency over the torque current, 0 A first: shaft locked, field orientation by the slip
/// alone (a locked encoder counts nothing), injection beside it.
///
/// # Errors
/// When the configuration is refused or the drive stops.
pub fn reference(config: &Config, seed: u64) -> Result<Vec<Learned>, Error> {
    let mut config = config.clone();
    config.angle.source = AngleSource::Encoder;
    config.load.mode = LoadMode::Locked;
    config.injection.demodulator = Demodulator::Synchronous;
    let mut drive = crate::rig::drive_settings(&config);
    drive.injection.beside_encoder = true;
    let mut rig = Rig::new(&crate::rig::plant_settings(&config), &drive, seed)?;
    rig.start(Mode::Torque)?;
    let points = (LAST_A / STEP_A).round() as usize;
    let mut table = Vec::with_capacity(points + 1);
    for n in 0..=points {
        let i_q = n as f64 * STEP_A;
        rig.command(Command::Torque(i_q as f32))?;
        rig.run(SETTLE_S, |_| {});
        let (mut q, mut carrier) = (Stats::default(), Stats::default());
        rig.run(AVERAGE_S, |p| {
            q.push(p.saliency);
            carrier.push(p.carrier);
        });
        table.push(Learned { i_q, q: q.mean(), scatter: q.deviation(), carrier: carrier.mean() });
    }
    Ok(table)
}
