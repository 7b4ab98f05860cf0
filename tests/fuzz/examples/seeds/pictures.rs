//! Pictures of all four formats.
use super::{put, put_damaged};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::quality::{PictureFormat, encode_picture};
use image::{DynamicImage, ImageFormat};
use std::io::Cursor;

pub fn put_all() {
    let pixels: Vec<f32> = (0..9 * 5 * 3).map(|i| (i % 17) as f32 / 16.0).collect();
    let picture = Picture {
        width: 9,
        height: 5,
        pixels,
    };
    let formats = [
        ("png", PictureFormat::Png),
        ("jpeg", PictureFormat::Jpeg(80)),
        ("webp", PictureFormat::WebP),
        ("exr", PictureFormat::Exr),
    ];
    for (name, format) in formats {
        let bytes = encode_picture(&picture, format).expect("a small picture is written");
        put_damaged("picture", name, &bytes);
        if name == "exr" {
            put_damaged("exr", "rgb", &bytes);
            windows(&bytes);
        }
    }
    let mut rgba = image::RgbaImage::new(4, 3);
    rgba.pixels_mut()
        .enumerate()
        .for_each(|(i, p)| p.0 = [i as u8 * 20, 9, 200, i as u8 * 21]);
    let image = DynamicImage::ImageRgba8(rgba);
    put(
        "picture",
        "png-16-alpha",
        encoded(DynamicImage::ImageRgba16(image.to_rgba16()), ImageFormat::Png),
    );
    put(
        "picture",
        "png-grey",
        encoded(DynamicImage::ImageLuma8(image.to_luma8()), ImageFormat::Png),
    );
    put("picture", "webp-alpha", encoded(image.clone(), ImageFormat::WebP));
    put(
        "exr",
        "rgba",
        encoded(DynamicImage::ImageRgba32F(image.to_rgba32f()), ImageFormat::OpenExr),
    );
    let mut large = encoded(image, ImageFormat::Png);
    large[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    put("picture", "png-large", large);
}

fn encoded(image: DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("a small picture is written");
    bytes.into_inner()
}

/// Windows and compressions other than those of the encoder. Every attribute is its name, its kind, its length and its
/// value.
fn windows(exr: &[u8]) {
    let value = |name: &str| {
        let at = exr
            .windows(name.len() + 1)
            .position(|w| w == [name.as_bytes(), b"\0"].concat());
        let kind = at.expect("the attribute is there") + name.len() + 1;
        kind + exr[kind..].iter().position(|b| *b == 0).expect("a kind ends") + 5
    };
    let with = |name: &str, at: usize, bytes: &[u8]| {
        let start = value(name) + at;
        [&exr[..start], bytes, &exr[start + bytes.len()..]].concat()
    };
    let far = i32::MAX.to_le_bytes();
    put("exr", "data-wide", with("dataWindow", 8, &far));
    put("exr", "data-high", with("dataWindow", 12, &far));
    put("exr", "data-elsewhere", with("dataWindow", 0, &i32::MIN.to_le_bytes()));
    put("exr", "shown-wide", with("displayWindow", 8, &far));
    put(
        "exr",
        "shown-small",
        with("displayWindow", 8, &[1, 0, 0, 0, 1, 0, 0, 0]),
    );
    put("exr", "shown-empty", with("displayWindow", 8, &[255; 8]));
    for compression in 0..=9u8 {
        put(
            "exr",
            &format!("compression-{compression}"),
            with("compression", 0, &[compression]),
        );
    }
}
