//! The commands of this program: lines that begin with `!`.

use std::path::PathBuf;

/// A command of this program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Own {
    /// Lists these commands.
    Help,
    /// Writes the drive's settings to a file.
    Backup(PathBuf),
    /// Sends the lines of a file to the drive.
    Restore(PathBuf),
    /// Draws the last trace.
    Plot(PathBuf),
    /// Ends the program.
    Quit,
}

/// Usage and meaning of every command.
pub const HELP: [(&str, &str); 5] = [
    ("!help", "lists the commands of this program; other lines go to the drive"),
    ("!backup FILE", "writes the drive's settings to a file"),
    ("!restore FILE", "sends the lines of such a file and lists those that the drive refuses"),
    ("!plot [FILE.svg]", "draws the last trace; the default file is out/trace.svg"),
    ("!quit", "ends this program; also quit or Ctrl-D"),
];

/// Default file of a plot.
const PLOT: &str = "out/trace.svg";

/// Returns the command to this program in a line: the text after `!`, and `quit` for `!quit`; `None` for a line to the drive.
pub fn to_program(line: &str) -> Option<&str> {
    match line.trim() {
        "quit" => Some("!quit"),
        line => line.starts_with('!').then_some(line),
    }
}

impl Own {
    /// Parses the command in a line; `None` for a line to the drive.
    ///
    /// # Errors
    /// The line begins with `!` but is no such command, or the file is missing.
    pub fn parse(line: &str) -> Result<Option<Self>, String> {
        let Some(line) = to_program(line) else { return Ok(None) };
        let (word, file) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let file = PathBuf::from(file.trim());
        let named = !file.as_os_str().is_empty();
        let own = match word {
            "!help" if !named => Self::Help,
            "!quit" if !named => Self::Quit,
            "!backup" if named => Self::Backup(file),
            "!restore" if named => Self::Restore(file),
            "!plot" if named => Self::Plot(file),
            "!plot" => Self::Plot(PLOT.into()),
            _ => {
                let usages = HELP.map(|(usage, _)| usage).join(", ");
                return Err(format!(
                    "`{line}`: no such command of this program; there are {usages}"
                ));
            }
        };
        Ok(Some(own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_for_this_program_or_for_the_drive() {
        for line in ["status", "backup", "help", " stop ", ""] {
            assert_eq!(Own::parse(line), Ok(None), "{line}");
        }
        assert_eq!(Own::parse(" quit "), Ok(Some(Own::Quit)));
        assert_eq!(Own::parse("!backup a b.txt"), Ok(Some(Own::Backup("a b.txt".into()))));
        assert_eq!(Own::parse("!plot"), Ok(Some(Own::Plot("out/trace.svg".into()))));
        for line in ["!", "!reset", "!backup", "!restore ", "!quit now"] {
            let why = Own::parse(line).unwrap_err();
            assert!(why.contains(line.trim()) && why.contains("!restore FILE"), "{why}");
        }
    }
}
