//! Quantisation tables of JPEG: the examples of ITU-T T.81 Annex K.1, scaled by quality as libjpeg does.

/// Luma, row by row; element `8 u + v` belongs to the frequency `u` along y and `v` along x.
const LUMA: [u16; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61, //
    12, 12, 14, 19, 26, 58, 60, 55, //
    14, 13, 16, 24, 40, 57, 69, 56, //
    14, 17, 22, 29, 51, 87, 80, 62, //
    18, 22, 37, 56, 68, 109, 103, 77, //
    24, 35, 55, 64, 81, 104, 113, 92, //
    49, 64, 78, 87, 103, 121, 120, 101, //
    72, 92, 95, 98, 112, 100, 103, 99,
];

/// Both chroma channels.
const CHROMA: [u16; 64] = [
    17, 18, 24, 47, 99, 99, 99, 99, //
    18, 21, 26, 66, 99, 99, 99, 99, //
    24, 26, 56, 99, 99, 99, 99, 99, //
    47, 66, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99,
];

/// Steps for luma and chroma at `quality`, which is taken as within 1 and 100. Baseline JPEG: each within 1 and 255
/// (libjpeg's `jpeg_set_quality` with `force_baseline`).
pub(super) fn tables(quality: u8) -> [[f32; 64]; 2] {
    let quality = u32::from(quality.clamp(1, 100));
    let percent = if quality < 50 {
        5000 / quality
    } else {
        200 - 2 * quality
    };
    let scaled = |step: u16| ((u32::from(step) * percent + 50) / 100).clamp(1, 255) as f32;
    [LUMA.map(scaled), CHROMA.map(scaled)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_as_libjpeg_scales() {
        // First four steps of luma and of chroma, worked out by hand.
        for (quality, luma, chroma) in [
            (10, [80.0, 55.0, 50.0, 80.0], [85.0, 90.0, 120.0, 235.0]),
            (50, [16.0, 11.0, 10.0, 16.0], [17.0, 18.0, 24.0, 47.0]),
            (90, [3.0, 2.0, 2.0, 3.0], [3.0, 4.0, 5.0, 9.0]),
            (100, [1.0; 4], [1.0; 4]),
            (1, [255.0; 4], [255.0; 4]),
        ] {
            let [l, c] = tables(quality);
            assert_eq!((&l[..4], &c[..4]), (&luma[..], &chroma[..]), "quality {quality}");
        }
        assert_eq!(tables(0), tables(1));
        assert_eq!(tables(255), tables(100));
    }
}
