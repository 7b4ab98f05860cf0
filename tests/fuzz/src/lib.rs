//! Fuzz targets for everything that reads what a stranger may have written.
//!
//! A target is a function of bytes. It does with them what the programs do with such a file or text, asks of whatever is
//! accepted that it holds together, and lets the parser have twice the file and 64 MiB ([`memory`]). It panics where
//! something is wrong, and never for bytes that are refused.
mod claims;
pub mod memory;
mod models;
mod packages;
mod pictures;
mod scenes;
mod server;
pub mod sog;
mod texts;

pub use claims::{commitment, evidence};
pub use models::{TINY_CLIP, clip_config, clip_weights, key, lpips, manifest};
pub use packages::{lpips_checkpoint, lpips_package};
pub use pictures::{exr, picture};
pub use scenes::{compressed_ply, gltf, ksplat, ply, scene, splat, spz, summary};
pub use server::{names, page_token, requests, sealed, server_settings};
pub use sog::{sog, sog_meta, sog_picture};
pub use texts::{cameras, embed_settings, message, resolution, soft_binding};

/// A target by its name, which is also that of its program, of its folder in `corpus` and of its dictionary.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The name.
    pub name: &'static str,
    /// What it does with bytes.
    pub run: fn(&[u8]),
}

macro_rules! targets {
    ($($name:ident),* $(,)?) => {
        /// All targets.
        pub const TARGETS: &[Target] = &[$(Target { name: stringify!($name), run: $name }),*];
    };
}

targets![
    ply,
    compressed_ply,
    spz,
    splat,
    ksplat,
    sog,
    sog_meta,
    sog_picture,
    gltf,
    scene,
    summary,
    cameras,
    key,
    clip_config,
    clip_weights,
    lpips,
    lpips_checkpoint,
    lpips_package,
    manifest,
    picture,
    exr,
    embed_settings,
    message,
    soft_binding,
    resolution,
    page_token,
    names,
    requests,
    sealed,
    server_settings,
    evidence,
    commitment,
];
