//! The procedures of `rows.txt` on the simulated bench. The image plays some of them on the emulated board.

mod played;

use crate::common::config;
use crate::replay::player::Player;
use drive_core::State;
use hil_sim::plant::Plant;
use hil_sim::rig::{RATE_HZ, Rig};
use induction_drive::settings::FirmwareSettings;
use played::{Bench, Seen, rows};

/// The simulated bench, whose drive gets commands at once.
struct OnHost(Rig, Player);

impl Bench for OnHost {
    fn plant(&mut self) -> &mut Plant {
        &mut self.0.plant
    }

    fn state(&self) -> State {
        self.0.drive.state()
    }

    fn order(&mut self, line: &str) {
        self.1.order(&mut self.0.drive, line);
    }

    fn period(&mut self) -> Seen {
        let mut seen = Seen::default();
        self.0.run(1.0 / RATE_HZ, |p| seen = [p.angle_error_deg, p.turns, p.current]);
        seen
    }
}

#[test]
fn each_row_holds_on_the_bench() {
    assert!(rows().filter(|row| row.on_board).count() >= 5, "the board plays too few");
    for row in rows() {
        let config = config(&row.changes);
        let settings = FirmwareSettings { drive: config.drive, ..FirmwareSettings::of_the_board() };
        for seed in row.seeds.clone() {
            let rig = Rig::from_config(&config, seed).unwrap();
            row.play(&mut OnHost(rig, Player::new(&settings)));
        }
    }
}
