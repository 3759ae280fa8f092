//! Why a board cannot go on.

use std::fmt;

use crate::chip::Unknown;
use crate::periph::tim1::BadGates;

/// Why the board cannot go on.
#[derive(Clone, Debug)]
pub enum Failure {
    /// A register that the model does not know.
    Unknown(Unknown, String),
    /// Bad gate signals.
    Gates(BadGates),
    /// The core does something that no exception of the model covers.
    Core(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(access, place) => match access.written {
                Some(value) => {
                    write!(
                        f,
                        "unknown register {:#010x} written with {value:#x} at {place}",
                        access.address
                    )
                }
                None => write!(f, "unknown register {:#010x} read at {place}", access.address),
            },
            Self::Gates(bad) => write!(f, "bad gate signals: {bad:?}"),
            Self::Core(what) => f.write_str(what),
        }
    }
}

impl std::error::Error for Failure {}
