//! What is to be verified: scenes and pictures of one suspect, in files or in memory.
use std::borrow::Cow;
use std::path::PathBuf;

use guardsplat_engine::Result;
use guardsplat_engine::extract::Source;
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::read_picture;

/// All that is read together.
#[derive(Clone, Debug, Default)]
pub struct Suspect {
    /// Scene files, of any format, and folders of SOG.
    pub scenes: Vec<PathBuf>,
    /// Pictures, read in this order.
    pub pictures: Vec<SuspectPicture>,
}

/// A picture, wherever it is.
#[derive(Clone, Debug)]
pub enum SuspectPicture {
    /// A file, read when it is its turn: thousands of large pictures need not fit in memory.
    File(PathBuf),
    /// Pixels, all finite.
    Pixels(Picture),
}

impl SuspectPicture {
    /// Its pixels, `background` showing through transparent ones.
    ///
    /// # Errors
    /// Those of [`read_picture`].
    pub fn pixels(&self, background: [f32; 3]) -> Result<Cow<'_, Picture>> {
        Ok(match self {
            Self::File(path) => Cow::Owned(read_picture(path, background)?),
            Self::Pixels(picture) => Cow::Borrowed(picture),
        })
    }
}

impl From<Source> for Suspect {
    fn from(source: Source) -> Self {
        Self {
            scenes: source.scenes,
            pictures: source.pictures.into_iter().map(SuspectPicture::File).collect(),
        }
    }
}
