//! Crop, brightness and JPEG, one after the other.
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use crate::brightness::brightness;
use crate::crop::{Crop, crop_and};
use crate::jpeg::{Jpeg, jpeg};

/// The three, with what each does to one picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combined {
    /// What is left of the picture.
    pub crop: Crop,
    /// Factor of the colours.
    pub brightness: f32,
    /// How it is compressed.
    pub jpeg: Jpeg,
}

/// Applies the three to pictures `[b, 3, h, w]`. JPEG sees the window before it is enlarged, as when a picture is
/// cropped and then stored.
pub(crate) fn combined(pictures: Tensor<4>, each: &[Combined]) -> Tensor<4> {
    let crops: Vec<_> = each.iter().map(|one| one.crop).collect();
    crop_and(pictures, &crops, |windows, positions| {
        let chosen = || positions.iter().filter_map(|&i| each.get(i));
        let factors: Vec<_> = chosen().map(|one| one.brightness).collect();
        let jpegs: Vec<_> = chosen().map(|one| one.jpeg).collect();
        jpeg(brightness(windows, &factors), &jpegs)
    })
}
