//! Procedure: break a sensor while the motor runs. The drive must switch off before the current in any phase leaves the range of the
//! sensors, and must not switch off without reason. The rows `torque-steps-...` of `rows.txt` check the latter.

use crate::common::{config, regulating};
use drive_core::{Fault, State};
use hil_sim::plant::{Channel, CurrentFault, EncoderFault};
use hil_sim::rig::Rig;

/// End of the sensors' range, A.
const RANGE_A: f64 = 4.47;

/// Steps until the drive has switched off, at most `periods`. Returns the number of steps, the fault, and the largest phase current until
/// then and afterwards, A.
fn until_off(rig: &mut Rig, periods: u32) -> (u32, Option<Fault>, f64) {
    let mut peak = 0.0_f64;
    let mut took = None;
    for n in 0..periods + 60 {
        rig.step();
        peak = rig.plant.phase_currents().iter().fold(peak, |p, i| p.max(i.abs()));
        if let State::Fault(fault) = rig.drive.state() {
            took.get_or_insert((n + 1, fault));
        }
    }
    took.map_or((periods, None, peak), |(n, fault)| (n, Some(fault), peak))
}

#[test]
fn a_broken_current_sensor_switches_off_in_time() {
    let faults = [
        ("open", CurrentFault::Open),
        ("stuck at 0 A", CurrentFault::Stuck(2022)),
        ("stuck at 1 A", CurrentFault::Stuck(2474)),
        ("at the top", CurrentFault::SaturatedHigh),
        ("at the bottom", CurrentFault::SaturatedLow),
    ];
    for source in ["angle_source=encoder", "angle_source=injection"] {
        for (name, fault) in faults {
            for channel in [Channel::A, Channel::B] {
                // At different moments of the electrical period.
                for (seed, settle) in [(1, 0.5), (2, 0.6), (3, 0.73), (4, 0.9)] {
                    let mut rig = regulating(&config(&[source]), seed, 2.0, settle);
                    rig.plant.set_current_fault(channel, fault);
                    let (_, found, peak) = until_off(&mut rig, 6000);
                    assert!(found.is_some(), "{source} {channel:?} {name}: not found");
                    assert!(peak < RANGE_A, "{source} {channel:?} {name}: {peak} A");
                }
            }
        }
    }
}

#[test]
fn a_dead_encoder_switches_off() {
    // At standstill a dead encoder cannot be distinguished from a shaft at rest; at 600 rpm and above the back-EMF reveals it.
    for rpm in [600, -900, 1440] {
        let speed = format!("load.speed_rpm={rpm}");
        let config = config(&["angle_source=encoder", "load.mode=speed", &speed]);
        let mut rig = regulating(&config, 1, 2.0, 0.5);
        rig.plant.set_encoder_fault(EncoderFault::Stuck);
        let (took, found, peak) = until_off(&mut rig, 6000);
        assert!(found.is_some() && took < 300, "{rpm} rpm: {found:?} after {took} periods");
        assert!(peak < RANGE_A, "{rpm} rpm: {peak} A");
    }
}
