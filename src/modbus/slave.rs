//! The slave: a request frame in, the answer frame out. No hardware and no state.
//!
//! Functions 03 and 04 (read), 06 and 16 (write one or several), 23 (write, then read), 08 with subfunction 0 (echo). `modbus-core` checks, parses and builds frames.
//! Three things are done here: the function 08, which the crate does not decode; the exact lengths, since it accepts surplus bytes; and
//! the frame's bounds. Its `decode_request` looks for a frame anywhere in the bytes, although an RTU frame is all bytes between two
//! silent intervals, and panics on a frame that it cannot decode (0.2.0).

use modbus_core::rtu::{self, Header, ResponseAdu, server};
use modbus_core::{
    Data, Exception, ExceptionResponse, FunctionCode, Request, Response, ResponsePdu,
};

use super::{Frame, LONGEST};

/// Address of a broadcast.
const BROADCAST: u8 = 0;
/// Most registers of a read (Modbus application protocol V1.1b3, 6.3) and of a write (6.12).
const MOST_READ: u16 = 125;
const MOST_WRITTEN: usize = 123;
/// Most registers that a write with a read takes (6.17).
const MOST_WRITTEN_AND_READ: usize = 121;
/// Bytes of a frame beside the function and its data: address and checksum.
const AROUND: usize = 3;
const DIAGNOSTICS: u8 = 8;
const READ_AND_WRITE: u8 = 23;
/// Highest code of a function; exceptions are above it.
const LAST_FUNCTION: u8 = 0x7f;

/// The words of a write.
#[derive(Clone, Copy)]
pub struct Words<'a>(&'a [u8]);

impl Words<'_> {
    /// Number of words, at least 1.
    pub fn count(self) -> usize {
        self.0.len() / 2
    }

    /// The word at a place.
    pub fn get(self, place: usize) -> Option<u16> {
        let bytes = self.0.get(2 * place..)?.first_chunk()?;
        Some(u16::from_be_bytes(*bytes))
    }
}

/// A register and the word that is written to it.
pub type Written = (u16, u16);

/// The registers of a slave.
pub trait Registers {
    /// The word of a register.
    ///
    /// # Errors
    /// [`Exception::IllegalDataAddress`].
    fn read(&mut self, at: u16) -> Result<u16, Exception>;
    /// Writes words from this register on: all or none of them.
    ///
    /// # Errors
    /// The exception that the master gets.
    fn write(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception>;
}

/// A decoded request.
#[derive(Clone, Copy)]
enum Asked<'a> {
    /// Read the registers from the first to the last, by this function.
    Read(FunctionCode, u16, u16),
    /// Write the words from this register on, by this function.
    Write(FunctionCode, u16, Words<'a>),
    /// Write the words from this register on, then read from the first to the last.
    Both(u16, Words<'a>, u16, u16),
    /// Return the same data.
    Echo(FunctionCode, &'a [u8]),
}

/// Carries out a received frame, if it is whole and for the address `own` or for all, and sends the answer, if there is one. Returns
/// whether the frame was a request to this address alone, and was carried out.
pub fn answer(
    frame: &[u8],
    own: u8,
    registers: &mut impl Registers,
    send: impl FnOnce(&Frame),
) -> bool {
    let Some((slave, pdu)) = whole(frame) else { return false };
    let function = pdu[0];
    // A broadcast read has no answer.
    let for_us = slave == own || (slave == BROADCAST && matches!(function, 6 | 16));
    if !for_us || function > LAST_FUNCTION {
        return false;
    }
    let asked = match asked(pdu) {
        Ok(Asked::Write(_, at, words)) => {
            registers.write(at, words).and_then(|()| self::asked(pdu))
        }
        // Nothing is written if the read fails.
        Ok(Asked::Both(at, words, first, last)) => (first..=last)
            .try_for_each(|at| registers.read(at).map(drop))
            .and_then(|()| registers.write(at, words))
            .and_then(|()| self::asked(pdu)),
        asked => asked,
    };
    if slave != BROADCAST {
        return reply(slave, function, asked, registers, send);
    }
    false
}

/// The reaction of a busy slave to a frame: its answer, and a stop that is to be carried out.
pub type Busy = (Option<Frame>, Option<Written>);

/// The reaction of a busy slave with the address `own` to a whole frame. A write that is a stop, to this slave or to all, is
/// acknowledged; other requests to this slave alone are answered with exception 6. So is a stop by function 23, whose answer would
/// need the registers: it acts all the same. It never panics, because an interrupt calls it.
pub fn busy(frame: &[u8], own: u8, is_stop: impl FnOnce(Written) -> bool) -> Busy {
    let Some((body, sum)) = frame.split_last_chunk::<2>() else { return (None, None) };
    if *sum != rtu::crc16(body).to_be_bytes() {
        return (None, None);
    }
    let word = |high, low| u16::from_be_bytes([high, low]);
    let written = match *body {
        [_, 6, a, b, c, d]
        | [_, 16, a, b, _, _, _, c, d, ..]
        | [_, READ_AND_WRITE, _, _, _, _, a, b, _, _, _, c, d, ..] => {
            Some((word(a, b), word(c, d)))
        }
        _ => None,
    };
    let for_us = body.first().is_some_and(|slave| *slave == own || *slave == BROADCAST);
    let stop = written.filter(|written| for_us && is_stop(*written));
    let answer = match *body {
        [slave, ..] if slave != own => None,
        // Address, function, register, word or number of words.
        [_, function @ (6 | 16), a, b, c, d, ..] if stop.is_some() => {
            with_sum(&[own, function, a, b, c, d])
        }
        [_, function, ..] if function <= LAST_FUNCTION => {
            with_sum(&[own, function | 0x80, Exception::ServerDeviceBusy as u8])
        }
        _ => None,
    };
    (answer, stop)
}

/// A frame of these bytes and their checksum.
fn with_sum(body: &[u8]) -> Option<Frame> {
    let mut frame = Frame::from_slice(body).ok()?;
    frame.extend_from_slice(&rtu::crc16(body).to_be_bytes()).ok()?;
    Some(frame)
}

/// Address and request of a frame; `None` if it is damaged.
fn whole(frame: &[u8]) -> Option<(u8, &[u8])> {
    let pdu_len = frame.len().checked_sub(AROUND).filter(|pdu_len| *pdu_len > 0)?;
    if frame.len() > LONGEST {
        return None;
    }
    let decoded = rtu::extract_frame(frame, pdu_len).ok()??;
    Some((decoded.slave, decoded.pdu))
}

fn asked(pdu: &[u8]) -> Result<Asked<'_>, Exception> {
    let exact = |length: usize| {
        if pdu.len() == length { Ok(()) } else { Err(Exception::IllegalDataValue) }
    };
    let last = |at: u16, count| {
        if !(1..=MOST_READ).contains(&count) {
            return Err(Exception::IllegalDataValue);
        }
        at.checked_add(count - 1).ok_or(Exception::IllegalDataAddress)
    };
    let whole = |data: &Data<'_>, most| {
        let count = data.len();
        let fits = (1..=most).contains(&count) && data.payload().len() == 2 * count;
        fits.then_some(2 * count).ok_or(Exception::IllegalDataValue)
    };
    match Request::try_from(pdu) {
        Ok(Request::ReadHoldingRegisters(at, count) | Request::ReadInputRegisters(at, count)) => {
            exact(5)?;
            Ok(Asked::Read(FunctionCode::new(pdu[0]), at, last(at, count)?))
        }
        Ok(Request::ReadWriteMultipleRegisters(first, count, at, data)) => {
            exact(10 + whole(&data, MOST_WRITTEN_AND_READ)?)?;
            Ok(Asked::Both(at, Words(&pdu[10..]), first, last(first, count)?))
        }
        Ok(Request::WriteSingleRegister(at, _)) => {
            exact(5)?;
            Ok(Asked::Write(FunctionCode::WriteSingleRegister, at, Words(&pdu[3..])))
        }
        Ok(Request::WriteMultipleRegisters(at, data)) => {
            exact(6 + whole(&data, MOST_WRITTEN)?)?;
            Ok(Asked::Write(FunctionCode::WriteMultipleRegisters, at, Words(&pdu[6..])))
        }
        Ok(Request::Custom(function, [0, 0, ..])) if function.value() == DIAGNOSTICS => {
            Ok(Asked::Echo(function, &pdu[1..]))
        }
        // The request is too short for its function.
        Err(_) if matches!(pdu[0], 3 | 4 | 6 | 16 | READ_AND_WRITE) => {
            Err(Exception::IllegalDataValue)
        }
        _ => Err(Exception::IllegalFunction),
    }
}

/// Sends the answer; returns whether it is not an exception. Not inlined, so that its buffers take no stack from a write.
#[inline(never)]
fn reply(
    slave: u8,
    function: u8,
    asked: Result<Asked<'_>, Exception>,
    registers: &mut impl Registers,
    send: impl FnOnce(&Frame),
) -> bool {
    let mut bytes = [0; 2 * MOST_READ as usize];
    let response = asked.and_then(|asked| match asked {
        Asked::Read(_, at, last) | Asked::Both(_, _, at, last) => {
            for (place, at) in bytes.chunks_exact_mut(2).zip(at..=last) {
                place.copy_from_slice(&registers.read(at)?.to_be_bytes());
            }
            let bytes = &bytes[..2 * (usize::from(last - at) + 1)];
            let data = Data::try_from(bytes).or(Err(Exception::ServerDeviceFailure))?;
            Ok(match asked {
                Asked::Read(FunctionCode::ReadInputRegisters, ..) => {
                    Response::ReadInputRegisters(data)
                }
                Asked::Both(..) => Response::ReadWriteMultipleRegisters(data),
                _ => Response::ReadHoldingRegisters(data),
            })
        }
        Asked::Write(FunctionCode::WriteSingleRegister, at, words) => {
            Ok(Response::WriteSingleRegister(at, words.get(0).unwrap_or(0)))
        }
        // At most 123 words.
        Asked::Write(_, at, words) => {
            Ok(Response::WriteMultipleRegisters(at, words.count() as u16))
        }
        Asked::Echo(function, data) => Ok(Response::Custom(function, data)),
    });
    let carried_out = response.is_ok();
    let pdu = ResponsePdu(response.map_err(|exception| ExceptionResponse {
        function: FunctionCode::new(function),
        exception,
    }));
    let mut out = Frame::new();
    // As long as the longest frame, so every answer fits.
    let _ = out.resize_default(LONGEST);
    let length = server::encode_response(ResponseAdu { hdr: Header { slave }, pdu }, &mut out);
    out.truncate(length.unwrap_or(0));
    if !out.is_empty() {
        send(&out);
    }
    carried_out
}
