//! The commands of the board itself: lines that begin with `!`. All other lines go to the console of the firmware.

use hil_sim::console::own::to_program;

/// A command of the board.
#[derive(Clone, Debug, PartialEq)]
pub enum Own {
    /// Lists these commands.
    Help,
    /// Presses the reset button.
    Reset,
    /// Takes the supply of the controller away and gives it back.
    Unplug,
    /// Ends the session.
    Quit,
    /// Closes or opens a contact of the terminal strip.
    Contact(String, bool),
    /// Gives the analog reference a current, mA.
    Reference(f64),
}

/// Names and meanings.
#[rustfmt::skip]
const COMMANDS: [(&str, Own, &str); 4] = [
    ("!help", Own::Help, "lists the commands of the board; other lines go to the drive"),
    ("!reset", Own::Reset, "presses the reset button: RAM and flash keep their contents"),
    ("!unplug", Own::Unplug, "unplugs the controller and plugs it in again: RAM is lost, flash stays"),
    ("!quit", Own::Quit, "ends the session and writes the page; also quit"),
];

impl Own {
    /// The command in a line; `None` for a line to the drive.
    ///
    /// # Errors
    /// The line begins with `!`, and there is no such command.
    pub fn parse(line: &str) -> Result<Option<Self>, String> {
        let Some(line) = to_program(line) else { return Ok(None) };
        match line.split_once(' ') {
            Some(("!close", name)) => return Ok(Some(Self::Contact(name.to_owned(), true))),
            Some(("!open", name)) => return Ok(Some(Self::Contact(name.to_owned(), false))),
            Some(("!reference", ma)) => {
                let ma = ma.parse().map_err(|_| format!("`{line}`: not a number of mA"))?;
                return Ok(Some(Self::Reference(ma)));
            }
            _ => {}
        }
        let known = COMMANDS.iter().find(|(name, ..)| *name == line);
        known.map(|(_, own, _)| Some(own.clone())).ok_or_else(|| {
            let names = COMMANDS.map(|(name, ..)| name).join(", ");
            format!("`{line}`: no such command of the board; there are {names}")
        })
    }

    /// A line about each command.
    pub fn help() -> impl Iterator<Item = String> {
        let strip = "!close, !open TERMINAL, !reference MA set the wires of the terminal strip";
        let known = COMMANDS.iter().map(|(name, _, meaning)| format!("{name:<8} {meaning}"));
        known.chain([strip.to_owned()])
    }
}
