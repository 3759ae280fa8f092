//! The DTG field of TIM1_BDTR (RM0440): a dead time in ticks as eight bits.

/// The longest dead time of the timer, ticks.
pub const LONGEST: u32 = ticks(u8::MAX);

/// The shortest dead time of the DTG field that is not below `ticks`, which is at most [`LONGEST`].
pub const fn code(wanted: u32) -> u8 {
    assert!(wanted <= LONGEST, "longer than the timer can make it");
    let mut code = 0;
    while ticks(code) < wanted {
        code += 1;
    }
    code
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
