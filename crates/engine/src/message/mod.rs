//! The keyed message: its bits, its tokens, the decoder that reads it from CLIP features, and how sure a reading is.
pub mod bits;
pub mod decoder;
pub(crate) mod eigen;
pub mod fit;
pub mod key;
mod linear;
pub(crate) mod matrix;
pub mod projection;
pub mod reader;
mod samples;
pub mod significance;
pub mod tokens;
pub mod training;

pub use bits::{MAX_BITS, Message};
pub use decoder::{Decoder, DecoderWeights, bce_from_logits};
pub use fit::{FitOptions, fit};
pub use key::MAX_KEY_BYTES;
pub use key::{ClipIdentity, Decoding, Key, KeyOptions};
pub use projection::Projection;
pub use reader::Reader;
pub use significance::{Decision, FALSE_POSITIVE_RATE, Verdict, decide};
pub use tokens::{CONTEXT, TokenTable};
pub use training::{DecoderKind, Trained, TrainingOptions, train};
