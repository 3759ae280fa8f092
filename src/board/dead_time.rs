//! The DTG field of TIM1_BDTR (RM0440): a dead time in ticks as eight bits.

/// The longest dead time of the timer, ticks.
pub const LONGEST: u32 = ticks(u8::MAX);

/// The shortest dead time of the DTG field that is not below `ticks`, which is at most [`LONGEST`].
pub const fn code(ticks: u32) -> u8 {
    if ticks <= 127 {
        ticks as u8
    } else if ticks <= 2 * 127 {
        0b1000_0000 | (ticks.div_ceil(2) - 64) as u8
    } else if ticks <= 8 * 63 {
        0b1100_0000 | (ticks.div_ceil(8) - 32) as u8
    } else {
        assert!(ticks <= LONGEST, "longer than the timer can make it");
        0b1110_0000 | (ticks.div_ceil(16) - 32) as u8
    }
}

/// The dead time of a DTG field, ticks.
pub const fn ticks(code: u8) -> u32 {
    let code = code as u32;
    match code >> 5 {
        0..=3 => code,
        4 | 5 => 2 * (64 + (code & 0x3f)),
        6 => 8 * (32 + (code & 0x1f)),
        _ => 16 * (32 + (code & 0x1f)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_time_is_never_shorter_than_asked_for_and_hardly_longer() {
        for wanted in 0..=LONGEST {
            let made = ticks(code(wanted));
            assert!(made >= wanted && made < wanted + 16, "{wanted} became {made}");
        }
    }

    #[test]
    fn every_dead_time_code_is_found_again() {
        for field in 0..=u8::MAX {
            assert_eq!(ticks(code(ticks(field))), ticks(field), "code {field:#x}");
        }
    }
}
