//! Pads against an independent computation, and what whitening promises.
use std::collections::HashSet;

use guardsplat_codeword::{Code, Error, Message, MessageLength, NONCE_BYTES, Payload, Whitening, mark};
use proptest::prelude::*;

/// Lines of secret, asset, nonce, bits, pad; made by `python3 pads.py > pads.txt`.
const PADS: &str = include_str!("fixtures/pads.txt");

fn length(bits: usize) -> MessageLength {
    MessageLength::new(bits).unwrap()
}

#[test]
fn pads_agree_with_pythons_hmac() {
    let mut compared = 0;
    for line in PADS.lines() {
        let fields: Vec<&str> = line.split(' ').collect();
        let [secret, asset, nonce] = [0, 1, 2].map(|i| hex::decode(fields[i]).unwrap());
        let whitening = Whitening {
            secret: secret.as_slice().try_into().unwrap(),
            asset: &asset,
            nonce: &nonce,
        };
        let pad = whitening.pad(length(fields[3].parse().unwrap())).unwrap();
        assert_eq!(pad.to_string(), fields[4], "{line}");
        compared += 1;
    }
    assert_eq!(compared, 21);
}

#[test]
fn too_little_to_whiten_with_is_an_error() {
    let whitening = Whitening {
        secret: &[1; 32],
        asset: b"a",
        nonce: &[2; NONCE_BYTES],
    };
    let empty = Whitening {
        asset: b"",
        ..whitening
    };
    let short = Whitening {
        nonce: &[2; NONCE_BYTES - 1],
        ..whitening
    };
    let text = |w: Whitening<'_>| w.pad(MessageLength::CODED).unwrap_err().to_string();
    assert_eq!(text(empty), "asset: 0 bytes are fewer than 1");
    assert_eq!(text(short), "nonce: 15 bytes are fewer than 16");
    assert_eq!(format!("{whitening:?}"), "Whitening(..)");
}

#[test]
fn a_byte_moved_between_asset_and_nonce_makes_another_pad() {
    let bytes: Vec<u8> = (0..40).collect();
    let pads: HashSet<Message> = (1..=24)
        .map(|cut| Whitening {
            secret: &[7; 32],
            asset: &bytes[..cut],
            nonce: &bytes[cut..],
        })
        .map(|whitening| whitening.pad(MessageLength::CODED).unwrap())
        .collect();
    assert_eq!(pads.len(), 24);
}

#[test]
fn every_bit_of_a_mark_is_even_whatever_the_payload() {
    let mut ones = [0_u32; 64];
    let trials = 20_000_u32;
    for i in 0..trials {
        let asset = i.to_le_bytes();
        let whitening = Whitening {
            secret: &[9; 32],
            asset: &asset,
            nonce: &[0; NONCE_BYTES],
        };
        let marked = mark(Code::Bch36, Payload { key: 0, number: 0 }, &whitening).unwrap();
        marked
            .word
            .bits()
            .zip(&mut ones)
            .for_each(|(bit, count)| *count += u32::from(bit));
    }
    // Five standard deviations of Binomial(20000, 1/2) are 354.
    assert!(ones.iter().all(|&count| count.abs_diff(trials / 2) < 354), "{ones:?}");
}

proptest! {
    #[test]
    fn the_payload_is_under_the_pad(secret: [u8; 32], asset in prop::collection::vec(any::<u8>(), 1..50), number in 0_u32..1 << 20) {
        let whitening = Whitening { secret: &secret, asset: &asset, nonce: &[3; 20] };
        for code in Code::ALL {
            let payload = Payload { key: 200, number };
            let marked = mark(code, payload, &whitening).unwrap();
            let decoded = code.decode(&marked.word.xor(&marked.pad).unwrap()).unwrap().unwrap();
            prop_assert_eq!(Payload::unpack(code, decoded.information).unwrap(), payload);
            prop_assert_eq!(decoded.corrected_bits, 0);
        }
    }

    #[test]
    fn no_bytes_and_no_length_panic(asset: Vec<u8>, nonce: Vec<u8>, bits in 1_usize..=150) {
        let pad = Whitening { secret: &[0; 32], asset: &asset, nonce: &nonce }.pad(length(bits));
        match pad {
            Ok(pad) => prop_assert_eq!(pad.length().bits() as usize, bits),
            Err(error) => {
                let short = matches!(error, Error::TooShort { .. });
                prop_assert!(short, "{}", error);
            }
        }
    }
}
