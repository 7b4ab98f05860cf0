//! Numbers as people read them: p-values in digits and in words, sizes of files, counts.

/// Names of 10³, 10⁶ and so on, as far as readers know them.
const THOUSANDS: [&str; 6] = [
    "thousand",
    "million",
    "billion",
    "trillion",
    "quadrillion",
    "quintillion",
];

/// A probability in words that go before "cases" and never understate it: `less than one in ten trillion` for 2.1e-14.
pub(crate) fn chance(p: f64) -> String {
    if p >= 0.995 {
        return "practically all".into();
    }
    if p > 0.01 {
        return format!("about {:.0} in 100", p * 100.0);
    }
    if p <= 0.0 {
        return "no".into();
    }
    let (mantissa, exponent) = scientific(p);
    match mantissa == 1.0 {
        true => format!("one in {}", power_of_ten(exponent)),
        false => format!("less than one in {}", power_of_ten(exponent - 1)),
    }
}

/// 10ⁿ in words: `ten trillion`; beyond what has a known name, with digits: `10^25 (a one with 25 zeros)`.
fn power_of_ten(n: u32) -> String {
    let factor = ["", "ten ", "a hundred "][(n % 3) as usize];
    match (n / 3).checked_sub(1).map(|i| THOUSANDS.get(i as usize)) {
        None => ["one", "ten", "a hundred"][(n % 3) as usize].into(),
        Some(Some(name)) => format!("{}{name}", if factor.is_empty() { "a " } else { factor }),
        Some(None) => format!("10^{n} (a one with {n} zeros)"),
    }
}

/// A probability in digits, three of them: `0.0550`, `2.10e-14`.
pub(crate) fn digits(p: f64) -> String {
    if p == 0.0 || p >= 0.001 {
        format!("{p:.4}")
    } else {
        format!("{p:.2e}")
    }
}

/// p = m·10⁻ᵉ with 1 ≤ m < 10, from the decimal form, in which a power of ten is one.
fn scientific(p: f64) -> (f64, u32) {
    let text = format!("{p:e}");
    let (mantissa, exponent) = text.split_once("e-").unwrap_or((&text, "0"));
    (mantissa.parse().unwrap_or(1.0), exponent.parse().unwrap_or(0))
}

/// A whole number in groups of three digits: `1,234,567`.
pub(crate) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number with its noun: `1 view`, `20 views`.
pub(crate) fn counted(n: u64, one: &str, many: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { one } else { many })
}

/// The size of a file: `11.3 MB (11,300,000 bytes)`.
pub(crate) fn size(bytes: u64) -> String {
    let units = [("GB", 1e9), ("MB", 1e6), ("kB", 1e3)];
    match units.iter().find(|(_, unit)| bytes as f64 >= *unit) {
        Some((name, unit)) => format!("{:.1} {name} ({} bytes)", bytes as f64 / unit, grouped(bytes)),
        None => counted(bytes, "byte", "bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_are_told_in_words_that_never_understate_them() {
        let words = [
            (1.0, "practically all"),
            (0.055, "about 6 in 100"),
            (0.5, "about 50 in 100"),
            (0.01, "one in a hundred"),
            (0.004, "less than one in a hundred"),
            (1e-6, "one in a million"),
            (1.000001e-6, "less than one in a hundred thousand"),
            (9.9e-7, "less than one in a million"),
            (2.1e-14, "less than one in ten trillion"),
            (5.4e-20, "less than one in ten quintillion"),
            (7e-46, "less than one in 10^45 (a one with 45 zeros)"),
        ];
        for (p, wanted) in words {
            assert_eq!(chance(p), wanted, "{p}");
        }
        for exponent in 3..20 {
            let p = format!("1e-{exponent}").parse().unwrap();
            assert!(!chance(p).starts_with("less"), "{p}: {}", chance(p));
        }
    }

    #[test]
    fn digits_are_as_many_as_matter() {
        let wanted = [
            (1.0, "1.0000"),
            (0.05501, "0.0550"),
            (2.1e-14, "2.10e-14"),
            (0.0, "0.0000"),
        ];
        for (p, text) in wanted {
            assert_eq!(digits(p), text);
        }
        assert_eq!([0, 999, 1000, 1234567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!(size(11_300_000), "11.3 MB (11,300,000 bytes)");
        assert_eq!([0, 1, 999].map(size), ["0 bytes", "1 byte", "999 bytes"]);
        assert_eq!(counted(1, "view", "views"), "1 view");
    }
}
