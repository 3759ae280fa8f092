//! The FNV-1a hash, 32 bits (RFC 9923): for names in the saved settings and for checks of memory.

/// Hash of nothing: the offset basis.
pub const BASIS: u32 = 0x811c_9dc5;

/// Adds one value to a hash. The step is one-to-one in the hash and in the value, so a change of one value always
/// changes the result. FNV-1a adds bytes; values wider than a byte make a hash of the same kind.
pub const fn add(hash: u32, value: u32) -> u32 {
    (hash ^ value).wrapping_mul(0x0100_0193)
}

/// Hash of bytes.
pub fn of(bytes: impl IntoIterator<Item = u8>) -> u32 {
    bytes.into_iter().fold(BASIS, |hash, byte| add(hash, u32::from(byte)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test vectors of the RFC.
    #[test]
    fn published_values_are_reproduced() {
        assert_eq!(of(*b""), 0x811c_9dc5);
        assert_eq!(of(*b"a"), 0xe40c_292c);
        assert_eq!(of(*b"foobar"), 0xbf9c_f968);
    }
}
