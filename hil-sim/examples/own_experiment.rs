//! An experiment of one's own: another motor at standstill with a torque that swings, as CSV.
//!
//! `cargo run --release -p hil-sim --example own_experiment > swing.csv`

use drive_core::{Command, Mode};
use hil_sim::Config;
use hil_sim::rig::Rig;

fn main() -> Result<(), hil_sim::error::Error> {
    // A motor of the folder `motors`, and keys as --set takes them.
    let mut config = Config::of_motor(Some("motulator-2kw2"))?;
    config.set("load.mode", "locked")?;

    // The drive learns the motor first, because the motor's file says so.
    let mut rig = Rig::started(&config, 1, Mode::Torque)?;
    let start = rig.time();
    println!("time_s,torque_nm,angle_error_deg");
    for _ in 0..500 {
        let swing = (std::f64::consts::TAU * 0.5 * (rig.time() - start)).sin();
        rig.command(&Command::Torque((config.amperes(1.5) * swing) as f32))?;
        let mut last = Default::default();
        rig.run(0.01, |point| last = *point);
        println!("{:.3},{:.4},{:.3}", last.t - start, last.torque, last.angle_error_deg);
    }
    Ok(())
}
