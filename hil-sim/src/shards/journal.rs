//! Files of runs as JSON Lines: a head, followed by one line per run. Shards are printed in this form, and `--resume`
//! stores finished runs in it. A process that is killed while it writes leaves a torn last line.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::sync::{Mutex, PoisonError};

use super::{Header, Run};
use crate::prelude::*;

/// The contents of a file.
pub struct Lines {
    /// The head.
    pub header: Header,
    /// The runs in the file.
    pub runs: Vec<Run>,
    /// Number of the last line, if it is torn.
    pub torn: Option<u64>,
    /// Length of the contents before the torn line, bytes.
    good: u64,
}

impl Lines {
    /// Parses the contents of a file.
    ///
    /// # Errors
    /// [`Error::Data`] with the line that is no record of a run of the shard.
    pub fn of(path: &Path, bytes: &[u8]) -> Result<Self, Error> {
        let mut lines = bytes.split_inclusive(|&byte| byte == b'\n');
        let whole = |line: &&[u8]| line.ends_with(b"\n");
        let first = lines.next().filter(whole);
        let header = first.and_then(|line| serde_json::from_slice(line).ok());
        let header = header.filter(|header: &Header| header.shard.exists()).ok_or_else(|| {
            let problem = "not the head of a shard or of a file for --resume, or torn";
            Error::data(path, Some(1), problem)
        })?;
        let good = first.map_or(0, <[u8]>::len) as u64;
        let mut read = Self { header, runs: Vec::new(), torn: None, good };
        let mut lines = lines.zip(2..).peekable();
        while let Some((line, number)) = lines.next() {
            let run = Some(line).filter(whole).and_then(|line| serde_json::from_slice(line).ok());
            match run {
                Some(run) if read.header.has(&run) => read.runs.push(run),
                None if lines.peek().is_none() => {
                    read.torn = Some(number);
                    break;
                }
                _ => {
                    let problem =
                        "no record of a run of this shard; give another file, or remove the line";
                    return Err(Error::data(path, Some(number), problem));
                }
            }
            read.good += line.len() as u64;
        }
        Ok(read)
    }
}

/// A file to which finished runs are added.
pub struct Journal {
    /// Its path.
    pub path: PathBuf,
    /// The runs that it had when it was opened.
    pub runs: Vec<Run>,
    /// Number of the line that was torn.
    pub torn: Option<u64>,
    file: Mutex<File>,
}

impl Journal {
    /// Returns the file for `--resume PATH`: the path itself, or, in a folder, a file with the name of the run.
    pub fn place(path: &Path, header: &Header) -> PathBuf {
        let text = path.to_string_lossy();
        if path.is_dir() || text.ends_with(std::path::is_separator) {
            let (name, seed, shard) = (&header.experiment, header.seed, header.shard.file_name());
            path.join(format!("{name}-seed-{seed}-{shard}.jsonl"))
        } else {
            path.to_owned()
        }
    }

    /// Opens or makes a file for the runs of a shard, and removes a torn last line. No other process can open it at the same time.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be read or written; [`Error::Refused`] while another process writes it; as
    /// `Lines::of`; [`Error::Data`] if it belongs to another run. On an error the file is unchanged.
    pub fn open(path: &Path, header: &Header) -> Result<Self, Error> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
        }
        let options =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = options.map_err(Error::write(path))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let path = path.display();
            return Err(Error::Refused(format!("{path}: another process writes it")));
        }
        let bytes = bounded::read(&file, bounded::RUNS_MIB).map_err(Error::write(path))?;
        let first = line(header)?;
        let mut read = if first.len() > bytes.len() && first.starts_with(&bytes) {
            let torn = (!bytes.is_empty()).then_some(1);
            Lines { header: header.clone(), runs: Vec::new(), torn, good: 0 }
        } else {
            Lines::of(path, &bytes)?
        };
        let (here, there) = (header.shard, read.header.shard);
        let difference = header
            .difference(&read.header)
            .or_else(|| (here != there).then(|| format!("the shard is {here}, there {there}")));
        if let Some(text) = difference {
            let problem = format!("of another run: here {text}; give another file");
            return Err(Error::data(path, Some(1), problem));
        }
        file.set_len(read.good).map_err(Error::write(path))?;
        file.seek(SeekFrom::End(0)).map_err(Error::write(path))?;
        if read.good == 0 {
            file.write_all(&first).map_err(Error::write(path))?;
        }
        let runs = std::mem::take(&mut read.runs);
        Ok(Self { path: path.to_owned(), file: Mutex::new(file), runs, torn: read.torn })
    }

    /// Adds a run at once.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn append(&self, run: &Run) -> Result<(), Error> {
        let line = line(run)?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&line).map_err(Error::write(&self.path))
    }
}

/// Writes a head or a run as a line.
pub fn line(of: &impl serde::Serialize) -> Result<Vec<u8>, Error> {
    let mut line = serde_json::to_vec(of).map_err(|e| Error::Internal(e.to_string()))?;
    line.push(b'\n');
    Ok(line)
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
            assert_eq!(journal.runs, runs[..lines.saturating_sub(1)], "{length} bytes");
            let is_whole = length == 0 || whole[length - 1] == b'\n';
            assert_eq!(journal.torn.is_none(), is_whole, "{length} bytes");
            let missing = &runs[journal.runs.len()..];
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
        let impossible = of_seed_2.replace("\"count\":2", "\"count\":0");
        let cases = [
            (impossible.as_str(), 1, "line 1: not the head"),
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
