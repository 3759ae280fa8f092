//! The commands and settings of a drive, as the drive lists them; and the completion of a line from them.

use drive_stream::client::Answer;
use serde_json::Value;

use super::link::{Link, LinkError};
use super::own;

/// A command, or a setting after `set`, with the words that can follow it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Known {
    name: String,
    words: Vec<String>,
}

/// Everything that can be completed.
#[derive(Clone, Debug, Default)]
pub struct Catalogue {
    commands: Vec<Known>,
    settings: Vec<Known>,
}

impl Catalogue {
    /// Asks a drive for its commands and settings.
    ///
    /// # Errors
    /// The drive does not answer.
    pub fn read(link: &mut Link) -> Result<Self, LinkError> {
        let commands = commands(&link.ask("help", |_| ())?);
        let described = link.ask("describe", |_| ())?;
        let settings = described.contents().iter().filter_map(|line| described_setting(line));
        Ok(Self { commands, settings: settings.collect() })
    }

    /// Number of settings.
    pub fn settings(&self) -> usize {
        self.settings.len()
    }

    /// Returns the completion of a line: the position of its last word, and the candidates for that word.
    pub fn complete(&self, line: &str) -> (usize, Vec<String>) {
        let begin = line.rfind(char::is_whitespace).map_or(0, |at| at + 1);
        let (before, word) = line.split_at(begin);
        let before: Vec<&str> = before.split_whitespace().collect();
        let names = |known: &[Known]| known.iter().map(|known| known.name.clone()).collect();
        let words = |known: &[Known], name: &str| {
            let found = known.iter().find(|known| known.name == name);
            found.map_or_else(Vec::new, |known| known.words.clone())
        };
        let candidates: Vec<String> = match before[..] {
            [] => {
                let own = own::HELP.iter().filter_map(|(usage, _)| usage.split(' ').next());
                let mut all: Vec<String> = names(&self.commands);
                all.extend(own.map(str::to_owned));
                all
            }
            ["get" | "describe"] => names(&self.settings),
            // Names and values alternate.
            ["set", .., name] if before.len().is_multiple_of(2) => words(&self.settings, name),
            ["set", ..] => names(&self.settings),
            [command] => words(&self.commands, command),
            _ => Vec::new(),
        };
        (begin, candidates.into_iter().filter(|name| name.starts_with(word)).collect())
    }
}

/// Parses the commands of `help`: usage and, after two spaces, the meaning. Words in lower case after the name can be
/// typed; other words are placeholders.
fn commands(help: &Answer) -> Vec<Known> {
    let mut commands: Vec<Known> = Vec::new();
    let usages = help.contents().iter().filter_map(|line| Some(line.split_once("  ")?.0));
    for usage in usages {
        let mut parts = usage.split_whitespace();
        let Some(name) = parts.next() else { continue };
        let choices = parts.next().unwrap_or_default().trim_matches(['[', ']']).split('|');
        let literal =
            |word: &&str| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase());
        let words = choices.filter(literal).map(str::to_owned);
        match commands.iter_mut().find(|known| known.name == name) {
            Some(known) => known.words.extend(words),
            None => commands.push(Known { name: name.to_owned(), words: words.collect() }),
        }
    }
    commands
}

/// Parses the setting from a line of `describe`, a JSON object.
fn described_setting(line: &str) -> Option<Known> {
    let object: Value = serde_json::from_str(line).ok()?;
    let mut words: Vec<String> = match &object["words"] {
        Value::Array(words) => words.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
        Value::String(words) => words.split_whitespace().map(str::to_owned).collect(),
        _ => Vec::new(),
    };
    words.extend((object["auto"] == true).then(|| "auto".to_owned()));
    Some(Known { name: object["name"].as_str()?.to_owned(), words })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalogue() -> Catalogue {
        let help = [
            "start [torque|speed]    begins",
            "stop                    ends",
            "log off|warn            how much goes to the log",
            "set KEY VALUE           changes a setting",
            "trace N [NAME]          records",
            "trace [off]             ends it",
            "one line in, one line out",
            "ok",
        ];
        let described = [
            r#"{"name":"motor.r_s","unit":"ohm","auto":false,"words":[],"value":5.4}"#,
            r#"{"name":"sequence.i_d","auto":true,"value":null}"#,
            r#"{"name":"angle_source","words":["encoder","injection"]}"#,
            r#"{"name":"damaged"#,
        ];
        Catalogue {
            commands: commands(&Answer { lines: help.map(str::to_owned).to_vec() }),
            settings: described.iter().filter_map(|line| described_setting(line)).collect(),
        }
    }

    #[test]
    fn commands_settings_and_their_words_are_completed() {
        let catalogue = catalogue();
        for (line, begin, candidates) in [
            ("st", 0, &["start", "stop"][..]),
            ("one", 0, &[]),
            ("!r", 0, &["!restore"]),
            ("start s", 6, &["speed"]),
            ("log ", 4, &["off", "warn"]),
            ("tr", 0, &["trace"]),
            ("trace ", 6, &["off"]),
            ("describe mo", 9, &["motor.r_s"]),
            ("get mo", 4, &["motor.r_s"]),
            ("set ", 4, &["motor.r_s", "sequence.i_d", "angle_source"]),
            ("set angle_source e", 17, &["encoder"]),
            ("set sequence.i_d ", 17, &["auto"]),
            ("set motor.r_s 5 an", 16, &["angle_source"]),
            ("set motor.r_s 5 angle_source ", 29, &["encoder", "injection"]),
            ("set motor.r_s ", 14, &[]),
        ] {
            let (at, found) = catalogue.complete(line);
            assert_eq!(
                (at, found),
                (begin, candidates.iter().map(|c| c.to_string()).collect()),
                "{line}"
            );
        }
    }
}
