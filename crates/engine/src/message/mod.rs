//! The keyed message: its tokens, and the decoder that reads it from CLIP features. What a message is, and how sure a
//! reading of it is, says `guardsplat_codeword`.
pub mod decoder;
pub(crate) mod eigen;
pub mod fit;
pub mod key;
mod linear;
pub(crate) mod matrix;
pub mod projection;
pub mod reader;
mod samples;
pub mod tokens;
pub mod training;

pub use decoder::{Decoder, DecoderWeights, bce_from_logits};
pub use fit::{FitOptions, fit};
pub use guardsplat_codeword::Message;
pub use key::MAX_KEY_BYTES;
pub use key::{ClipIdentity, Decoding, Key, KeyOptions};
pub use projection::Projection;
pub use reader::Reader;
pub use tokens::{CONTEXT, TokenTable};
pub use training::{DecoderKind, Trained, TrainingOptions, train};
