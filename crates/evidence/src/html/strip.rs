//! The reading bit by bit: a strip to look at, and a table to read.
use crate::verification::{Bit, Verification};
use maud::{Markup, html};

/// Bits in a row; as many as have room on a phone.
const COLUMNS: usize = 16;
/// Units of the picture: where cells begin, their size, and the bar of confidence within them.
const LEFT: usize = 30;
const WIDTH: usize = 20;
const HEIGHT: usize = 46;
const ROW: usize = 52;
const BAR: f64 = 14.0;

/// The strip; nothing where there is none.
pub(super) fn section(verification: &Verification) -> Markup {
    let bits = &verification.strip;
    if bits.is_empty() {
        return html! {};
    }
    let rows = bits.len().div_ceil(COLUMNS);
    let view = format!("0 0 {} {}", LEFT + COLUMNS * WIDTH + 2, rows * ROW);
    let differing = bits.iter().filter(|bit| differs(bit)).count();
    html! {
        section {
            h2 { "Bit by bit" }
            p { "In each cell the bit that was wanted stands above the bit that was read. A thick frame with a cross is a bit that
                differs. The longer the bar below, the surer the reading. The number at the left is that of the first bit." }
            svg.strip viewBox=(view) role="img" aria-labelledby="strip-title" {
                title id="strip-title" { (bits.len()) " bits, " (differing) " of which differ from what was wanted; the table has each" }
                @for (i, bit) in bits.iter().enumerate() { (cell(i, bit)) }
            }
            details { summary { "The same as a table" } (table(bits)) }
        }
    }
}

fn cell(i: usize, bit: &Bit) -> Markup {
    let (x, y) = (LEFT + i % COLUMNS * WIDTH, i / COLUMNS * ROW + 2);
    let middle = x + WIDTH / 2 - 1;
    let class = if differs(bit) { "cell differs" } else { "cell" };
    html! {
        @if i.is_multiple_of(COLUMNS) { text.place x="0" y=(y + 20) { (i + 1) } }
        rect class=(class) x=(x) y=(y) width=(WIDTH - 2) height=(HEIGHT) rx="2" {}
        text x=(middle) y=(y + 12) { (bit.wanted.map_or("\u{b7}", digit)) }
        text x=(middle) y=(y + 25) { (digit(bit.read)) }
        @if differs(bit) {
            path.cross d=(format!("M{} {} l6 6 m0 -6 l-6 6", middle - 3, y + 28)) {}
        }
        @if let Some(confidence) = bit.confidence {
            rect.sure x=(x + 2) y=(y + 40) width=(format!("{:.1}", confidence * BAR)) height="4" {}
        }
    }
}

fn table(bits: &[Bit]) -> Markup {
    html! {
        table.bits {
            caption { "Bits, most significant first" }
            thead { tr {
                th scope="col" { "Bit" } th scope="col" { "Wanted" } th scope="col" { "Read" } th scope="col" { "Agrees" }
                th.number scope="col" { "Confi\u{ad}dence" } th.number scope="col" { "Logit" }
            } }
            tbody {
                @for (i, bit) in bits.iter().enumerate() {
                    tr {
                        th scope="row" { (i + 1) }
                        td { (bit.wanted.map_or("\u{2013}", digit)) }
                        td { (digit(bit.read)) }
                        td { @match bit.wanted { None => "\u{2013}", Some(_) if differs(bit) => "no", Some(_) => "yes" } }
                        td.number { @match bit.confidence { Some(c) => (format!("{:.0}\u{a0}%", c * 100.0)), None => "\u{2013}" } }
                        td.number { @match bit.logit { Some(l) => (format!("{l:.2}")), None => "\u{2013}" } }
                    }
                }
            }
        }
    }
}

fn differs(bit: &Bit) -> bool {
    bit.wanted.is_some_and(|wanted| wanted != bit.read)
}

fn digit(bit: bool) -> &'static str {
    if bit { "1" } else { "0" }
}
