//! Messages in hexadecimal, checked against the bits of their key before anything is queued.
use guardsplat_codeword::{Error as Codeword, Message};

use crate::error::{Error, Result};

/// Checks that `text` is a message of exactly `bits` bits: ceil(`bits` / 4) hexadecimal digits, with or without `0x`,
/// and zeros in the bits of the first digit that are too many.
pub fn check(field: &str, text: &str, bits: u32) -> Result<()> {
    match Message::parse(text, bits as usize) {
        Ok(_) => Ok(()),
        Err(Codeword::Digits { reason }) => Err(Error::invalid(field, reason)),
        Err(error) => Err(Error::invalid(field, error.to_string())),
    }
}

/// The one spelling of a message that was checked: digits in lower case.
pub fn canonical(text: &str) -> String {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    digits.unwrap_or(text).to_ascii_lowercase()
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
    fn spellings_of_a_message_are_one() {
        for text in ["0xC0ffEE42", "0XC0FFEE42", "c0ffee42"] {
            assert_eq!(canonical(text), Message::parse(text, 32).unwrap().to_string());
        }
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
