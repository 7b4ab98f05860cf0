//! Decoding by how sure bits are: Chase's second algorithm.
//!
//! The least sure bits are flipped in all combinations, each result is decoded, and of the codewords found the one is
//! taken that contradicts the logits least. Source: D. Chase, A class of algorithms for decoding block codes with channel
//! measurement information, IEEE Transactions on Information Theory 18 (1972).
use super::Code;

/// Bits that are flipped in all combinations: half the minimum distance of (63, 30), and more for the others.
const FLIPPED: usize = 7;

/// The codeword found that contradicts `logits` least, for `value` decided from them; the first found where several do.
pub fn nearest(code: Code, value: u64, logits: &[f32]) -> Option<u64> {
    // Bit i of the integer is decided by the logit 63 - i.
    let mut sure = [0.0_f64; 64];
    for (place, &logit) in sure.iter_mut().rev().zip(logits) {
        // NaN says nothing; sums of the largest sizes stay finite.
        *place = if logit.is_nan() {
            0.0
        } else {
            f64::from(logit.abs()).min(1e30)
        };
    }
    // Flipping the parity bit, at 0, would change nothing: the code of 63 bits is decoded.
    let mut order: Vec<usize> = (1..64).collect();
    order.sort_by(|&a, &b| sure[a].total_cmp(&sure[b]));
    order.truncate(FLIPPED);

    let mut best: Option<(f64, u64)> = None;
    for choice in 0_u32..1 << order.len() {
        let flips = order
            .iter()
            .enumerate()
            .fold(0, |mask, (i, &place)| mask | u64::from(choice >> i & 1) << place);
        let Some(codeword) = code.nearest(value ^ flips) else {
            continue;
        };
        let against = (0..64)
            .filter(|i| (codeword ^ value) >> i & 1 == 1)
            .map(|i| sure[i])
            .sum();
        if best.is_none_or(|(least, _)| against < least) {
            best = Some((against, codeword));
        }
    }
    best.map(|(_, codeword)| codeword)
}
