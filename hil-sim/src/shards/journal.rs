//! A file to which every finished run is added at once, so that a process that was ended can be continued.
//!
//! JSON Lines: the header first, then one run a line. A process that is ended while it writes leaves a torn last line.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::{Header, Run};
use crate::error::Error;

/// The file of a shard.
pub struct Journal {
    path: PathBuf,
    file: Mutex<File>,
    runs: Vec<Run>,
    torn: Option<u64>,
}

impl Journal {
    /// The place of the journal of a shard: `path`, or a file in it when it is a folder or ends in a separator.
    pub fn place(path: &Path, header: &Header) -> PathBuf {
        let text = path.to_string_lossy();
        if path.is_dir() || text.ends_with(std::path::is_separator) {
            let (name, seed, shard) = (&header.experiment, header.seed, header.shard.file_name());
            path.join(format!("{name}-seed-{seed}-{shard}.jsonl"))
        } else {
            path.to_owned()
        }
    }

    /// Opens the journal of a shard, or begins one. A torn last line is taken away.
    ///
    /// # Errors
    /// [`Error::Data`] for a file that is no journal, that of other runs, or damaged before its last line;
    /// [`Error::Refused`] while another process writes it; [`Error::Write`].
    pub fn open(path: &Path, header: &Header) -> Result<Self, Error> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
        }
        let options =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = options.map_err(Error::write(path))?;
        // Some network file systems have no locks: there it is left to the user.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let path = path.display();
            return Err(Error::Refused(format!("{path}: another process writes it")));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(Error::write(path))?;
        let mut first = serde_json::to_vec(header).map_err(|e| Error::Internal(e.to_string()))?;
        first.push(b'\n');
        let (mut runs, mut torn) = (Vec::new(), None);
        let mut good = 0;
        if first.len() > bytes.len() && first.starts_with(&bytes) {
            torn = (!bytes.is_empty()).then_some(1);
        } else {
            let lines: Vec<&[u8]> = bytes.split_inclusive(|&byte| byte == b'\n').collect();
            for (line, number) in lines.iter().zip(1..) {
                let text = std::str::from_utf8(line).ok().filter(|text| text.ends_with('\n'));
                if number == 1 {
                    check(path, text, header)?;
                } else if let Some(run) = text.and_then(|text| of_line(text, header)) {
                    runs.push(run);
                } else if number == lines.len() as u64 {
                    torn = Some(number);
                    break;
                } else {
                    let problem =
                        "no record of a run of this shard; give another file, or take the line out";
                    return Err(data(path, number, problem.to_owned()));
                }
                good += line.len() as u64;
            }
        }
        file.set_len(good).map_err(Error::write(path))?;
        file.seek(SeekFrom::End(0)).map_err(Error::write(path))?;
        if good == 0 {
            file.write_all(&first).map_err(Error::write(path))?;
        }
        Ok(Self { path: path.to_owned(), file: Mutex::new(file), runs, torn })
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The runs that it had when it was opened.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The number of the torn line that was taken away.
    pub fn torn(&self) -> Option<u64> {
        self.torn
    }

    /// Adds a run.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn append(&self, run: &Run) -> Result<(), Error> {
        let mut line = serde_json::to_vec(run).map_err(|e| Error::Internal(e.to_string()))?;
        line.push(b'\n');
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&line).map_err(Error::write(&self.path))
    }
}

/// Checks that the first line is the header of the same runs.
fn check(path: &Path, line: Option<&str>, header: &Header) -> Result<(), Error> {
    let found: Header = line
        .and_then(|line| serde_json::from_str(line).ok())
        .ok_or_else(|| data(path, 1, "not the head of a file for --resume".to_owned()))?;
    let difference = header.difference(&found).or_else(|| {
        let (here, there) = (header.shard, found.shard);
        (here != there).then(|| format!("the shard is {here}, there {there}"))
    });
    match difference {
        Some(text) => Err(data(path, 1, format!("of another run: here {text}; give another file"))),
        None => Ok(()),
    }
}

fn of_line(text: &str, header: &Header) -> Option<Run> {
    let run: Run = serde_json::from_str(text).ok()?;
    (run.run < header.runs && header.shard.has(run.run)).then_some(run)
}

fn data(path: &Path, line: u64, problem: String) -> Error {
    Error::Data { path: path.to_owned(), line: Some(line), problem }
}

#[cfg(test)]
mod tests {
    use super::super::Shard;
    use super::*;
    use crate::config::Config;

    fn header(seed: u64) -> Header {
        let shard = Shard::new(2, 2).unwrap();
        Header::new("monte-carlo", &Config::default(), seed, shard, 8).unwrap()
    }

    fn run(run: usize) -> Run {
        Run { run, record: serde_json::json!({ "rms": 0.1 + run as f64 }) }
    }

    struct Place(PathBuf);

    impl Place {
        fn new(name: &str) -> Self {
            let folder =
                std::env::temp_dir().join(format!("hil-sim-{name}-{}", std::process::id()));
            Self(folder.join("new/runs.jsonl"))
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(self.0.parent().unwrap().parent().unwrap());
        }
    }

    #[test]
    fn a_file_cut_at_any_byte_keeps_all_whole_lines() {
        let place = Place::new("journal-cut");
        let journal = Journal::open(&place.0, &header(1)).unwrap();
        let runs = [run(1), run(5), run(3)];
        runs.iter().for_each(|run| journal.append(run).unwrap());
        drop(journal);
        let whole = std::fs::read(&place.0).unwrap();
        for length in 0..=whole.len() {
            std::fs::write(&place.0, &whole[..length]).unwrap();
            let journal = Journal::open(&place.0, &header(1)).unwrap();
            let lines = whole[..length].iter().filter(|&&byte| byte == b'\n').count();
            assert_eq!(journal.runs(), &runs[..lines.saturating_sub(1)], "{length} bytes");
            let is_whole = length == 0 || whole[length - 1] == b'\n';
            assert_eq!(journal.torn().is_none(), is_whole, "{length} bytes");
            let missing = &runs[journal.runs().len()..];
            missing.iter().for_each(|run| journal.append(run).unwrap());
            drop(journal);
            assert_eq!(std::fs::read(&place.0).unwrap(), whole, "{length} bytes");
        }
    }

    #[test]
    fn files_of_others_are_refused_and_left_as_they_are() {
        let place = Place::new("journal-other");
        drop(Journal::open(&place.0, &header(2)).unwrap());
        let of_seed_2 = std::fs::read_to_string(&place.0).unwrap();
        let damaged = format!("{of_seed_2}{{\"run\":1,\"rec\n{{\"run\":3,\"record\":1}}\n");
        let not_of_shard =
            format!("{of_seed_2}{{\"run\":2,\"record\":1}}\n{{\"run\":3,\"record\":1}}\n");
        let cases = [
            (of_seed_2.as_str(), 1, "line 1: of another run: here seed is 1, there 2"),
            ("a list of things to do", 1, "line 1: not the head"),
            (damaged.as_str(), 2, "line 2: no record of a run of this shard"),
            (not_of_shard.as_str(), 2, "line 2: no record of a run of this shard"),
        ];
        for (text, seed, expected) in cases {
            std::fs::write(&place.0, text).unwrap();
            let error = Journal::open(&place.0, &header(seed)).err().unwrap().to_string();
            assert!(error.contains(expected) && error.contains("runs.jsonl"), "{error}");
            assert_eq!(std::fs::read_to_string(&place.0).unwrap(), text);
        }
    }

    #[test]
    fn two_processes_do_not_write_the_same_file() {
        let place = Place::new("journal-lock");
        let _first = Journal::open(&place.0, &header(1)).unwrap();
        let error = Journal::open(&place.0, &header(1)).err().unwrap().to_string();
        assert!(error.ends_with("runs.jsonl: another process writes it"), "{error}");
    }
}
