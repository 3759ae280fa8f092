//! The image with the loop of the dissertation: it runs the printed demodulators and the PII controller, and computes the bits of the host.

use crate::common::pair::Pair;
use anyhow::{Result, ensure};
use drive_core::printed::DemodulatorKind;
use drive_core::{Fault, State};
use hil_sim::Config;
use virtual_board::{Image, Options};

/// Cycles of the control interrupt that `docs/sources.md` names.
const CYCLES: u32 = 4_000;

/// The chain as printed cannot track, so its angle and then the drive is lost; the rectified one tracks a shaft at rest. Every period of
/// both is compared (see `Shadow::follow`).
#[test]
fn the_printed_chains_run_on_the_board_as_on_the_host() -> Result<()> {
    for (demodulator, seed) in [(DemodulatorKind::Literal, 21), (DemodulatorKind::Rectified, 22)] {
        let mut config = Config::default();
        config.drive.injection.demodulator = demodulator;
        let options = Options::new(&config, seed).set_up(&config)?;
        let mut pair = Pair::new(Image::built_for("printed")?, options)?;
        pair.start_torque()?;
        pair.board.longest = Default::default();
        pair.order("torque 1")?;
        pair.run(600, |_, _| {})?;
        let cycles = pair.board.longest.cycles;
        ensure!(pair.shadow.drive.telemetry().delta_i != 0.0, "{demodulator:?}: no demodulation");
        pair.run(6000, |_, _| {})?;
        let (state, compared) = (pair.shadow.drive.state(), pair.shadow.compared);
        let expected = match demodulator {
            DemodulatorKind::Literal => State::Fault(Fault::CurrentNotAsPredicted),
            _ => State::Torque,
        };
        ensure!(state == expected && compared > 12_000, "{demodulator:?}: {state}, {compared}");
        ensure!(cycles < CYCLES, "{demodulator:?}: {cycles} cycles");
    }
    Ok(())
}
