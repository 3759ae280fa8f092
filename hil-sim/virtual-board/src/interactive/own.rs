//! The commands of the board itself: lines that begin with `!`. All other lines go to the console of the firmware.

use hil_sim::console::own::to_program;

/// A command of the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Own {
    /// Lists these commands.
    Help,
    /// Presses the reset button.
    Reset,
    /// Interrupts the supply of the controller for a moment.
    Unplug,
    /// Closes these contacts of the terminal strip, opens the others, and sets the current of the reference.
    Wires(String),
    /// Switches the supplies of the power stage.
    Stage(bool),
    /// Ends the session.
    Quit,
}

/// Names and meanings.
#[rustfmt::skip]
static COMMANDS: [(&str, Own, &str); 7] = [
    ("!help", Own::Help, "lists the commands of the board; other lines go to the drive"),
    ("!reset", Own::Reset, "presses the reset button: RAM and flash keep their contents"),
    ("!unplug", Own::Unplug, "unplugs the controller and plugs it in again: RAM is lost, flash stays"),
    ("!stage off", Own::Stage(false), "switches off the supplies of gate drivers and dc link, as `update` requires"),
    ("!stage on", Own::Stage(true), "switches them on again"),
    ("!wires", Own::Wires(String::new()), "terminal strip: `!wires ENABLE START 12` closes these contacts and no others, and sets 12 mA"),
    ("!quit", Own::Quit, "ends the session and writes the page; also quit"),
];

impl Own {
    /// Parses the command in a line; `None` for a line to the drive.
    ///
    /// # Errors
    /// The line begins with `!`, but there is no such command.
    pub fn parse(line: &str) -> Result<Option<Self>, String> {
        let Some(line) = to_program(line) else { return Ok(None) };
        if let Some(wires) = line.strip_prefix("!wires ") {
            return Ok(Some(Self::Wires(wires.to_owned())));
        }
        let known = COMMANDS.iter().find(|(name, ..)| *name == line);
        known.map(|(_, own, _)| Some(own.clone())).ok_or_else(|| {
            let names = COMMANDS.each_ref().map(|(name, ..)| *name).join(", ");
            format!("`{line}`: no such command of the board; there are {names}")
        })
    }

    /// Returns a line about each command.
    pub fn help() -> impl Iterator<Item = String> {
        COMMANDS.iter().map(|(name, _, meaning)| format!("{name:<10} {meaning}"))
    }
}
