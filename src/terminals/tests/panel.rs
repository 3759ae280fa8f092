//! The terminals beside console and bus, with the drive behind it.

use drive_core::{Command, Hardware, Measured, Mode, Stop};

use super::super::Contacts;
use crate::console::tests::Talk;
use crate::front::Front;
use crate::settings::Commander;

const ALL_OPEN: Contacts = Contacts(0);

/// A console with terminals that command, with a switch at START and a reference of 4 to 20 mA unless `lines` say otherwise; ENABLE is
/// closed.
struct Panel(Talk);

impl Panel {
    fn new(lines: &str) -> Self {
        let mut talk = Talk::new();
        let all = "set strip.enable yes strip.start switch strip.reset yes strip.reverse yes\n\
                   set strip.presets yes strip.preset_1_rpm 300 strip.preset_2_rpm 600 strip.preset_3_rpm 900\n\
                   set strip.reference_rpm 1500 strip.outputs yes strip.reference 4-20ma\n\
                   set bus.commands strip\n";
        talk.say(format!("{all}{lines}apply\n"));
        talk.drive.commands.clear();
        let mut panel = Self(talk);
        panel.ma(4.0);
        panel.contacts(Contacts::ENABLE);
        panel.0.say("");
        panel
    }

    /// Time passes, ms.
    fn wait(&mut self, ms: u32) {
        for _ in 0..ms {
            self.0.now_ms += 1;
            self.0.poll();
        }
    }

    /// Sets the contacts, and waits until START is armed.
    fn contacts(&mut self, closed: Contacts) {
        self.0.terminals.closed = closed;
        self.wait(200);
    }

    fn close(&mut self, contacts: Contacts) {
        self.contacts(Contacts(self.0.terminals.closed.0 | contacts.0));
    }

    fn open(&mut self, contacts: Contacts) {
        self.contacts(Contacts(self.0.terminals.closed.0 & !contacts.0));
    }

    fn ma(&mut self, ma: f32) {
        self.0.terminals.codes = [Some((ma / 20.0 * 3.0 / 3.3 * 4096.0).round() as u16); 3];
    }

    /// The drive regulates speed, as far as the terminals can tell.
    fn commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.0.drive.commands)
    }

    fn off(&self) -> bool {
        self.0.drive.drive.state().is_off()
    }
}

const START: Command = Command::Start(Mode::Speed);
const RAMP: Command = Command::Stop(Stop::Ramp);
const COAST: Command = Command::Stop(Stop::Coast);

#[test]
fn a_switch_starts_and_stops_with_the_reference_as_speed() {
    let mut panel = Panel::new("");
    assert_eq!((panel.commands(), panel.off()), (vec![], true));
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [START, Command::Speed(0.0)]);
    panel.ma(12.0);
    panel.wait(20);
    assert_eq!(panel.commands(), [Command::Speed(750.0)]);
    // Without a change nothing is told.
    panel.wait(500);
    assert_eq!(panel.commands(), []);
    // Preset speeds have priority over the reference; the direction is that of the start.
    panel.close(Contacts(1 << 5));
    panel.close(Contacts(1 << 6));
    panel.open(Contacts(1 << 5));
    panel.close(Contacts::REVERSE);
    let presets = [300.0, 900.0, 600.0].map(Command::Speed);
    assert_eq!(panel.commands(), presets);
    assert_eq!(panel.0.terminals.outputs, [true, false, false]);
    panel.open(Contacts::START);
    assert_eq!(panel.commands()[0], RAMP);
    assert!(panel.off());
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [START, Command::Speed(-600.0)]);
    for line in ["start", "speed 1", "torque 1"] {
        assert!(panel.0.ask(line).starts_with("error: the terminal strip commands"), "{line}");
    }
    assert_eq!(panel.0.ask("stop"), "ok");
    // START is still closed.
    panel.wait(1000);
    assert_eq!(panel.commands(), [COAST]);
}

#[test]
fn buttons_start_by_an_edge_and_a_broken_wire_of_stop_stops() {
    let mut panel = Panel::new("set strip.start buttons\n");
    // STOP is open.
    panel.close(Contacts::START);
    panel.open(Contacts::START);
    panel.close(Contacts::STOP);
    assert_eq!(panel.commands(), []);
    panel.close(Contacts::START);
    panel.open(Contacts::START);
    assert_eq!((panel.commands(), panel.off()), (vec![START, Command::Speed(0.0)], false));
    panel.0.terminals.closed = Contacts::ENABLE;
    panel.wait(3);
    assert_eq!(panel.commands(), [RAMP]);
    panel.close(Contacts::STOP);
    assert_eq!((panel.commands(), panel.off()), (vec![], true));
}

/// A contact that is closed when the terminals begin to command, at power-up or by a setting, starts nothing, in any order of the contacts.
#[test]
fn no_start_by_power_or_by_a_change_of_the_commander() {
    for start in ["switch", "buttons"] {
        let mut panel = Panel::new(&format!("set strip.start {start}\n"));
        let all = Contacts(0x1f);
        let settings = *panel.0.front.desk.settings().in_force();
        // The supply of the contacts comes after the chip's supply, and bounces.
        for late in [0, 1, 30, 3000] {
            panel.0.front = Front::new(settings);
            panel.0.terminals.closed = ALL_OPEN;
            panel.wait(late);
            for bounce in 0..40 {
                panel.0.terminals.closed = if bounce % 3 == 0 { ALL_OPEN } else { all };
                panel.wait(1);
            }
            panel.contacts(all);
            // RESET was open, too.
            assert!(panel.commands().iter().all(|c| *c == Command::Clear), "{start} {late}");
        }
        panel.0.say("set bus.commands console\napply\n");
        panel.contacts(Contacts(0x1f & !Contacts::START.0));
        panel.contacts(all);
        panel.0.say("set bus.commands strip\napply\n");
        panel.wait(1000);
        assert_eq!(panel.commands(), []);
        assert_eq!(panel.0.front.desk.commander(), Commander::Terminals);
        panel.open(Contacts::START);
        panel.close(Contacts::START);
        assert_eq!(panel.commands()[0], START);
    }
}

#[test]
fn enable_stops_whoever_commands_and_starts_nothing() {
    for commander in ["console", "bus", "strip"] {
        let mut panel = Panel::new(&format!("set bus.commands {commander}\n"));
        panel.contacts(ALL_OPEN);
        if commander == "console" {
            let held = "error: the terminal strip holds the drive: ENABLE is open";
            for line in ["start", "start speed", "learn", "commission"] {
                assert_eq!(panel.0.say(format!("{line}\n")).last().unwrap(), held, "{line}");
            }
        }
        // START closes first.
        panel.close(Contacts::START);
        panel.close(Contacts::ENABLE);
        panel.wait(1000);
        assert_eq!(panel.commands(), [], "{commander}");
        // Another commander has a start of its own.
        panel.open(Contacts::START);
        panel.0.drive.drive.command(&START).unwrap();
        panel.commands();
        panel.0.terminals.closed = Contacts::START;
        panel.wait(2);
        assert_eq!((panel.commands(), panel.off()), (vec![COAST], true), "{commander}");
        panel.close(Contacts::ENABLE);
        panel.wait(1000);
        assert_eq!(panel.commands(), [], "{commander}");
    }
}

#[test]
fn after_a_fault_the_start_needs_a_new_edge() {
    let mut panel = Panel::new("");
    panel.close(Contacts::START);
    panel.0.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    assert_eq!(panel.commands(), [START, Command::Speed(0.0)]);
    panel.wait(2);
    assert!(panel.0.terminals.outputs == [false, true, false]);
    // With the fault latched a new edge is refused, and the refusal is told.
    panel.open(Contacts::START);
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [START]);
    let told = |line: &String| line.starts_with("* strip: refused: fault 20 is latched");
    let said = panel.0.say("");
    assert!(said.iter().any(told), "{said:?}");
    panel.close(Contacts::RESET);
    panel.wait(1000);
    assert_eq!(panel.commands(), [Command::Clear]);
    assert!(!panel.0.terminals.outputs[1]);
    panel.open(Contacts::START);
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [START, Command::Speed(0.0)]);
}

#[test]
fn a_lost_reference_ramps_to_zero_and_is_latched_by_name() {
    let mut panel = Panel::new("");
    panel.close(Contacts::START);
    panel.ma(12.0);
    panel.wait(30);
    assert_eq!(panel.commands(), [START, Command::Speed(0.0), Command::Speed(750.0)]);
    // A disturbance of less than 20 ms holds the speed.
    panel.ma(0.0);
    panel.wait(15);
    panel.ma(12.0);
    panel.wait(100);
    assert_eq!(panel.commands(), []);
    panel.ma(2.0);
    panel.wait(40);
    assert_eq!(panel.commands()[0], RAMP);
    let said = panel.0.say("");
    let why = "below 3.6 mA: a broken wire, or no supply";
    assert!(said.iter().any(|line| line.contains(why)), "{said:?}");
    assert!(panel.0.ask("status").contains(why));
    assert!(panel.off() && panel.0.terminals.outputs[1]);
    // The reference comes back: the fault is latched, and a new edge is not enough.
    panel.ma(12.0);
    panel.wait(1000);
    panel.open(Contacts::START);
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), []);
    panel.close(Contacts::RESET);
    panel.wait(1000);
    assert_eq!(panel.commands(), []);
    panel.open(Contacts::START);
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [START, Command::Speed(750.0)]);
    // With a preset speed the reference does not matter.
    panel.close(Contacts(1 << 5));
    panel.ma(0.0);
    panel.wait(1000);
    assert_eq!(panel.commands(), [Command::Speed(300.0)]);
}

/// A brake: the drive is told before each start that there is one, the output opens the brake while the drive regulates, and a fault
/// message says what holds the load.
#[test]
fn a_brake_is_told_to_the_drive_and_opens_only_while_it_regulates() {
    let mut panel = Panel::new("set strip.brake yes strip.brake_s 0.3\n");
    panel.close(Contacts::START);
    assert_eq!(panel.commands(), [Command::Brake(0.3), START, Command::Speed(0.0)]);
    assert_eq!(panel.0.terminals.outputs, [true, false, false], "closed until it regulates");
    panel.0.drive.drive.step(&Measured { hardware: Hardware::BREAK, ..Measured::default() });
    panel.wait(2);
    let said = panel.0.say("").concat();
    assert!(said.contains("the brake closes now and holds the load alone"), "{said}");
    assert_eq!(panel.0.terminals.outputs, [false, true, false]);
    // Without a brake the drive is told so once.
    panel.0.say("clear\nset strip.brake no\napply\n");
    panel.commands();
    for told in [Some(Command::Brake(0.0)), None] {
        panel.open(Contacts::START);
        panel.close(Contacts::START);
        let commands = panel.commands();
        let all: Vec<_> = told.into_iter().chain([START]).collect();
        assert_eq!(commands[..all.len()], all, "{commands:?}");
        panel.0.say("stop now\n");
        panel.commands();
    }
}
