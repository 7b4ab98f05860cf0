//! Detectors of hidden messages in pictures.
