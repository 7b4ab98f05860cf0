//! Messages in hexadecimal, checked against the bits of their key before anything is queued.
use crate::error::{Error, Result};

/// Most bits of a key.
pub const MAX_BITS: u32 = 150;

/// Checks that `text` is a message of exactly `bits` bits: ceil(`bits` / 4) hexadecimal digits, with or without `0x`,
/// and zeros in the bits of the first digit that are too many.
pub fn check(field: &str, text: &str, bits: u32) -> Result<()> {
    let bad = |reason: String| Err(Error::invalid(field, reason));
    let digits = text
        .strip_prefix("0x")
        .or_else(|| text.strip_prefix("0X"))
        .unwrap_or(text);
    let wrong = digits.chars().enumerate().find(|(_, c)| !c.is_ascii_hexdigit());
    if let Some((position, digit)) = wrong {
        return bad(format!(
            "character {} is {digit:?}, not a hexadecimal digit",
            position + 1
        ));
    }
    let (count, wanted) = (digits.len(), bits.div_ceil(4) as usize);
    if count != wanted {
        let how = if count > wanted { "longer" } else { "shorter" };
        return bad(format!(
            "{count} hexadecimal digits are {how} than the key's {bits} bits, which take {wanted}"
        ));
    }
    let spare = wanted as u32 * 4 - bits;
    let first = digits.chars().next().and_then(|c| c.to_digit(16)).unwrap_or(0);
    if first >> (4 - spare) != 0 {
        return bad(format!("the value needs more than the key's {bits} bits"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fitting_messages_pass() {
        for (text, bits) in [("8001", 16), ("0xDEADbeef", 32), ("7", 3), ("0", 1), ("1", 1), ("f", 4)] {
            check("message", text, bits).unwrap();
        }
        check("message", &format!("7{}", "f".repeat(18)), 75).unwrap();
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let reason = |text: &str, bits| check("message", text, bits).unwrap_err().to_string();
        assert!(reason("123456789", 32).contains("longer than the key's 32 bits"));
        assert!(reason("1234567", 32).contains("shorter"));
        assert!(reason("", 32).contains("shorter"));
        assert!(reason("1234567g", 32).contains("character 8 is 'g'"));
        assert!(reason("8", 3).contains("more than the key's 3 bits"));
        assert!(reason("2", 1).contains("more than the key's 1 bits"));
        assert!(reason(&format!("8{}", "0".repeat(18)), 75).contains("more than the key's 75 bits"));
        assert!(reason("é", 4).contains("character 1"));
        assert!(reason("0x", 4).contains("shorter"));
    }
}
