//! Where values are in the text of a JSON that was understood: so that a few of them can be replaced, and all else keeps
//! its bytes. Readers of JSON do not tell places, short of a feature of `serde_json` that would compile half of the
//! workspace again.
use std::ops::Range;

/// The elements of the array `key` of the outermost object, as ranges of the text.
pub(super) fn elements(text: &str, key: &str) -> Vec<Range<usize>> {
    let Some(array) = member(text, 0..text.len(), key) else {
        return Vec::new();
    };
    let mut scan = Scan {
        text: text.as_bytes(),
        at: array.start,
        end: array.end,
    };
    let mut found = Vec::new();
    if !scan.takes(b'[') {
        return found;
    }
    while let Some(value) = scan.value() {
        found.push(value);
        if !scan.takes(b',') {
            break;
        }
    }
    found
}

/// The value of `key` in the object at a range of the text.
pub(super) fn member(text: &str, object: Range<usize>, key: &str) -> Option<Range<usize>> {
    let mut scan = Scan {
        text: text.as_bytes(),
        at: object.start,
        end: object.end,
    };
    if !scan.takes(b'{') {
        return None;
    }
    loop {
        let name = scan.value()?;
        if !scan.takes(b':') {
            return None;
        }
        let value = scan.value()?;
        // Names may be written with escapes.
        if serde_json::from_str::<std::borrow::Cow<'_, str>>(&text[name]).is_ok_and(|name| name == key) {
            return Some(value);
        }
        if !scan.takes(b',') {
            return None;
        }
    }
}

/// Bytes of a JSON besides its strings that are data URIs. Of what is no JSON, any number up to its length.
pub(super) fn besides_data(text: &[u8]) -> usize {
    let mut scan = Scan {
        text,
        at: 0,
        end: text.len(),
    };
    let mut data = 0;
    while let Some(byte) = scan.peek() {
        if byte != b'"' {
            scan.at += 1;
            continue;
        }
        let start = scan.at;
        let is_data = text[start..]
            .get(1..6)
            .is_some_and(|word| word.eq_ignore_ascii_case(b"data:"));
        if scan.skip_string().is_none() {
            break;
        }
        data += if is_data { scan.at - start } else { 0 };
    }
    text.len() - data
}

/// A text that is known to be JSON; of anything else nothing is found.
struct Scan<'a> {
    text: &'a [u8],
    at: usize,
    end: usize,
}

impl Scan<'_> {
    fn peek(&self) -> Option<u8> {
        self.text[..self.end].get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Steps over `byte`, if it is next.
    fn takes(&mut self, byte: u8) -> bool {
        self.skip_space();
        let next = self.peek() == Some(byte);
        self.at += usize::from(next);
        next
    }

    /// Steps over a value of any kind.
    fn value(&mut self) -> Option<Range<usize>> {
        self.skip_space();
        let start = self.at;
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => self.skip_string()?,
                b'{' | b'[' => {
                    depth += 1;
                    self.at += 1;
                }
                b'}' | b']' if depth == 0 => return None,
                b'}' | b']' => {
                    depth -= 1;
                    self.at += 1;
                }
                b',' | b':' | b' ' | b'\t' | b'\r' | b'\n' if depth > 0 => {
                    self.at += 1;
                    continue;
                }
                b',' | b':' => return None,
                _ => self.skip_word(),
            }
            if depth == 0 {
                return Some(start..self.at);
            }
        }
    }

    /// Steps over a string, from its first quote.
    fn skip_string(&mut self) -> Option<()> {
        self.at += 1;
        loop {
            match self.peek()? {
                b'"' => break,
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
        self.at += 1;
        Some(())
    }

    /// Steps over a number, or `true`, `false`, `null`.
    fn skip_word(&mut self) {
        while let Some(byte) = self.peek() {
            if matches!(byte, b',' | b':' | b']' | b'}' | b'"') || byte.is_ascii_whitespace() {
                break;
            }
            self.at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_are_found_by_key() {
        let text = r#" { "a" : [ 1 , {"uri":"x,\"]}"}, [[2],{}], "s" ] ,"b\u0075f":-1.5e3,"last":null} "#;
        let found: Vec<&str> = elements(text, "a").into_iter().map(|range| &text[range]).collect();
        assert_eq!(found, ["1", r#"{"uri":"x,\"]}"}"#, "[[2],{}]", r#""s""#]);
        let object = elements(text, "a")[1].clone();
        assert_eq!(&text[member(text, object, "uri").unwrap()], r#""x,\"]}""#);
        let value = |key| member(text, 0..text.len(), key).map(|range| &text[range]);
        assert_eq!(value("buf"), Some("-1.5e3"));
        assert_eq!(value("last"), Some("null"));
        assert_eq!(value("none"), None);
        assert!(elements(text, "last").is_empty() && elements("{}", "a").is_empty());
        assert!(elements(r#"{"a":[]}"#, "a").is_empty());
    }

    #[test]
    fn buffers_in_the_text_are_not_counted() {
        let count = |text: &str| besides_data(text.as_bytes());
        assert_eq!(count(r#"{"uri":"data:a,bcd"}"#), r#"{"uri":}"#.len());
        assert_eq!(count(r#"["data:\"x","a data:","data"#), r#"[,"a data:","data"#.len());
    }

    proptest! {
        /// Broken texts never come here, and would do no harm.
        #[test]
        fn no_text_makes_it_fail(text in r#"[\[\]{}",:\\a1 ]{0,40}"#) {
            for range in elements(&text, "a") {
                let _ = &text.as_bytes()[range];
            }
        }
    }
}
