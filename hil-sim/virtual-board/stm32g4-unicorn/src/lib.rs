#![doc = include_str!("../README.md")]

/// Defines a structure with default values for its fields; a field without one has the default of its type.
macro_rules! defaults {
    (@value) => { Default::default() };
    (@value $value:expr) => { $value };
    ($(#[$about:meta])* $seen:vis struct $name:ident $(<$of:ident: $bound:ident = $usual:ty>)? {
        $($(#[$meaning:meta])* $from:vis $field:ident: $kind:ty $(= $value:expr)?,)*
    }) => {
        $(#[$about])*
        $seen struct $name $(<$of: $bound = $usual>)? {
            $($(#[$meaning])* $from $field: $kind,)*
        }

        impl $(<$of: $bound>)? Default for $name $(<$of>)? {
            fn default() -> Self {
                Self { $($field: defaults!(@value $($value)?)),* }
            }
        }
    };
}

pub mod chip;
pub mod circuit;
pub mod cost;
pub mod cpu;
pub mod memory;
pub mod periph;
pub mod rules;
pub mod scs;

pub use chip::Chip;
pub use circuit::Circuit;
pub use cpu::{Counting, Cpu};
