//! Codecs and filters on real photographs, by the numbers of other software.
use image::{Rgb, RgbImage};

use super::{attack, done};
use crate::attack::testing::{photo, psnr};

fn quality_of(text: &str, picture: &RgbImage) -> f64 {
    psnr(picture, &done(text, picture)).unwrap()
}

#[test]
fn quality_decides_how_much_is_lost() {
    let Some(photo) = photo("chelsea.png") else { return };
    for codec in ["jpeg", "webp", "jpeg-turbo", "mozjpeg"] {
        let measured =
            [1, 5, 10, 20, 30, 50, 75, 90, 95, 100].map(|quality| quality_of(&format!("{codec}:{quality}"), &photo));
        assert!(
            measured.windows(2).all(|pair| pair[0] < pair[1]),
            "{codec}: {measured:?}"
        );
    }
}

#[test]
fn codecs_lose_as_much_as_libjpeg_and_libwebp() {
    let Some(photo) = photo("chelsea.png") else { return };
    // PSNR by Pillow 12 with libjpeg-turbo (4:2:0) and libwebp 1.6. At high qualities the encoder's arithmetic shows.
    for (text, expected, apart) in [
        ("jpeg:10", 28.47, 0.1),
        ("jpeg:20", 30.98, 0.1),
        ("jpeg:50", 33.90, 0.1),
        ("jpeg:75", 35.97, 0.1),
        ("jpeg:95", 41.28, 0.5),
        ("jpeg-turbo:10", 28.47, 0.01),
        ("jpeg-turbo:50", 33.90, 0.01),
        ("jpeg-turbo:95", 41.28, 0.01),
        ("webp:10", 30.28, 0.1),
        ("webp:50", 33.86, 0.1),
        ("webp:75", 35.55, 0.1),
        ("webp:95", 42.42, 0.1),
    ] {
        let measured = quality_of(text, &photo);
        assert!(
            (measured - expected).abs() < apart,
            "{text}: {measured} instead of {expected}"
        );
    }
}

#[test]
fn avif_is_written_by_the_system_where_it_can_be() {
    let Some(missing) = attack("avif:50").missing_program() else {
        let Some(photo) = photo("chelsea.png") else { return };
        let measured = [10, 30, 50, 75, 95].map(|quality| quality_of(&format!("avif:{quality}"), &photo));
        assert!(measured.windows(2).all(|pair| pair[0] < pair[1]), "{measured:?}");
        assert!((32.0..36.0).contains(&measured[2]), "{measured:?}");
        assert_eq!(done("avif:50", &photo), done("avif:50", &photo));
        return;
    };
    assert!(missing.contains("libavif-bin"), "{missing}");
    assert!(std::env::var_os("CI").is_none(), "{missing}");
    eprintln!("skipped: {missing}");
}

#[test]
fn filters_change_as_much_as_those_of_pillow() {
    let Some(photo) = photo("chelsea.png") else { return };
    for (text, expected) in [
        ("rescale:0.5", 32.394),
        ("contrast:0.5", 21.605),
        ("saturation:0.5", 25.473),
        ("sharpen:2", 36.827),
        ("brightness:0.5", 12.334),
        ("rotate:30", 11.343),
        ("median:3", 34.223),
    ] {
        let measured = quality_of(text, &photo);
        assert!(
            (measured - expected).abs() < 0.1,
            "{text}: {measured} instead of {expected}"
        );
    }
}

#[test]
fn chroma_has_half_the_resolution() {
    // Columns of red and blue mix at 4:2:0, however high the quality; columns of light and dark don't.
    let columns = |one, other| RgbImage::from_fn(64, 64, |x, _| Rgb(if x % 2 == 0 { one } else { other }));
    for codec in ["jpeg:100", "webp:100", "jpeg-turbo:100", "mozjpeg:100"] {
        let coloured = quality_of(codec, &columns([200, 0, 0], [0, 0, 200]));
        let grey = quality_of(codec, &columns([200; 3], [50; 3]));
        assert!(coloured < 15.0 && grey > 38.0, "{codec}: {coloured} {grey}");
    }
}

#[test]
fn codecs_give_the_same_bytes_again() {
    let Some(photo) = photo("chelsea.png") else { return };
    for codec in ["jpeg:50", "webp:50", "jpeg-turbo:50", "mozjpeg:50"] {
        assert_eq!(done(codec, &photo), done(codec, &photo));
    }
}
