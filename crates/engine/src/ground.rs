//! The black or white ground around a scene, which distortions of a picture leave as it is.
use burn::tensor::{Tensor, TensorData};

/// How far a ground may be from black or white.
const TOLERANCE: f32 = 1e-3;

/// Pictures `[b, 3, h, w]` after something was done to them, with the ground that they had before where it was black or
/// white, in those pictures for which `stays` says so: whoever reads a picture makes its ground white
/// ([`guardsplat_codeword::PhotometricCorrection::WhiteBackground`]). Noise that is cut at white would shift all of it.
pub(crate) fn with_ground(before: &Tensor<4>, after: Tensor<4>, stays: &[bool]) -> Tensor<4> {
    let [b, _, h, w] = before.dims();
    let stays: Vec<f32> = stays.iter().map(|stays| f32::from(u8::from(*stays))).collect();
    let device = before.device();
    let stays = Tensor::<1>::from_data(TensorData::new(stays, [b]), &device).reshape([b, 1, 1, 1]);
    let plain = before.clone().detach();
    let black = plain.clone().max_dim(1).lower_equal_elem(TOLERANCE);
    let white = plain.clone().min_dim(1).greater_equal_elem(1.0 - TOLERANCE);
    let ground = ((black.float() + white.float()) * stays).expand([b, 3, h, w]);
    after.clone() + (plain - after) * ground
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    #[test]
    fn white_and_black_grounds_stay_where_they_are_to_and_nothing_else() {
        let device = Device::flex();
        // Left half white, a quarter black, a quarter grey.
        let level = |i: usize| match i % 8 {
            0..4 => 1.0,
            4..6 => 0.0,
            _ => 0.5,
        };
        let values: Vec<f32> = (0..2 * 3 * 64).map(level).collect();
        let before = Tensor::<4>::from_data(TensorData::new(values.clone(), [2, 3, 8, 8]), &device);
        let after = before.clone() * 0.9 + 0.02;
        let kept = with_ground(&before, after.clone(), &[true, false]);
        let (kept, after) = (
            kept.try_to_vec_as::<f32>().unwrap(),
            after.try_to_vec_as::<f32>().unwrap(),
        );
        for (i, value) in values.iter().enumerate() {
            let stays = i < 3 * 64 && *value != 0.5;
            assert_eq!(kept[i], if stays { *value } else { after[i] }, "{i}");
        }
    }
}
