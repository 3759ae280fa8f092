//! `cargo sim coefficients`: designs the coefficients of a drive for the image without a design, and writes them beside that image.

use induction_drive::boards::{self, Board};
use induction_drive::coefficients::{ADDRESS, Designed, LONGEST};
use induction_drive::console::restore::Restore;
use induction_drive::settings::{FirmwareSettings, keys};

use crate::config::motors::Motor;
use crate::prelude::*;

/// Options of the design.
#[derive(Args)]
pub struct Options {
    /// Board of the image
    #[arg(long, value_name = "NAME", default_value = "reference")]
    board: String,
    /// Motor: a name from `motors`, or a file that ends in .toml
    #[arg(long, value_name = "NAME")]
    motor: Option<String>,
    /// Lines for the console, `set NAME VALUE` and `learned ...`: the backup of a drive that was commissioned on its motor
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
    /// Sets one setting of the drive, after motor and backup; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    assignments: Vec<String>,
    /// Speed of a start by the button, rpm
    #[arg(long, value_name = "RPM", default_value_t = 0.0, allow_negative_numbers = true)]
    speed: f32,
    /// File to write
    #[arg(
        long,
        value_name = "FILE",
        default_value = "target/boards/drive-and-log/coefficients.bin"
    )]
    out: PathBuf,
}

/// Designs and writes the file; returns what to do with it.
///
/// # Errors
/// An unknown board, motor or setting; a value that is refused; a file that cannot be read or written.
pub fn run(options: &Options) -> Result<String, Error> {
    let settings = options.settings()?;
    let refused = |why: &dyn std::fmt::Display| Error::Refused(why.to_string());
    let designed = Designed::new(&settings, options.speed).map_err(|why| refused(&why))?;
    let mut place = [0; LONGEST];
    let file = designed.write(&mut place).ok_or_else(|| refused(&"the coefficients do not fit"))?;
    report::write_whole(&options.out, file)?;
    let (out, bytes, board) = (options.out.display(), file.len(), settings.board.name);
    Ok(format!(
        "{out}: {bytes} bytes for the board {board}\n\n\
         cargo firmware --image drive-and-log\n\
         probe-rs download --chip STM32G474RETx --binary-format bin --base-address {ADDRESS:#010x} {out}\n"
    ))
}

impl Options {
    /// The settings of the board, with those of motor, backup and command line.
    fn settings(&self) -> Result<FirmwareSettings, Error> {
        let board: &Board =
            boards::ALL.iter().find(|board| board.name == self.board).ok_or_else(|| {
                Error::Refused(format!("no board {}: one of {}", self.board, boards::ALL_NAMES))
            })?;
        let mut settings = FirmwareSettings::of(board);
        let mut lines = Vec::new();
        if let Some(motor) = &self.motor {
            lines.extend(Motor::find(motor)?.console_lines());
        }
        if let Some(file) = &self.backup {
            let text =
                bounded::text(file).map_err(|why| Error::data(file, None, why.to_string()))?;
            lines.extend(text.lines().map(str::to_owned));
        }
        lines.extend(
            self.assignments.iter().map(|set| format!("set {}", set.replacen('=', " ", 1))),
        );
        let mut restore = Restore::default();
        for line in &lines {
            take(&mut settings, &mut restore, line)
                .map_err(|why| Error::Refused(format!("{line}: {why}")))?;
        }
        Ok(settings)
    }
}

/// Takes one line of a backup. Lines of other commands, and comments, are left out.
fn take(settings: &mut FirmwareSettings, restore: &mut Restore, line: &str) -> Result<(), String> {
    let mut words = line.split_whitespace();
    match (words.next(), words.next()) {
        (Some("set"), Some(name)) => {
            let key = keys::find(name).ok_or("no such setting")?;
            let text = words.collect::<Vec<_>>().join(" ");
            key.set(settings, key.parse(&text).map_err(|why| why.to_string())?);
        }
        (Some("learned"), Some("check")) => {
            let check = words.next().and_then(|word| u32::from_str_radix(word, 16).ok());
            let both = settings.drive.scales.both_zero_vectors;
            let learned = restore.finish(check.ok_or("no check sum")?, both);
            settings.learned = Some(learned.map_err(|why| why.to_string())?);
        }
        (Some("learned"), Some(index)) => {
            let values: Result<Vec<u32>, _> =
                words.map(|word| u32::from_str_radix(word, 16)).collect();
            let index = index.parse().map_err(|_| "no index")?;
            let values = values.map_err(|_| "not hexadecimal")?;
            restore.take(index, &values).map_err(|why| why.to_string())?;
        }
        _ => {}
    }
    Ok(())
}
