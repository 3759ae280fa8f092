//! The optional blocks of the control, each a cargo feature.
//!
//! A block that is left out is a type without values: an `Option` of anything that contains its mark is always `None` and takes no
//! memory, and the compiler removes the code that handles it. So no `match` changes, and no other file names a feature.

/// Declares the mark of a block: a type with one value, or with none if the feature is off.
macro_rules! block {
    ($(#[$doc:meta])* $name:ident, $feature:literal) => {
        $(#[$doc])*
        #[cfg(feature = $feature)]
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $name(());

        $(#[$doc])*
        #[cfg(not(feature = $feature))]
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        pub enum $name {}

        impl $name {
            /// The value; `None` if the block is left out.
            #[cfg(feature = $feature)]
            pub const IN_BUILD: Option<Self> = Some(Self(()));
            /// The value; `None` if the block is left out.
            #[cfg(not(feature = $feature))]
            pub const IN_BUILD: Option<Self> = None;
        }
    };
}

block!(
    /// Mark of V/f control.
    Vf,
    "vf"
);
block!(
    /// Mark of the flying start.
    Catch,
    "flying-start"
);
block!(
    /// Mark of the limits of dc current and power.
    Power,
    "power-limit"
);
block!(
    /// Mark of the regulation of the position.
    Position,
    "position"
);
