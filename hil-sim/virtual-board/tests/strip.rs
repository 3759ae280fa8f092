//! The terminal strip of the image: contacts, reference and outputs at the pins of the chip.

use anyhow::{Result, ensure};
use hil_sim::Config;
use hil_sim::plant::Load;
use virtual_board::{Board, Image, Options};

/// Number of periods per millisecond.
const MS: u64 = 6;

struct Panel(Board);

impl Panel {
    /// Returns a board that its terminal strip commands.
    fn new() -> Result<Self> {
        let mut panel = Self(Board::new(Image::built()?, Options::new(&Config::default(), 3))?);
        panel.0.plant.set_load(Load::Free { torque: 0.0 })?;
        panel.hear("last run", 6000)?;
        let lines = [
            "angle encoder",
            "set wiring_checked yes speed.ramp_rpm_per_s 1000 strip.reference 4-20ma strip.reference_rpm 300",
            "set strip.enable yes strip.start switch strip.reset yes strip.outputs yes strip.brake yes",
            "set bus.commands strip",
        ];
        for line in lines {
            panel.say(line)?;
        }
        panel.0.set_reference([4.0; 2]);
        panel.0.type_line("save");
        panel.hear("ok", 6000)?;
        Ok(panel)
    }

    fn say(&mut self, line: &str) -> Result<()> {
        self.0.type_line(line);
        self.hear("ok", 500).map(drop)
    }

    fn wait(&mut self, ms: u64) -> Result<()> {
        self.0.run_periods(ms * MS)?;
        while self.0.next_period().is_some() {}
        Ok(())
    }

    /// Runs until the console has printed a text, for at most `ms`.
    fn hear(&mut self, text: &str, ms: u64) -> Result<String> {
        let mut heard = String::new();
        for _ in 0..ms / 10 {
            self.wait(10)?;
            heard += &self.0.take_console();
            if heard.contains(text) && heard.ends_with('\n') {
                return Ok(heard);
            }
        }
        anyhow::bail!("no {text:?} in {heard:?}")
    }

    /// Returns the milliseconds until the outputs are off, and whether the brake was closed at least 10 ms before.
    fn off(&mut self, ms: u64) -> Result<(u64, bool)> {
        let mut closed = None;
        for at in 0..ms {
            self.wait(1)?;
            if !self.0.chip().tim1.outputs_on() {
                // Time until that is reported.
                self.wait(5)?;
                return Ok((at, closed.is_some_and(|closed| at >= closed + 10)));
            }
            if !self.0.terminal_outputs()[2] {
                closed.get_or_insert(at);
            }
        }
        anyhow::bail!("the outputs stay on")
    }

    fn contact(&mut self, name: &str, closed: bool) -> Result<()> {
        self.0.set_contact(name, closed)?;
        self.wait(150)
    }

    fn on(&mut self) -> bool {
        self.0.chip().tim1.outputs_on()
    }

    fn rpm(&self) -> f64 {
        self.0.plant.mechanical_speed() * 60.0 / std::f64::consts::TAU
    }
}

#[test]
fn a_panel_drives_the_motor() -> Result<()> {
    let mut panel = Panel::new()?;
    // START alone, then ENABLE after it.
    panel.contact("START", true)?;
    panel.contact("ENABLE", true)?;
    ensure!(!panel.on(), "ENABLE starts");
    assert_eq!(panel.0.terminal_outputs(), [false; 3]);
    panel.contact("START", false)?;
    panel.0.set_contact("START", true)?;
    panel.hear("running: speed", 4000)?;
    assert_eq!(panel.0.terminal_outputs(), [true, false, true]);
    panel.0.set_reference([20.0; 2]);
    panel.wait(1500)?;
    assert!((panel.rpm() - 300.0).abs() < 15.0, "{} rpm", panel.rpm());
    // Stop by ramp: the brake closes before the torque ends.
    panel.0.set_contact("START", false)?;
    let (ms, closed_before) = panel.off(2000)?;
    assert!(ms > 150 && closed_before, "{ms} ms, {closed_before}");
    panel.wait(2000)?;
    // Stop by ENABLE, and no start when it returns.
    panel.0.set_contact("START", true)?;
    panel.hear("running: speed", 4000)?;
    panel.0.set_contact("ENABLE", false)?;
    let (ms, closed_before) = panel.off(400)?;
    // The brake closes first, and has 200 ms; then the torque goes to zero by its own slope, in 150 ms at most.
    assert!((200..=355).contains(&ms) && closed_before, "{ms} ms");
    assert_eq!(panel.0.terminal_outputs(), [false; 3]);
    panel.contact("ENABLE", true)?;
    panel.wait(1000)?;
    assert!(!panel.on());
    // The current loop is broken.
    panel.contact("START", false)?;
    panel.wait(2000)?;
    panel.0.set_contact("START", true)?;
    panel.hear("running: speed", 4000)?;
    panel.0.set_reference([0.0; 2]);
    panel.off(2000)?;
    panel.hear("below 3.6 mA", 100)?;
    assert_eq!(panel.0.terminal_outputs(), [false, true, false]);
    // Nothing starts when the supply returns, regardless of closed contacts.
    panel.0.set_reference([12.0; 2]);
    panel.0.unplug();
    let mut said = String::new();
    for _ in 0..300 {
        panel.wait(10)?;
        said += &panel.0.take_console();
        assert!(!panel.on());
    }
    assert!(said.contains("last run"));
    panel.contact("START", false)?;
    panel.0.set_contact("START", true)?;
    panel.hear("running: speed", 4000)?;
    Ok(())
}
