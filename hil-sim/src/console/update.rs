//! `cargo sim update`: writes another image over the serial port of the console, through ST's loader (AN3155, AN2606).
//!
//! Only the pages of the image are erased, so settings and history stay. The first page is written last. If power fails
//! before that, the old start block reports that the image is damaged, and accepts `update` again.
//!
//! The protocol is our own code: no crate for it is maintained, and it consists of nine commands of a few bytes.

use std::io::ErrorKind;

use crc::{CRC_32_ISO_HDLC, Crc};
use serialport::Parity;

use super::Port;
use crate::board;
use crate::prelude::*;

/// Options of an update.
#[derive(Args)]
pub struct Options {
    /// Serial port: /dev/ttyACM0, COM3, or the pseudo-terminal that `cargo sim board` prints
    #[arg(long, value_name = "PATH")]
    pub port: String,
    /// Board whose image is built and written [default: the board that the drive at the port reports]
    #[arg(long, value_name = "NAME", conflicts_with = "file")]
    pub board: Option<String>,
    /// Write this image: a `.bin` of `cargo firmware`, or the ELF beside it
    pub file: Option<PathBuf>,
    /// Confirm that the supply of the gate drivers is off: ST's loader switches a gate on (PA9)
    #[arg(long)]
    pub gates_off: bool,
    /// Write the image although the drive at the port reports another board
    #[arg(long)]
    pub other_board: bool,
}

const FLASH: u32 = 0x0800_0000;
/// Number of bytes of a page, and of a block of the protocol.
const PAGE: usize = 2048;
const BLOCK: usize = 256;
/// Offset of the first page of settings and history from the beginning of the flash.
const STORED: usize = (512 - 16) * 1024;
/// The chip identifier of the loader: STM32G47x and G48x.
const PRODUCT: [u8; 2] = [0x04, 0x69];
const ACK: u8 = 0x79;
/// Longest wait for an answer of the loader and of the firmware, and for its greeting, which follows the design of the control.
const ANSWER: Duration = Duration::from_secs(2);
const GREETING: Duration = Duration::from_secs(30);

/// The mark before the name of the board in the first page of an image, and the length of the name in bytes (`src/boards/identity.rs`).
const MAGIC: &[u8] = b"idboard1";
const NAME: usize = 32;

/// An image.
pub struct Image {
    bytes: Vec<u8>,
    check: u32,
    /// The board for which it is built; `None` for an image of an older firmware.
    pub board: Option<String>,
}

impl Image {
    /// Parses the contents of a `.bin`.
    ///
    /// # Errors
    /// The contents are no image, or damaged.
    pub fn new(mut bytes: Vec<u8>) -> Result<Self, &'static str> {
        bytes.resize(bytes.len().next_multiple_of(PAGE), 0xff);
        let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        // The list of pieces (`memory.x`) begins with the previous piece.
        let begins =
            |at: &usize| [word(*at), word(at + 4)] == [FLASH, FLASH + *at as u32].map(Some);
        let list = (0..PAGE).step_by(4).find(begins).ok_or("no image of this drive")?;
        let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC);
        let mut digest = crc.digest();
        for at in (list..list + 32).step_by(8) {
            let place =
                |at| word(at).and_then(|word| word.checked_sub(FLASH)).map(|at| at as usize);
            let piece = place(at).zip(place(at + 4)).and_then(|(from, to)| bytes.get(from..to));
            digest.update(piece.ok_or("cut short")?);
        }
        let check = digest.finalize();
        if word(list + 32) != Some(check) || bytes.len() > STORED {
            return Err("its check sum is wrong");
        }
        let page = &bytes[..PAGE];
        let at = page.windows(MAGIC.len()).position(|window| window == MAGIC);
        let name = at.and_then(|at| page.get(at + MAGIC.len()..)?.get(..NAME));
        let text = |name| String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
        let board = name.map(text);
        Ok(Self { bytes, check, board })
    }

    /// Checks that the image is for the present board, as far as both are known.
    ///
    /// # Errors
    /// The image is for another board.
    pub fn fits(&self, there: Option<&str>) -> Result<(), String> {
        match (self.board.as_deref(), there) {
            (Some(of), Some(there)) if of != there => Err(format!(
                "the image is for the board {of}, and the drive at the port is a {there}: on it, the image may switch gates on; \
                 take the image of {there}, or add --other-board"
            )),
            _ => Ok(()),
        }
    }

    /// Returns the pages with contents, in the order in which they are written.
    fn pages(&self) -> Vec<(usize, &[u8])> {
        let used = |(_, page): &(usize, &[u8])| page.iter().any(|byte| *byte != 0xff);
        let mut pages: Vec<_> = self.bytes.chunks(PAGE).enumerate().filter(used).collect();
        pages.rotate_left(1);
        pages
    }
}

/// Builds the image or reads it, and writes it.
///
/// # Errors
/// [`Error::Refused`] for things that have to be changed: file, port, state of the drive; [`Error::Internal`] for failures on the way.
pub fn run(options: &Options) -> Result<(), Error> {
    if !options.gates_off {
        let why = "switch off the supply of the gate drivers, because ST's loader switches a gate on; then add --gates-off";
        return Err(Error::Refused(why.into()));
    }
    let mut port = super::open(&options.port, 115_200)?.0;
    let there = board_at(&mut port)?;
    let file = match (&options.file, options.board.as_ref().or(there.as_ref())) {
        (Some(file), _) => file.clone(),
        (None, Some(board)) => board::image(board, false)?,
        (None, None) => {
            let why = "the drive at the port does not report its board: name it with --board";
            return Err(Error::Refused(why.into()));
        }
    };
    let bin = if file.extension().is_some() { file } else { file.with_extension("bin") };
    let refused = |why: String| Error::Refused(format!("{}: {why}", bin.display()));
    let bytes = bounded::bytes(&bin, bounded::TEXT_MIB).map_err(|why| refused(why.to_string()))?;
    let image = Image::new(bytes).map_err(|why| refused(why.into()))?;
    if !options.other_board {
        image.fits(there.as_deref()).map_err(refused)?;
    }
    let said = update(&mut port, &image, |line| eprintln!("{line}"))?;
    println!("{said}");
    Ok(())
}

/// Returns the name of the board that the drive at the port reports; `None` if it does not answer, or its image is damaged.
///
/// # Errors
/// The port fails.
pub fn board_at(port: &mut Port) -> Result<Option<String>, Error> {
    // Ends a line that may have begun; the answer to it is ignored.
    send(port, b"\n").map_err(Error::Internal)?;
    line(port, Duration::from_millis(300), |_| false);
    send(port, b"board\n").map_err(Error::Internal)?;
    let said = line(port, ANSWER, |line| line.starts_with("board ") || line.starts_with("error: "));
    let name = said.as_deref().and_then(|line| line.strip_prefix("board ")?.split(':').next());
    let name = name.map(str::to_owned);
    // The rest of the list.
    line(port, Duration::from_millis(500), |line| line == "ok");
    Ok(name)
}

fn lost(what: impl std::fmt::Display) -> Error {
    let next =
        "the image is incomplete: `cargo sim update` again; if nothing answers, docs/update.md";
    Error::Internal(format!("{what}; {next}"))
}

/// Writes an image; returns the answer of the new one to `version`.
///
/// # Errors
/// As [`run`].
pub fn update(port: &mut Port, image: &Image, mut show: impl FnMut(&str)) -> Result<String, Error> {
    // Ends a line that may have begun; the answer to it is ignored.
    send(port, b"\n").map_err(Error::Internal)?;
    line(port, Duration::from_millis(300), |_| false);
    send(port, b"update gates-off\n").map_err(Error::Internal)?;
    match line(port, ANSWER, |line| line.starts_with("ok: ST's") || line.starts_with("error: ")) {
        Some(answer) if answer.starts_with("error") => return Err(Error::Refused(answer)),
        Some(_) => {}
        None => show("no answer: is the loader running already?"),
    }
    // The firmware resets 0.1 s after its answer.
    std::thread::sleep(Duration::from_millis(500));
    let even = port.set_parity(Parity::Even).map_err(|why| why.to_string());
    even.and_then(|()| write(port, image, &mut show)).map_err(lost)?;
    port.set_parity(Parity::None).map_err(lost)?;
    show("written; waiting for the greeting");
    line(port, GREETING, |line| line.contains("induction-drive"))
        .ok_or_else(|| lost("the image does not greet"))?;
    send(port, b"version\n").map_err(lost)?;
    let sum = format!(", image {:08x}, ", image.check);
    line(port, ANSWER, |line| line.contains(&sum)).ok_or_else(|| lost("another image runs"))
}

/// Writes the image through the loader.
fn write(port: &mut Port, image: &Image, show: &mut impl FnMut(&str)) -> Result<(), String> {
    synchronise(port)?;
    let [count, high, low, _] = read(port, ANSWER)?;
    if count != 1 || [high, low] != PRODUCT {
        return Err(format!("the loader belongs to another chip, {high:02x}{low:02x}"));
    }
    let pages = image.pages();
    for (n, (page, bytes)) in pages.iter().enumerate() {
        command(port, 0x44)?;
        // One page: the number of pages minus one, and the number of the page.
        checked(port, &[0, 0, (page >> 8) as u8, *page as u8])?;
        for (block, data) in bytes.chunks(BLOCK).enumerate() {
            let at = (FLASH + (page * PAGE + block * BLOCK) as u32).to_be_bytes();
            command(port, 0x31)?;
            checked(port, &at)?;
            checked(port, &[&[(BLOCK - 1) as u8], data].concat())?;
            command(port, 0x11)?;
            checked(port, &at)?;
            command(port, (BLOCK - 1) as u8)?;
            if read::<BLOCK>(port, ANSWER)?[..] != *data {
                return Err(format!("page {page} reads back differently"));
            }
        }
        if n % 16 == 15 || n + 1 == pages.len() {
            show(&format!("{} of {} pages", n + 1, pages.len()));
        }
    }
    command(port, 0x21)?;
    checked(port, &FLASH.to_be_bytes())
}

/// Starts the communication with the loader, and asks it for its product.
fn synchronise(port: &mut Port) -> Result<(), String> {
    // Sends many bytes, in case the loader already runs and is in the middle of a command; half a command may be left of them.
    for count in [1, 2 * BLOCK, 1, 1] {
        send(port, &vec![0x7f; count])?;
        if read::<1>(port, ANSWER).is_ok() {
            while read::<1>(port, Duration::from_millis(200)).is_ok() {}
            if command(port, 0x02).is_ok() {
                return Ok(());
            }
        }
    }
    Err("ST's loader does not answer".into())
}

fn send(port: &mut Port, bytes: &[u8]) -> Result<(), String> {
    port.write_all(bytes).map_err(|why| why.to_string())
}

fn command(port: &mut Port, code: u8) -> Result<(), String> {
    send(port, &[code, !code])?;
    acknowledged(port)
}

/// Sends bytes followed by their check sum.
fn checked(port: &mut Port, bytes: &[u8]) -> Result<(), String> {
    let sum = bytes.iter().fold(0, |sum, byte| sum ^ byte);
    send(port, &[bytes, &[sum]].concat())?;
    acknowledged(port)
}

fn acknowledged(port: &mut Port) -> Result<(), String> {
    let [answer] = read(port, ANSWER)?;
    if answer == ACK { Ok(()) } else { Err(format!("the loader refuses, {answer:#04x}")) }
}

fn read<const N: usize>(port: &mut Port, patience: Duration) -> Result<[u8; N], String> {
    let (mut bytes, mut filled, end) = ([0; N], 0, Instant::now() + patience);
    while filled < N {
        match port.read(&mut bytes[filled..]) {
            Ok(count) if count > 0 => filled += count,
            Err(why) if why.kind() != ErrorKind::TimedOut => return Err(why.to_string()),
            _ if Instant::now() > end => return Err("the loader does not answer".into()),
            _ => {}
        }
    }
    Ok(bytes)
}

/// Returns the next line of this kind, until the time is over.
fn line(port: &mut Port, patience: Duration, wanted: impl Fn(&str) -> bool) -> Option<String> {
    let (mut text, end) = (Vec::new(), Instant::now() + patience);
    while Instant::now() < end {
        match read::<1>(port, Duration::from_millis(200)) {
            Ok([b'\r' | b'\n']) => {
                let line = String::from_utf8_lossy(&std::mem::take(&mut text)).into_owned();
                if wanted(&line) {
                    return Some(line);
                }
            }
            Ok([byte]) => text.push(byte),
            Err(_) => {}
        }
    }
    None
}
