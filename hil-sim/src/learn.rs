//! The drive learns on its motor, with the shaft locked.

use drive_core::identify::learning::Learned;
use drive_core::settings::table::ReferenceTable;
use drive_core::{Command, Mode, State};

use crate::config::{Config, Demodulator, LoadMode};
use crate::error::Error;
use crate::rig::Rig;
use crate::stats::Stats;

/// Longest that a drive may learn, s: 30 points of 31 s at most, and the start.
const LONGEST_S: u32 = 1000;

/// Has the drive of a bench learn; the shaft must be locked. It is off afterwards and works with what
/// it learned.
///
/// # Errors
/// When it refuses the command, or stops with a fault.
pub fn with(rig: &mut Rig) -> Result<Learned, Error> {
    rig.command(&Command::Start(Mode::Learning))?;
    for _ in 0..LONGEST_S {
        rig.run(1.0, |_| {});
        match (rig.drive.state(), rig.drive.learned()) {
            (State::Off, Some(learned)) => return Ok(*learned),
            (State::Fault(fault), _) => {
                return Err(Error::Refused(format!("the drive does not learn: {fault}")));
            }
            _ => {}
        }
    }
    Err(Error::Refused(format!("the drive does not learn: it is {}", rig.drive.state())))
}

/// What the drive of the configuration learns.
///
/// # Errors
/// When the configuration is refused, or as [`with`].
pub fn on(config: &Config, seed: u64) -> Result<Learned, Error> {
    let mut config = config.clone();
    config.load.mode = LoadMode::Locked;
    with(&mut Rig::from_config(&config, seed)?)
}

/// Distance of the points, A.
const STEP_A: f64 = 0.25;
/// Last point, A: what the limits of the drive leave beside the magnetising current.
const LAST_A: f64 = 3.25;
/// Time for flux and averages to settle at each point, and to average, s.
const SETTLE_S: f64 = 0.6;
const AVERAGE_S: f64 = 0.5;

/// One point of the table.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Current on the quadrature axis, A.
    pub i_q: f64,
    /// What is seen at the right angle: the saliency, or the current difference in A.
    pub q: f64,
    /// How much it scattered, rms.
    pub scatter: f64,
    /// Carrier current along the injection axis, A.
    pub carrier: f64,
}

/// The table that the points make; odd, so without the first.
///
/// # Errors
/// When a value is beyond belief.
pub fn table(learned: &[Point]) -> Result<ReferenceTable, Error> {
    let later = learned.iter().skip(1).map(|point| (point.i_q as f32, point.q as f32));
    let points: Vec<_> = std::iter::once((0.0, 0.0)).chain(later).collect();
    ReferenceTable::new(&points).map_err(|error| Error::Refused(error.to_string()))
}

/// What a demodulation sees over the torque current, 0 A first: shaft locked, field orientation by
/// the slip alone (a locked encoder counts nothing), injection beside it. For the demodulations that
/// the drive does not learn for by itself.
///
/// # Errors
/// When the configuration is refused or the drive stops.
pub fn reference_of(
    demodulator: Demodulator,
    config: &Config,
    seed: u64,
) -> Result<Vec<Point>, Error> {
    let mut config = config.clone();
    config.injection.demodulator = demodulator;
    let mut rig = Rig::oriented(&config, seed)?;
    let points = (LAST_A / STEP_A).round() as usize;
    let mut table = Vec::with_capacity(points + 1);
    for n in 0..=points {
        let i_q = n as f64 * STEP_A;
        rig.command(&Command::Torque(i_q as f32))?;
        rig.run(SETTLE_S, |_| {});
        let (mut q, mut carrier) = (Stats::default(), Stats::default());
        rig.run(AVERAGE_S, |p| {
            q.push(p.signal());
            carrier.push(p.carrier);
        });
        table.push(Point { i_q, q: q.mean(), scatter: q.deviation(), carrier: carrier.mean() });
    }
    Ok(table)
}
