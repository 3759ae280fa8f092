//! The terminals beside the console, with the drive behind it.

use drive_core::{Command, Mode};

use super::super::Contacts;
use crate::console::tests::Talk;
use crate::front::Front;
use crate::settings::Commander;

/// Waits with these contacts closed; returns the commands to the drive.
fn with(talk: &mut Talk, closed: u8, ms: u32) -> Vec<Command> {
    talk.terminals.closed = Contacts(closed);
    talk.wait(ms);
    std::mem::take(&mut talk.drive.commands)
}

/// A contact that is closed when the terminals begin to command, at power-up or by a setting, starts nothing, in any order of the contacts.
#[test]
fn no_start_by_power_or_by_a_change_of_the_commander() {
    const ALL: u8 = 0x1f;
    for start in ["switch", "buttons"] {
        let mut talk = Talk::new();
        let enable = format!("set strip.enable yes strip.start {start} strip.reset yes");
        let reference = "set strip.reverse yes strip.reference 4-20ma bus.commands strip";
        talk.say(format!("{enable}\n{reference}\napply\n"));
        talk.terminals.codes = [Some(745); 3];
        let settings = *talk.front.desk.settings().in_force();
        // The supply of the contacts comes after the chip's supply, and bounces.
        for late in [0, 1, 30, 3000] {
            talk.front = Front::new(settings);
            let mut commands = with(&mut talk, 0, late);
            for bounce in 0..40 {
                commands.extend(with(&mut talk, if bounce % 3 == 0 { 0 } else { ALL }, 1));
            }
            commands.extend(with(&mut talk, ALL, 200));
            // RESET was open, too.
            commands.retain(|command| !matches!(command, Command::Clear | Command::Configure(_)));
            assert_eq!(commands, [], "{start} {late}");
        }
        talk.say("set bus.commands console\napply\n");
        with(&mut talk, ALL & !Contacts::START.0, 200);
        with(&mut talk, ALL, 200);
        talk.say("set bus.commands strip\napply\n");
        assert_eq!(with(&mut talk, ALL, 1000), []);
        assert_eq!(talk.front.desk.commander(), Commander::Terminals);
        with(&mut talk, ALL & !Contacts::START.0, 200);
        assert_eq!(with(&mut talk, ALL, 200)[0], Command::Start(Mode::Speed));
    }
}
