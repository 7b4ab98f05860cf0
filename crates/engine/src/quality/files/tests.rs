//! Pictures of files: all kinds that are read, and what is refused.
use super::*;
use crate::testing::largest_difference;

const BLACK: [f32; 3] = [0.0; 3];

fn picture() -> Picture {
    let pixels = (0..20 * 12 * 3).map(|i| ((i % 60) as f32 / 59.0 + (i / 60) as f32 / 12.0) / 2.0);
    Picture {
        width: 20,
        height: 12,
        pixels: pixels.collect(),
    }
}

#[test]
fn files_come_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let wide = Picture {
        pixels: picture().pixels.iter().map(|v| 3.0 * v - 1.0).collect(),
        ..picture()
    };
    for (name, picture, expected, tolerance) in [
        ("a.png", &wide, wide.to_8_bit(), 1e-6),
        ("a.webp", &wide, wide.to_8_bit(), 1e-6),
        ("a.exr", &wide, wide.clone(), 0.0),
        ("a.JPG", &picture(), picture(), 0.06),
    ] {
        let path = folder.path().join(name);
        write_picture(&path, picture).unwrap();
        let back = read_picture(&path, BLACK).unwrap();
        let difference = largest_difference(&back, &expected);
        assert!(difference <= tolerance, "{name}: {difference}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
}

#[test]
fn jpeg_quality_counts() {
    let error = |quality| {
        let bytes = encode_picture(&picture(), PictureFormat::Jpeg(quality)).unwrap();
        largest_difference(&decode_picture(&bytes, BLACK).unwrap(), &picture())
    };
    assert!(error(100) < error(10));
    assert!(error(0) == error(1));
}

#[test]
fn transparent_pixels_show_the_background() {
    let mut image = image::RgbaImage::new(2, 1);
    image.put_pixel(0, 0, image::Rgba([255, 0, 0, 255]));
    image.put_pixel(1, 0, image::Rgba([255, 0, 0, 0]));
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).unwrap();
    let decoded = decode_picture(bytes.get_ref(), [0.25, 0.5, 1.0]).unwrap();
    assert_eq!(decoded.pixels, [1.0, 0.0, 0.0, 0.25, 0.5, 1.0]);
}

#[test]
fn a_header_that_promises_too_much_is_refused() {
    // A PNG's size lies in bytes 16 to 24 and is covered by the checksum that follows its header.
    let mut bytes = encode_picture(&picture(), PictureFormat::Png).unwrap();
    bytes[16..20].copy_from_slice(&100_000_u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&100_000_u32.to_be_bytes());
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    let reason = decode_picture(&bytes, BLACK).unwrap_err();
    assert!(
        reason.contains("100000 x 100000 pixels are more than 64000000") || reason.contains("limit"),
        "{reason}"
    );
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| {
            if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 }
        })
    })
}

#[test]
fn damage_and_strangers_are_errors() {
    for format in [
        PictureFormat::Png,
        PictureFormat::Jpeg(90),
        PictureFormat::WebP,
        PictureFormat::Exr,
    ] {
        let bytes = encode_picture(&picture(), format).unwrap();
        assert!(decode_picture(&bytes[..20], BLACK).is_err(), "{format:?}");
    }
    assert!(decode_picture(b"ply\nformat", BLACK).unwrap_err().contains("not a PNG"));
    assert!(decode_picture(b"", BLACK).is_err());
    let mut broken = picture();
    broken.pixels[3 * 21] = f32::NAN;
    let bytes = encode_picture(&broken, PictureFormat::Exr).unwrap();
    assert!(
        decode_picture(&bytes, BLACK)
            .unwrap_err()
            .contains("pixel (1, 1) is NaN")
    );
    let empty = Picture {
        width: 0,
        height: 0,
        pixels: Vec::new(),
    };
    assert!(encode_picture(&empty, PictureFormat::Png).is_err());
    let short = Picture {
        pixels: vec![0.0; 3],
        ..picture()
    };
    assert!(
        encode_picture(&short, PictureFormat::Png)
            .unwrap_err()
            .contains("3 values are not 20 x 12")
    );
}

#[test]
fn errors_name_the_file_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let error = write_picture(&folder.path().join("a.gif"), &picture())
        .unwrap_err()
        .to_string();
    assert!(error.contains("a.gif") && error.contains("png"));
    assert!(matches!(
        write_picture(&folder.path().join("no/a.png"), &picture()),
        Err(Error::Io { .. })
    ));
    assert!(matches!(
        read_picture(&folder.path().join("a.png"), BLACK),
        Err(Error::Io { .. })
    ));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
