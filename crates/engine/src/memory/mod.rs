//! Memory: how much a job will need, how much there may be, and how much was used.
//!
//! Needs are predicted from the sizes of arrays, not from what was measured on some machine; the few constants that no
//! array explains are said where they stand. `memory-bench` (a program of the tests) holds predictions against peaks.
pub mod admission;
mod allocator;
mod limits;
mod prediction;
mod requirements;
mod usage;

pub use allocator::{give_back_freed, keep_freed};
pub use limits::Limits;
pub use prediction::{
    EmbeddingWorkload, ModelBytes, SceneSize, ViewSize, embedding_requirements, picture_bytes, rendering_requirements,
};
pub use requirements::{Bytes, MemoryRequirements};
pub use usage::{forget_peak, peak};
