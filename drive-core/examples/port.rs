//! The drive on another chip.
//!
//! A port consists of four things: a board (access to the timer, the ADCs and the encoder), settings with the scales of its sensors, an
//! interrupt that calls [`Drive::period`] 6000 times a second, and a task that gives commands. Here the board is a host that reads zero
//! currents. On a chip, its functions access registers, and the channel is a queue for one producer and one consumer, such as
//! `heapless::spsc::Queue`.
//!
//! `cargo run -p induction-drive-core --example port`

use std::error::Error;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use induction_drive_core::{
    Accepted, Command, Compare, Drive, FrontEndState, Line, Mode, Refused, Sample,
};
use induction_drive_settings::{Ntc, Scales, Settings};

/// Hardware access of the interrupt. The board of this example: no current flows, 48 V, 25 °C.
#[derive(Default)]
struct Board {
    /// Whether the precharge relay is closed.
    relay: bool,
}

impl Board {
    /// Returns the readings of this period, without a third shunt, an encoder and flags of the chip. The currents were sampled in the
    /// middle of the on-time of the low sides.
    fn sample(&mut self) -> Sample {
        let (current_a, current_b) = (2048, 2048);
        Sample { current_a, current_b, dc_link: 1820, heat_sink: 1309, ..Sample::default() }
    }

    /// Loads the compare registers for the next period, and switches the outputs off at once if `enabled` is false.
    fn output(&mut self, _: &Compare) {}

    /// Sets the switches of the dc link: the duty of the brake chopper, and whether the precharge relay is closed. A board
    /// that has neither leaves this function empty.
    fn dc_link(&mut self, _chopper: f32, relay: bool) {
        self.relay = relay;
    }
}

/// ADC counts: 12 bits.
const CODES: u16 = 4096;
/// Reference of the ADCs, V.
const REFERENCE_V: f32 = 3.3;

/// Returns the settings: your own motor, nameplate and sensors. All other settings follow from them by rules. If a
/// design cannot be made, the error names the reason.
fn settings() -> Settings {
    let mut settings = Settings::default();
    // This is a motor with a winding for 48 V, from its data sheet: T-equivalent circuit per phase, star.
    let motor = &mut settings.motor;
    (motor.r_s, motor.r_r) = (0.22, 0.13);
    (motor.l_ls, motor.l_lr, motor.l_m) = (0.8e-3, 0.8e-3, 9.0e-3);
    let nameplate = &mut settings.nameplate;
    (nameplate.power_w, nameplate.voltage_v, nameplate.current_a) = (250.0, 32.0, 8.0);
    (nameplate.frequency_hz, nameplate.speed_rpm) = (50.0, 1400.0);
    settings.inverter.dc_link_v = 48.0;
    // The timer counts up and down once a period: clock / 12 kHz.
    settings.inverter.top = 14_167;
    // The shunts have 5 mohm and are amplified 20 times around half of the reference.
    let current = Line::of_sensor(0.005 * 20.0, 0.5 * REFERENCE_V, REFERENCE_V, CODES);
    settings.scales = Scales {
        current_a: current,
        current_b: current,
        // The divider is 22 kohm over 680 ohm.
        dc_link: Line::of_sensor(0.68 / 22.68, 0.0, REFERENCE_V, CODES),
        ntc: Ntc { ohm_25: 10_000.0, beta_k: 3435.0, divider_ohm: 4700.0, to_ground: false },
        current_delay_s: 2e-6,
        ..Scales::default()
    };
    settings
}

/// The control interrupt, which owns the drive. The task reaches the drive through two queues only, so that a command
/// is never taken while a step runs.
struct Interrupt {
    board: Board,
    drive: Drive,
    front_end: FrontEndState,
    commands: Receiver<Command>,
    answers: SyncSender<Result<Accepted, Refused>>,
}

impl Interrupt {
    /// Runs one control period; called once a PWM period, at the highest priority.
    fn on_period(&mut self) {
        let sample = self.board.sample();
        let put_out = &mut |compare| self.board.output(&compare);
        let (_, output) = self.drive.period(&mut self.front_end, &sample, put_out);
        self.board.dc_link(output.chopper, output.relay);
        // Commands are taken in the rest of the period.
        if let Ok(command) = self.commands.try_recv() {
            let _ = self.answers.try_send(self.drive.command(&command));
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let settings = settings();
    // The design takes a second on a chip, so the outputs are off.
    let coefficients = settings.build()?;
    // If the flash holds the result of a self-commissioning with these settings, `coefficients.take` it here.

    let (order, commands) = sync_channel(1);
    let (answers, answer) = sync_channel(1);
    let drive = Drive::new(coefficients);
    let front_end = FrontEndState::default();
    let mut interrupt = Interrupt { board: Board::default(), drive, front_end, commands, answers };

    // The task sends one command and receives one answer.
    order.send(Command::Start(Mode::Torque))?;
    interrupt.on_period();
    println!("start: {:?}", answer.recv()?);

    // The interrupt runs for a second. Without a motor the drive finds that no current flows.
    for _ in 0..6000 {
        interrupt.on_period();
    }
    println!("the drive is {}", interrupt.drive.state());

    // Whenever a self-commissioning has ended, write its result to the flash, beside the settings to which it belongs.
    if let Some(learned) = interrupt.drive.learned().filter(|found| found.verdict.is_accepted()) {
        println!("learned {} points", learned.points);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The dc link of the board is steady from the beginning, so the relay closes after its delay.
    #[test]
    fn the_precharge_relay_closes() {
        let mut settings = settings();
        settings.supply.relay_s = 0.1;
        let drive = Drive::new(settings.build().unwrap());
        let (commands, answers) = (sync_channel(1).1, sync_channel(1).0);
        let (board, front_end) = (Board::default(), FrontEndState::default());
        let mut interrupt = Interrupt { board, drive, front_end, commands, answers };
        let mut closed = |periods: u32| {
            (0..periods).for_each(|_| interrupt.on_period());
            interrupt.board.relay
        };
        assert_eq!((closed(300), closed(3000)), (false, true));
    }
}
