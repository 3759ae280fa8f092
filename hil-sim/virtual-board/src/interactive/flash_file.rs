//! The part of the flash in which the firmware stores its settings, as a file: a mark, the contents, and a bit for
//! every double word that cannot be read because power failed while it was being written.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use hil_sim::Error;

use stm32g4_unicorn::memory::{FLASH_END, STORED};
use stm32g4_unicorn::periph::flash::Flash;

/// First bytes of the file, including its version.
const MARK: &[u8; 16] = b"virtual flash 2\n";
/// Number of bytes of the contents.
const BANK: usize = (FLASH_END - STORED) as usize;
/// Number of bytes with a bit for every double word.
const TORN: usize = BANK / 64;

/// A file with the contents of the flash.
pub struct FlashFile {
    path: PathBuf,
    /// Number of flash operations that the file contains.
    operations: u64,
}

impl FlashFile {
    /// Loads the contents of a file into the flash. A missing file is created with the contents of the flash.
    ///
    /// # Errors
    /// The file cannot be read or written, or it is not such a file; then nothing is changed.
    pub fn open(path: &Path, flash: &mut Flash) -> Result<Self> {
        let refused = |why: String| Error::Refused(format!("--flash {}: {why}", path.display()));
        let file = Self { path: path.to_owned(), operations: flash.operations };
        match fs::read(path) {
            Ok(bytes) => {
                let (contents, torn) = parse(&bytes).map_err(refused)?;
                flash.replace_contents(contents, &torn);
                // An error appears now, not at the first `save`.
                let writable = fs::File::options().write(true).open(path);
                writable.map_err(|e| refused(e.to_string()))?;
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                file.write(flash).map_err(|why| refused(format!("{why:#}")))?;
            }
            Err(error) => return Err(refused(error.to_string()).into()),
        }
        Ok(file)
    }

    /// Writes the file if the flash has changed and no operation is in progress.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn follow(&mut self, flash: &Flash, now: u64) -> Result<()> {
        if flash.operations != self.operations && !flash.is_busy(now) {
            self.write(flash)?;
            self.operations = flash.operations;
        }
        Ok(())
    }

    /// Writes the file completely or not at all.
    fn write(&self, flash: &Flash) -> Result<()> {
        let (contents, torn) = flash.contents();
        let bits = torn.chunks(8).map(|eight| {
            eight.iter().enumerate().fold(0, |byte, (n, torn)| byte | u8::from(*torn) << n)
        });
        let bytes: Vec<u8> = MARK.iter().chain(contents).copied().chain(bits).collect();
        let part = self.path.with_added_extension("part");
        fs::write(&part, bytes)
            .and_then(|()| fs::rename(&part, &self.path))
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// Returns contents and torn double words of a file.
fn parse(bytes: &[u8]) -> Result<(&[u8], Vec<bool>), String> {
    let size = MARK.len() + BANK + TORN;
    if bytes.len() != size {
        return Err(format!("{} bytes; the flash of this board takes {size}", bytes.len()));
    }
    let Some(rest) = bytes.strip_prefix(MARK) else {
        return Err("not a file that --flash has written".into());
    };
    let (contents, bits) = rest.split_at(BANK);
    Ok((contents, bits.iter().flat_map(|byte| (0..8).map(move |n| byte >> n & 1 == 1)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(name: &str) -> PathBuf {
        let path =
            std::env::temp_dir().join(format!("virtual-board-{}-{name}", std::process::id()));
        let _ = fs::remove_file(&path);
        path
    }

    #[test]
    fn contents_and_torn_words_outlast_a_session() {
        let path = path("kept");
        let mut flash = Flash::default();
        let mut file = FlashFile::open(&path, &mut flash).unwrap();
        let mut contents = vec![0xff; BANK];
        contents[5] = 0x12;
        let mut torn = vec![false; BANK / 8];
        torn[9] = true;
        flash.replace_contents(&contents, &torn);
        // The file is written only after an operation of the flash.
        file.follow(&flash, 0).unwrap();
        assert_eq!(FlashFile::open(&path, &mut Flash::default()).map(|_| ()).ok(), Some(()));
        assert_eq!(fs::read(&path).unwrap()[MARK.len() + 5], 0xff);
        flash.operations += 1;
        file.follow(&flash, 0).unwrap();
        let mut later = Flash::default();
        FlashFile::open(&path, &mut later).unwrap();
        assert_eq!(later.contents(), (&contents[..], &torn[..]));
        assert_eq!(later.load(STORED + 72), (u32::MAX, true));
        fs::remove_file(path).unwrap();
    }

    #[test]
    fn other_files_are_refused_and_left_alone() {
        let path = path("other");
        for (bytes, said) in [
            (vec![1, 2, 3], "3 bytes; the flash of this board takes 66576"),
            (vec![0; MARK.len() + BANK + TORN], "not a file that --flash has written"),
        ] {
            fs::write(&path, &bytes).unwrap();
            let mut flash = Flash::default();
            let why = FlashFile::open(&path, &mut flash).map(|_| ()).unwrap_err();
            let why = why.downcast_ref::<Error>().expect("the request has to be changed");
            assert_eq!(why.exit_code(), 2);
            assert!(why.to_string().contains(said), "{why}");
            assert_eq!(fs::read(&path).unwrap(), bytes);
            assert!(flash.contents().0.iter().all(|byte| *byte == 0xff));
        }
        fs::remove_file(path).unwrap();
        let nowhere = Path::new("/nonexistent/flash");
        let why = FlashFile::open(nowhere, &mut Flash::default()).map(|_| ()).unwrap_err();
        assert!(format!("{why:#}").contains("/nonexistent/flash"), "{why:#}");
    }
}
