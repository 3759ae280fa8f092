//! Procedures of `tests/rows.txt` with the image, with the same bounds as on the host.

use std::f64::consts::TAU;

use crate::common::pair::Pair;
use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use hil_sim::plant::Plant;
use hil_sim::rig::wrapped_degrees;
use virtual_board::{Image, Options};

#[path = "../../../tests/rows/played.rs"]
mod played;
use played::{Bench, Seen, rows};

/// The board. The drive on the host beside it must put out the same compare values, and so has the same state.
struct OnBoard(Pair, Seen);

impl Bench for OnBoard {
    fn plant(&mut self) -> &mut Plant {
        &mut self.0.board.plant
    }

    fn state(&self) -> State {
        self.0.shadow.drive.state()
    }

    fn order(&mut self, line: &str) {
        self.0.order(line).unwrap();
    }

    fn period(&mut self) -> Seen {
        let seen = &mut self.1;
        let look = |pair: &Pair, _: &_| {
            let plant = &pair.board.plant;
            let phi = f64::from(pair.shadow.drive.telemetry().phi.to_turns()) * TAU;
            *seen = [
                wrapped_degrees(plant.rotor_flux_angle() - phi),
                plant.mechanical_angle() / TAU,
                plant.current().norm(),
            ];
        };
        self.0.run(1, look).unwrap();
        *seen
    }
}

#[test]
fn marked_rows_hold_with_the_image() -> Result<()> {
    for row in rows().filter(|row| row.on_board) {
        let config = Config::load(None, None, &row.changes)?;
        let mut options = Options::new(&config, *row.seeds.start()).set_up(&config)?;
        options.counting.cycles = false;
        let pair = Pair::new(Image::built()?, options)?;
        row.play(&mut OnBoard(pair, Seen::default()));
    }
    Ok(())
}
