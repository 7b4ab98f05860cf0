//! Pictures that another encoder made, and those that are none.
use super::super::picture::{Picture, Size};
use super::*;

/// By libwebp, lossless and exact: 5 x 3 pixels of no pattern, and 8 x 8 of some.
const SCATTERED: &str = "5249464672000000574542505650384c660000002f04800010b93244f43f6028b28d4e7268e02e87d9936462c9a1a86d\
    2329732329fff7cc2e3845912435971c9c9e40108110c4200101e98f0ecc288464857278100f218ab8fe1184115518515c8442537d5bf3475f7e\
    6bc04cae81d8e1b6db8861be1ade1931";
const SMOOTH: &str = "5249464636000000574542505650384c2a0000002f07c00110b98ce87fec22a2ff0121016184ff6b3507c6432c98e27d29\
    452040992a0c3101a05af36f00";
/// The same, lossy with alpha: 4 x 4 pixels.
const LOSSY: &str = "524946464800000057454250565038580a00000010000000030000030000414c50480a0000000107d0a688084444ff035650\
    3820180000003001009d012a0400040001402625a400037000fef2e30000";

fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u32> = text.chars().filter_map(|c| c.to_digit(16)).collect();
    digits.chunks(2).map(|pair| (16 * pair[0] + pair[1]) as u8).collect()
}

fn decode(webp: Vec<u8>) -> Result<Picture, String> {
    Picture::decode(webp, |_| Ok(()))
}

/// The pixels that both constants were made of.
fn expected(i: usize, scattered: bool) -> [u8; 4] {
    if scattered {
        return std::array::from_fn(|channel| (i * 37 + channel * 91 + i * i * channel * 13) as u8);
    }
    [i / 8 * 30, i % 8 * 20, i * 7, i * 4].map(|value| value as u8)
}

#[test]
fn another_encoders_pixels_are_read() {
    for (text, width, height, scattered) in [(SCATTERED, 5, 3, true), (SMOOTH, 8, 8, false)] {
        let picture = decode(hex(text)).unwrap();
        assert_eq!(picture.size(), Size { width, height });
        for i in 0..(width * height) as usize {
            assert_eq!(picture.texel(i), expected(i, scattered), "pixel {i}");
        }
        assert_eq!(decode(picture.encode().unwrap()).unwrap(), picture);
    }
}

/// Decoders are to ignore the hint that all pixels are opaque.
#[test]
fn alpha_counts_whatever_its_hint_says() {
    let mut webp = hex(SCATTERED);
    assert_eq!(webp[24] & 0x10, 0x10);
    webp[24] &= !0x10;
    assert_eq!(decode(webp).unwrap().texel(7), expected(7, true));
    // An opaque picture has no alpha to read.
    let mut opaque = Vec::new();
    WebPEncoder::new(&mut opaque)
        .encode(&[1, 2, 3, 4, 5, 6], 2, 1, ColorType::Rgb8)
        .unwrap();
    assert_eq!(opaque[24] & 0x10, 0);
    assert_eq!(decode(opaque).unwrap().texel(1), [4, 5, 6, 255]);
}

/// The container with room for metadata holds the same pixels.
#[test]
fn pictures_with_metadata_are_read() {
    let mut webp = Vec::new();
    let mut encoder = WebPEncoder::new(&mut webp);
    encoder.set_exif_metadata(vec![1, 2, 3]);
    encoder
        .encode(&[1, 2, 3, 4, 5, 6, 7, 8], 2, 1, ColorType::Rgba8)
        .unwrap();
    assert_eq!(&webp[12..16], b"VP8X");
    assert_eq!(decode(webp).unwrap().texel(1), [5, 6, 7, 8]);
}

#[test]
fn other_pictures_are_refused() {
    let reason = decode(hex(LOSSY)).unwrap_err();
    assert!(reason.starts_with("a lossy or animated WebP"), "{reason}");
    for webp in [&b""[..], b"\x89PNG\r\n\x1a\n", b"RIFF\x04\0\0\0WEBP"] {
        let reason = decode(webp.to_vec()).unwrap_err();
        assert!(reason.starts_with("not a readable WebP"), "{reason}");
    }
    let whole = hex(SMOOTH);
    for end in 0..whole.len() - 1 {
        let _ = decode(whole[..end].to_vec());
    }
    assert!(decode(whole[..40].to_vec()).is_err());
}

/// Nobody's pixels are decoded before somebody allowed for them.
#[test]
fn the_size_is_asked_about_first() {
    let mut seen = None;
    let reason = Picture::decode(hex(SMOOTH), |size| {
        seen = Some(size.bytes());
        Err("too many".to_string())
    });
    assert_eq!((reason.unwrap_err(), seen), ("too many".to_string(), Some(256)));
}
