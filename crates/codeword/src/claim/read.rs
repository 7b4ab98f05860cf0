//! Reads the payload of a match, by taking the pad off the logits.
use super::answer::ReadPayload;
use super::{Scheme, Target};
use crate::code::Code;
use crate::code::Payload;
use crate::error::Result;
use crate::message::Message;

/// What a match says: `None` for raw words, and for targets whose pad was not given.
pub fn payload(scheme: Scheme, target: &Target, logits: &[f32]) -> Result<Option<ReadPayload>> {
    let (Some(code), Some(pad)) = (scheme.code(), &target.pad) else {
        return Ok(None);
    };
    // A 1 in the pad turns a bit around, which is what changing a logit's sign does.
    let turned: Vec<f32> = logits
        .iter()
        .zip(pad.bits())
        .map(|(&logit, bit)| if bit { -logit } else { logit })
        .collect();
    let unreadable = |reason: String| Ok(Some(ReadPayload::Unreadable { reason }));
    let Some(decoded) = code.decode_logits(&turned)? else {
        return unreadable(format!(
            "no codeword is near: more than {} bits are wrong",
            code.corrects()
        ));
    };
    match Payload::unpack(code, decoded.information) {
        Ok(payload) => Ok(Some(ReadPayload::Read {
            payload,
            corrected_bits: decoded.corrected_bits,
            filled_bits: decoded.filled_bits,
            as_registered: registered(code, &target.word, pad)? == Some(payload),
        })),
        Err(error) => unreadable(error.to_string()),
    }
}

/// What the registered word says, if it is a codeword with a payload.
fn registered(code: Code, word: &Message, pad: &Message) -> Result<Option<Payload>> {
    let decoded = code
        .decode(&word.xor(pad)?)?
        .filter(|decoded| decoded.corrected_bits == 0);
    Ok(decoded.and_then(|decoded| Payload::unpack(code, decoded.information).ok()))
}
