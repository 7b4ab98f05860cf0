//! What goes to standard output, and what the process exits with.
use std::io::Write;

use serde::Serialize;

/// What a command that could be carried out found; errors exit with 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done, or the message matches.
    Done,
    /// The message does not match.
    NoMatch,
    /// Nothing could be decided, or a target was missed.
    Inconclusive,
}

impl Exit {
    /// The code of the process.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::NoMatch => 2,
            Self::Inconclusive => 3,
        }
    }
}

/// Prints a value as JSON, over several lines.
pub fn print_json(value: &impl Serialize) {
    print_value(serde_json::to_string_pretty(value));
}

/// Prints a value as JSON on one line, for streams of values.
pub fn print_json_line(value: &impl Serialize) {
    print_value(serde_json::to_string(value));
}

fn print_value(json: serde_json::Result<String>) {
    match json {
        Ok(text) => print_line(&text),
        // Reports are structs with text keys, which always have a JSON form.
        Err(error) => say(&format!("error: no JSON: {error}")),
    }
}

/// Prints a line; that nobody listens any more is no error.
pub fn print_line(text: &str) {
    let mut out = std::io::stdout();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Prints a line on standard error; unlike `eprintln!` it goes on when nobody listens there any more.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// A text from elsewhere without what would steer a terminal.
pub fn printable(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_engine() {
        assert_eq!(Exit::Done.code(), 0);
        assert_eq!(Exit::NoMatch.code(), 2);
        assert_eq!(Exit::Inconclusive.code(), 3);
    }

    #[test]
    fn names_from_elsewhere_do_not_steer_the_terminal() {
        assert_eq!(printable("a\u{1b}[31mb\u{9b}c\nd"), "a\u{fffd}[31mb\u{fffd}c\nd");
    }
}
