//! What kind of word a mark holds.
use serde::{Deserialize, Serialize};

use super::Code;
use crate::message::MessageLength;

/// The lengths that the paper reports, in bits.
pub const PAPER_LENGTHS: [u32; 5] = [16, 32, 48, 64, 72];

/// What kind of word a mark holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scheme {
    /// The paper's: bits as given, without a code or whitening. A p-value then supposes that whoever chose the bits drew
    /// them at random and kept them secret.
    Raw {
        /// Bits of the word.
        bits: MessageLength,
    },
    /// 64 bits: a payload in a codeword, whitened by a secret pad.
    Coded {
        /// The code.
        code: Code,
    },
}

impl Default for Scheme {
    fn default() -> Self {
        Self::Coded { code: Code::default() }
    }
}

impl Scheme {
    /// Bits of its words.
    pub fn length(self) -> MessageLength {
        match self {
            Self::Raw { bits } => bits,
            Self::Coded { .. } => MessageLength::CODED,
        }
    }

    /// Its code, if it has one.
    pub fn code(self) -> Option<Code> {
        match self {
            Self::Raw { .. } => None,
            Self::Coded { code } => Some(code),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemes_come_back_from_json_and_impossible_ones_do_not() {
        let lengths = PAPER_LENGTHS.into_iter().chain([1, 150]);
        let raw = lengths.map(|bits| Scheme::Raw {
            bits: bits.try_into().unwrap(),
        });
        for scheme in raw.chain(Code::ALL.map(|code| Scheme::Coded { code })) {
            let json = serde_json::to_string(&scheme).unwrap();
            assert_eq!(serde_json::from_str::<Scheme>(&json).unwrap(), scheme, "{json}");
        }
        assert_eq!(
            serde_json::to_string(&Scheme::default()).unwrap(),
            r#"{"coded":{"code":"bch36"}}"#
        );
        for bad in [
            r#"{"raw":{"bits":0}}"#,
            r#"{"raw":{"bits":151}}"#,
            r#"{"coded":{"code":"bch31"}}"#,
        ] {
            assert!(serde_json::from_str::<Scheme>(bad).is_err(), "{bad}");
        }
    }
}
