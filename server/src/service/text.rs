//! Texts that people choose: names of jobs, files and workers.
use crate::error::{Error, Result};

const MAX_DISPLAY_CHARS: usize = 63;
const MAX_REASON_CHARS: usize = 500;
const MAX_FILE_BYTES: usize = 255;

/// Checks a name for people: at most 63 characters, all of which can be shown in one line.
pub fn display_name(field: &str, text: &str) -> Result<()> {
    line(field, text, MAX_DISPLAY_CHARS)
}

/// Checks a reason for people: at most 500 characters in one line.
pub fn reason(field: &str, text: &str) -> Result<()> {
    line(field, text, MAX_REASON_CHARS)
}

fn line(field: &str, text: &str, limit: usize) -> Result<()> {
    let length = text.chars().count();
    if length > limit {
        return Err(Error::invalid(
            field,
            format!("has {length} characters, at most {limit} are taken"),
        ));
    }
    printable(field, text)
}

/// Checks a file name, which may be empty: at most 255 bytes, and nothing that leads to another folder.
pub fn file_name(field: &str, text: &str) -> Result<()> {
    if text.len() > MAX_FILE_BYTES {
        return Err(Error::invalid(
            field,
            format!("has {} bytes, at most {MAX_FILE_BYTES} are taken", text.len()),
        ));
    }
    // Both separators, wherever the server runs: the name is used on the machines of those who download.
    if text.contains(['/', '\\']) || text == "." || text == ".." {
        return Err(Error::invalid(field, "must be a file name without folders"));
    }
    printable(field, text)
}

/// Refuses what would break a line, drive a terminal, or turn the writing direction to hide how a name ends.
fn printable(field: &str, text: &str) -> Result<()> {
    let hidden = |c: char| c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    match text.chars().position(hidden) {
        Some(position) => Err(Error::invalid(
            field,
            format!("character {} is a control character", position + 1),
        )),
        None => Ok(()),
    }
}

/// At most `limit` bytes of a text that a program wrote.
pub fn shortened(mut text: String, limit: usize) -> String {
    if text.len() > limit {
        text.truncate(text.floor_char_boundary(limit));
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_names_are_short_lines() {
        for good in ["", "a scene, № 3", &"é".repeat(63)] {
            display_name("f", good).unwrap();
        }
        for bad in [&"a".repeat(64), "two\nlines", "\u{1b}[2J", "nul\0", "gnp\u{202e}exe"] {
            assert!(display_name("f", bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn file_names_have_no_folders() {
        for good in ["", "scene.ply", "..ply", "a b.png", &"x".repeat(255)] {
            file_name("f", good).unwrap();
        }
        for bad in [
            "../scene.ply",
            "/etc/passwd",
            "a/b",
            "..",
            ".",
            "a\\b",
            "C:\\x",
            &"x".repeat(256),
            "a\0b",
        ] {
            assert!(file_name("f", bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(shortened("héllo".into(), 2), "h…");
        assert_eq!(shortened("hello".into(), 5), "hello");
    }
}
