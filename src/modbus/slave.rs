//! The slave: a request frame in, the answer frame out. No hardware and no state.
//!
//! Functions 03 (read), 06 and 16 (write one or several), 08 with subfunction 0 (echo). `modbus-core` checks, takes apart
//! and builds frames. Three things are done here: the function 08, which the crate does not decode; the exact lengths, since
//! it passes over what is too much; and the frame's bounds. Its `decode_request` looks for a frame anywhere in the bytes,
//! where an RTU frame is all between two silences, and panics on a frame that it cannot decode (0.2.0).

use modbus_core::rtu::{self, Header, ResponseAdu, server};
use modbus_core::{
    Data, Exception, ExceptionResponse, FunctionCode, Request, Response, ResponsePdu,
};

use super::{Frame, LONGEST};

/// Address of a request to all.
const BROADCAST: u8 = 0;
/// Most registers of a read (Modbus application protocol V1.1b3, 6.3) and of a write (6.12).
const MOST_READ: u16 = 125;
const MOST_WRITTEN: usize = 123;
/// Bytes of a frame beside the function and its data: address and checksum.
const AROUND: usize = 3;
const DIAGNOSTICS: u8 = 8;
/// Highest code of a function; above it stand exceptions.
const LAST_FUNCTION: u8 = 0x7f;

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
    fn write(&mut self, at: u16, words: &[u16]) -> Result<(), Exception>;
}

/// Carries out a frame that came in, if it is whole and for the address `own` or for all; whether it was. The answer is put
/// in `out`, which stays empty if there is none.
pub fn answer(frame: &[u8], own: u8, registers: &mut impl Registers, out: &mut Frame) -> bool {
    out.clear();
    let pdu_len = frame.len().saturating_sub(AROUND);
    if pdu_len == 0 || frame.len() > LONGEST {
        return false;
    }
    let Ok(Some(rtu::DecodedFrame { slave, pdu })) = rtu::extract_frame(frame, pdu_len) else {
        return false;
    };
    let function = pdu[0];
    // A read of all has no answer.
    let for_us = slave == own || (slave == BROADCAST && matches!(function, 6 | 16));
    if !for_us || function > LAST_FUNCTION {
        return false;
    }
    let mut bytes = [0; 2 * MOST_READ as usize];
    let done = carry_out(pdu, registers, &mut bytes);
    if slave != BROADCAST {
        let pdu = ResponsePdu(done.map_err(|exception| ExceptionResponse {
            function: FunctionCode::new(function),
            exception,
        }));
        // As long as the longest frame, which every answer fits in.
        let _ = out.resize_default(LONGEST);
        let length = server::encode_response(ResponseAdu { hdr: Header { slave }, pdu }, out);
        out.truncate(length.unwrap_or(0));
    }
    true
}

/// Carries out a request. `bytes` holds the registers of a read.
fn carry_out<'a>(
    pdu: &'a [u8],
    registers: &mut impl Registers,
    bytes: &'a mut [u8],
) -> Result<Response<'a>, Exception> {
    let exact = |length: usize| {
        if pdu.len() == length { Ok(()) } else { Err(Exception::IllegalDataValue) }
    };
    match Request::try_from(pdu) {
        Ok(Request::ReadHoldingRegisters(at, count)) => {
            exact(5)?;
            if !(1..=MOST_READ).contains(&count) {
                return Err(Exception::IllegalDataValue);
            }
            let last = at.checked_add(count - 1).ok_or(Exception::IllegalDataAddress)?;
            let mut words = [0; MOST_READ as usize];
            for (word, at) in words.iter_mut().zip(at..=last) {
                *word = registers.read(at)?;
            }
            let words = &words[..usize::from(count)];
            let data = Data::from_words(words, bytes).or(Err(Exception::ServerDeviceFailure))?;
            Ok(Response::ReadHoldingRegisters(data))
        }
        Ok(Request::WriteSingleRegister(at, word)) => {
            exact(5)?;
            registers.write(at, &[word])?;
            Ok(Response::WriteSingleRegister(at, word))
        }
        Ok(Request::WriteMultipleRegisters(at, data)) => {
            let count = data.len();
            if !(1..=MOST_WRITTEN).contains(&count) || data.payload().len() != 2 * count {
                return Err(Exception::IllegalDataValue);
            }
            exact(6 + 2 * count)?;
            let mut words = [0; MOST_WRITTEN];
            words.iter_mut().zip(data).for_each(|(word, value)| *word = value);
            registers.write(at, &words[..count])?;
            // At most 123.
            Ok(Response::WriteMultipleRegisters(at, count as u16))
        }
        Ok(Request::Custom(function, [0, 0, ..])) if function.value() == DIAGNOSTICS => {
            Ok(Response::Custom(function, &pdu[1..]))
        }
        // Too short for its function.
        Err(_) if matches!(pdu[0], 3 | 6 | 16) => Err(Exception::IllegalDataValue),
        _ => Err(Exception::IllegalFunction),
    }
}
