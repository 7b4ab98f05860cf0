//! The extremes that the engine must stand, each with the outcome that it must have.
mod files;
