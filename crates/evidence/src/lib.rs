//! The evidence report that every job leaves: what was asked, what was tried, what was found, and how sure that is.
//!
//! One [`Evidence`] becomes two documents, both the same bytes for the same input: canonical JSON for programs and one
//! HTML page for people, which holds that JSON and its pictures and needs nothing else. [`sign`] makes both, and
//! [`check`] says of either whether it is genuine, and computes again what can be computed again. What only an owner
//! may see is left out by [`Evidence::for_stranger`].
mod check;
mod embedding;
mod error;
mod evidence;
mod hash;
mod history;
mod html;
mod json;
pub mod limits;
mod picture;
mod recompute;
mod sign;
mod signature;
mod stranger;
mod tried;
mod validate;
mod verification;
mod words;

pub use check::{Altered, Answer, Checked, check};
pub use ed25519_dalek::{SigningKey, VerifyingKey};
pub use embedding::{Embedding, Target};
pub use error::{Error, Result};
pub use evidence::{Audience, Evidence, EvidenceKind, Input, Key, Model, Role, SCHEMA, VERSION, Worker};
pub use guardsplat_codeword::Verdict;
pub use hash::Sha256;
pub use history::{History, Registration};
pub use jiff::Timestamp;
pub use picture::{Picture, View};
pub use recompute::Finding;
pub use sign::{Signed, sign};
pub use tried::{HypothesisGroup, HypothesisKind, Multiplicity, Tried};
pub use verification::{Bit, Decision, Found, Reason, Verification};
