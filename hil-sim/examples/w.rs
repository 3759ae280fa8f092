use drive_core::{Command, Mode, State};
use hil_sim::config::Config;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;
use std::f64::consts::TAU;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let set: Vec<String> = args[5..].to_vec();
    let c = Config::load(None, None, &set).unwrap();
    let mut rig = Rig::from_config(&c, args[4].parse().unwrap()).unwrap();
    let rpm: f64 = args[2].parse().unwrap();
    let iq: f32 = args[3].parse().unwrap();
    let free = args[1] == "free";
    if free {
        rig.set_load(Load::Free { torque: 0.0 }).unwrap();
        rig.start(Mode::Speed).unwrap();
    } else {
        rig.set_load(Load::Speed { speed: 0.0 }).unwrap();
        rig.start(Mode::Torque).unwrap();
    }
    let mut n = 0;
    let steps = (rpm.abs() / 600.0 / 0.01).ceil().max(1.0);
    if free {
        rig.drive.command(&Command::Speed(rpm as f32)).unwrap();
    }
    loop {
        n += 1;
        let share = (f64::from(n) / steps).min(1.0);
        if !free {
            rig.set_load(Load::Speed { speed: rpm * TAU / 60.0 * share }).unwrap();
        }
        let mut e = (0.0, 0.0, 0.0, 0.0, 0.0);
        rig.run(0.01, |p| {
            e.0 += p.angle_error_deg;
            e.1 += 1.0;
            e.2 = p.speed_rpm;
            e.3 = p.flux;
            e.4 = p.torque;
        });
        let t = rig.drive.telemetry();
        if n % 5 == 0 {
            println!(
                "{:.2} rpm {:.0} psi {:.2} torque {:.2} err {:.1} id {:.2} iq {:.2} loss {:.2} {:?}",
                0.01 * n as f64,
                e.2,
                e.3,
                e.4,
                e.0 / e.1,
                t.current.d,
                t.current.q,
                t.saliency_loss,
                rig.drive.dbg()
            );
        }
        if !free && f64::from(n) == steps + 30.0 {
            rig.drive.command(&Command::Torque(iq)).unwrap();
        }
        if let State::Fault(f) = rig.drive.state() {
            println!("{f}");
            break;
        }
        if f64::from(n) > steps + 300.0 {
            break;
        }
    }
}
