//! What a claim is weighed with: when files of a suspect were first seen, and how often they were read.
use super::Result;
use super::types::KeyId;

/// A reading of files, which a job made.
#[derive(Clone, Debug)]
pub struct NewReading {
    /// SHA-256 of all that decides what is read: one that is made again is the same, and no other try.
    pub id: [u8; 32],
    /// Who had it made.
    pub project: String,
    /// The key that was read with.
    pub key: KeyId,
    /// SHA-256 of each file, lower-case hexadecimal, with the time that its artifact was made.
    pub files: Vec<(String, i64)>,
}

/// What there was when a suspect was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Before {
    /// When the project first had any of the files.
    pub first_seen: i64,
    /// Readings that the project had made of any of the files, this one included.
    pub readings: u64,
    /// Readings that were made with the key, of whatever files, this one included.
    pub readings_of_key: u64,
}

/// What was seen and read, which only grows.
#[async_trait::async_trait]
pub trait ReadingHistory: Send + Sync + 'static {
    /// Notes a reading for good.
    async fn note_reading(&self, new: NewReading, now: i64) -> Result<()>;

    /// What there was, of a reading that was noted. Asked for behind the note, so that of two that are made at once at
    /// least one knows of both; `None` for one that nobody noted.
    async fn before(&self, reading: [u8; 32]) -> Result<Option<Before>>;
}
