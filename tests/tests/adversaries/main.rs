//! What adversaries do to marks, with the outcome, also where they win: docs/security.md tells of it.
mod attacked;
mod climbing;
mod copies;
mod removing;
mod retraining;
