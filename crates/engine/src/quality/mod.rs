//! How much a mark shows: PSNR, SSIM and LPIPS of marked against original views, and pictures to look at.
mod animation;
pub mod batch;
pub mod compare;
pub mod cover;
pub mod difficulty;
mod exr;
pub mod files;
mod likeness;
mod likeness_gpu;
pub mod lpips;
mod lpips_weights;
pub mod measure;
pub mod psnr;
pub mod ssim;
mod window;

pub(crate) use batch::comparable;
pub use batch::{batch, unbatch};
pub use compare::{contact_sheet, difference};
pub use cover::{covered, psnr_covered};
pub use difficulty::Difficulty;
pub use files::{PictureFormat, decode_picture, encode_picture, is_picture, read_picture, write_picture};
pub(crate) use likeness::{Likeness, LikenessWeights, likeness_with_gradient};
pub(crate) use likeness_gpu::LikenessOnDevice;
pub use lpips::Lpips;
pub use measure::{Quality, measure};
pub use psnr::{MeanPsnr, Psnr, mean_psnr, psnr};
pub use ssim::{Ssim, ssim};
