//! The field with 64 elements, and the generators of the BCH codes over it.
//!
//! GF(2^6) = GF(2)[x] / (x^6 + x + 1), in which α = x is primitive. Source: Lin and Costello, Error Control Coding
//! (2nd edition), chapters 2 and 6.

/// Order of the multiplicative group; also the length of the BCH codes.
pub const ORDER: u32 = 63;

/// x^6 + x + 1.
const PRIMITIVE: u8 = 0b100_0011;

/// α^i for i below twice the order, so that sums of two logarithms need no reduction.
const EXP: [u8; 128] = exponentials();
/// Logarithm of an element to the base α; that of 0 is not used.
const LOG: [u8; 64] = logarithms();

/// α^`exponent`.
pub const fn power(exponent: u32) -> u8 {
    EXP[(exponent % ORDER) as usize]
}

/// Product of two elements.
pub const fn mul(a: u8, b: u8) -> u8 {
    if a == 0 || b == 0 {
        return 0;
    }
    EXP[LOG[a as usize & 63] as usize + LOG[b as usize & 63] as usize]
}

/// Quotient of two elements; by 0 it is 0.
pub const fn div(a: u8, b: u8) -> u8 {
    if a == 0 || b == 0 {
        return 0;
    }
    EXP[LOG[a as usize & 63] as usize + ORDER as usize - LOG[b as usize & 63] as usize]
}

/// The generator of the narrow-sense BCH code that corrects `t` errors, coefficient of x^i at bit i: the product of
/// x + α^r over the conjugates α^r of α, α^3, …, α^(2t - 1).
pub const fn generator(t: u32) -> u64 {
    let mut roots = 0_u64;
    let mut odd = 1;
    while odd < 2 * t {
        let mut r = odd % ORDER;
        while roots >> r & 1 == 0 {
            roots |= 1 << r;
            r = 2 * r % ORDER;
        }
        odd += 2;
    }
    let mut coefficients = [0_u8; 64];
    coefficients[0] = 1;
    let mut r = 0;
    while r < ORDER {
        if roots >> r & 1 == 1 {
            let mut i = 63;
            while i > 0 {
                coefficients[i] = coefficients[i - 1] ^ mul(coefficients[i], power(r));
                i -= 1;
            }
            coefficients[0] = mul(coefficients[0], power(r));
        }
        r += 1;
    }
    // Conjugates multiply to polynomials over GF(2).
    let (mut generator, mut i) = (0, 0);
    while i < 64 {
        generator |= (coefficients[i] as u64 & 1) << i;
        i += 1;
    }
    generator
}

const fn exponentials() -> [u8; 128] {
    let mut table = [0; 128];
    let (mut element, mut i) = (1_u8, 0);
    while i < 128 {
        table[i] = element;
        element <<= 1;
        if element & 0b100_0000 != 0 {
            element ^= PRIMITIVE;
        }
        i += 1;
    }
    table
}

const fn logarithms() -> [u8; 64] {
    let mut table = [0; 64];
    let mut i = 0;
    while i < ORDER as usize {
        table[EXP[i] as usize] = i as u8;
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Product by shifting and reducing, as one does it on paper.
    fn slow(a: u8, b: u8) -> u8 {
        let mut product = (0..6)
            .filter(|i| b >> i & 1 == 1)
            .fold(0_u16, |sum, i| sum ^ u16::from(a) << i);
        for i in (6..12).rev() {
            if product >> i & 1 == 1 {
                product ^= u16::from(PRIMITIVE) << (i - 6);
            }
        }
        product as u8
    }

    #[test]
    fn products_agree_with_polynomials() {
        for a in 0..64 {
            for b in 0..64 {
                assert_eq!(mul(a, b), slow(a, b), "{a} {b}");
                if b != 0 {
                    assert_eq!(div(mul(a, b), b), a);
                }
            }
        }
        assert_eq!((1..64).map(power).collect::<std::collections::HashSet<_>>().len(), 63);
    }

    #[test]
    fn generators_agree_with_the_published_ones() {
        // Lin and Costello, appendix C, in octal.
        assert_eq!(generator(1), 0o103);
        assert_eq!(generator(2), 0o12471);
        assert_eq!(generator(3), 0o1701317);
        assert_eq!(generator(5), 0o1033500423);
        assert_eq!(generator(6), 0o157464165547);
        assert_eq!(generator(11), 0o6331141367235453);
    }
}
