//! How fast torque comes where the voltage gives the angle.

use std::f64::consts::TAU;

use drive_core::{Command, Mode, State};
use hil_sim::Config;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;

/// Nine tenths of the torque come 1.5 to 5.2 ms after the command, motoring and generating, also where the dc link limits the
/// first periods of the step (from 1800 rpm on): what was limited follows. If it were lost, 3 A at 1800 rpm took 6.8 ms.
#[test]
fn torque_follows_a_step_that_the_dc_link_limits() {
    let config = Config::load(None, None, &["prepare.learn=yes".to_owned()]).expect("settings");
    let config = for_the_range(&config).expect("settings");
    for rpm in [800.0, 1800.0, 2100.0, 2700.0, 3600.0] {
        for ampere in [2.0, 3.0, -3.0] {
            let mut rig = Rig::from_config(&config, 5).expect("a bench");
            rig.start(Mode::Torque).expect("a start");
            for n in 1..=100 {
                let speed = rpm * TAU / 60.0 * f64::from(n) / 100.0;
                rig.set_load(Load::Speed { speed }).expect("a load");
                rig.run(0.01 * rpm / 1000.0, |_| {});
            }
            rig.run(0.5, |_| {});
            rig.command(&Command::Torque(ampere)).expect("a torque");
            let mut torque = Vec::new();
            rig.run(0.5, |point| torque.push(point.torque));
            assert_eq!(rig.drive.state(), State::Torque);
            let last = torque[2400..].iter().sum::<f64>() / 600.0;
            assert!(last / f64::from(ampere) > 0.2, "{last} Nm");
            let took =
                torque.iter().position(|now| now / last > 0.9).expect("a torque") as f64 / 6.0;
            assert!(took < 5.5, "{rpm} rpm, {ampere} A: {took:.1} ms");
        }
    }
}
