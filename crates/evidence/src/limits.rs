//! How large reports and their parts may be, so that reading one that a stranger wrote takes bounded memory.

/// Bytes of JSON that are read: a thousand files with long names are under one MiB.
pub const JSON_BYTES: usize = 4 << 20;
/// Bytes of all pictures of a report together.
pub const PICTURES_BYTES: usize = 32 << 20;
/// Bytes of HTML that are read: pictures grow by a third, the JSON is in it once and its content shown once.
pub const HTML_BYTES: usize = 64 << 20;
/// Bytes of one picture.
pub const PICTURE_BYTES: usize = 8 << 20;
/// Largest side of a picture in pixels.
pub const PICTURE_SIDE: u32 = 4096;
/// Pixels of pictures that are compared with each other.
pub const COMPARED_PIXELS: u64 = 4 << 20;
/// Views with pictures.
pub const VIEWS: usize = 64;
/// Files that a job was given: the thousand pictures of a suspect and some more.
pub const INPUTS: usize = 1_100;
/// Bits of a message: the longest that keys have.
pub const BITS: usize = 150;
/// Kinds of framings, one row each.
pub const FRAMINGS: usize = 32;
/// Bytes of a name in UTF-8.
pub const NAME_BYTES: usize = 1_024;
/// Bytes of a note in UTF-8.
pub const NOTE_BYTES: usize = 4_096;
/// Notes of one kind.
pub const NOTES: usize = 32;
