//! Text that somebody else wrote, shown so that it can't pass for anything else.
use crate::hash::Sha256;
use maud::{Markup, html};

/// A name as it was sent: isolated from the direction of the text around it, with characters that have no shape, or
/// turn others around, written out as `⟨U+202E⟩`.
pub(super) fn sent(text: &str) -> Markup {
    html! { bdi { (visible(text)) } }
}

/// The same as plain text, for attributes and titles.
pub(super) fn visible(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_hidden(c) {
            shown += &format!("\u{27e8}U+{:04X}\u{27e9}", c as u32);
        } else {
            shown.push(c);
        }
    }
    shown
}

/// Controls, marks of direction, spaces without width, separators of lines and tags. Joiners stay: scripts need them.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}')
        || matches!(c, '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// A hash.
pub(super) fn hash(hash: &Sha256) -> Markup {
    html! { code { (hash) } }
}

/// A small number in digits with a power of ten, as people write it.
pub(super) fn number(p: f64) -> Markup {
    let text = crate::words::digits(p);
    match text.split_once("e-") {
        Some((mantissa, exponent)) => html! { (mantissa) "\u{a0}\u{b7}\u{a0}10" sup { "\u{2212}" (exponent) } },
        None => html! { (text) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_not_be_seen_is_written_out() {
        assert_eq!(visible("exe\u{202e}gnp.ply"), "exe\u{27e8}U+202E\u{27e9}gnp.ply");
        assert_eq!(
            visible("a\nb\u{feff}"),
            "a\u{27e8}U+000A\u{27e9}b\u{27e8}U+FEFF\u{27e9}"
        );
        let names = "שלום عليكم 猫 👩\u{200d}🔬 café.ply";
        assert_eq!(visible(names), names);
        assert_eq!(sent("<b>\"").into_string(), "<bdi>&lt;b&gt;&quot;</bdi>");
        assert_eq!(
            number(2.1e-14).into_string(),
            "2.10\u{a0}·\u{a0}10<sup>\u{2212}14</sup>"
        );
    }
}
