//! A copy whose credentials are wanted, and how its mark is read.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::extract::{DEFAULT_VIEWS, Engine, find_source};
use guardsplat_engine::message::Key;
use guardsplat_engine::scene::BadRows;
use guardsplat_operations::load;
use guardsplat_operations::suspect::Suspect;
use guardsplat_operations::verification::Views;

use crate::cli::{Budget, Kind};
use crate::error::Result;

/// Arguments of what reads a mark.
#[derive(Args)]
pub struct Arguments {
    /// A scene or pictures of one, all of one copy
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<PathBuf>,
    /// The key file
    #[arg(long)]
    key: PathBuf,
    /// Where a scene's viewers are, as `embed` was told
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// A CLIP that was added with `models add`, instead of the one that the key names
    #[arg(long)]
    clip: Option<String>,
    /// Prints JSON on standard output
    #[arg(long)]
    pub json: bool,
}

impl Arguments {
    /// The files of the copy.
    pub fn suspect(&self) -> Result<Suspect> {
        Ok(find_source(&self.paths)?.into())
    }

    /// The key.
    pub fn key(&self) -> Result<Key> {
        Ok(Key::read(&self.key)?)
    }

    /// What reads the mark of this key.
    pub fn engine(&self, key: &Key) -> Result<Engine> {
        Ok(load::engine(
            &self.key,
            key,
            self.clip.as_deref(),
            self.device,
            load::Work::Reading,
            false,
            self.budget.bytes(),
        )?)
    }

    /// From where, as `verify` does unless told otherwise. Rows that can't be drawn are nobody's copy.
    pub fn views(&self) -> Result<Views> {
        Ok(Views {
            count: DEFAULT_VIEWS,
            size: None,
            background: [1.0; 3],
            seed: 0,
            cameras: load::cameras(self.cameras.as_deref())?,
            kind: self.kind.map(Kind::scene),
            bad_rows: BadRows::ignored_if(true),
            with_files: true,
            level: 0,
        })
    }
}
