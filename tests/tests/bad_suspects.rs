//! Pictures that no mark can be in, and files that are no pictures: clear answers, no crash, bounded memory.
use guardsplat_tests::TestEnvironment;
use guardsplat_tests::environment::check_refusal;
use image::{ImageFormat, Rgb, RgbImage};

const VERIFY: &str = "--key k.key --message c0ffee42 --device cpu --json";

/// A folder with a key of 32 bits.
fn environment() -> TestEnvironment {
    let environment = TestEnvironment::new();
    environment.exits("key create --bits 32 --seed 5 -o k.key --device cpu", 0);
    environment
}

fn encoded(picture: &RgbImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A picture of something else.
fn waves(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let value = |a: u32, b: u32| (127.0 + 120.0 * f64::from(a * x + b * y).mul_add(0.01, 0.3).sin()) as u8;
        Rgb([value(3, 1), value(1, 7), value(5, 5)])
    })
}

/// A PNG whose header says so many pixels, and that has one row of sixteen.
fn promised(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = encoded(&RgbImage::new(16, 1), ImageFormat::Png);
    // Both stand behind the signature, the chunk's length and its name; then comes the checksum of them all.
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes
}

/// The PNG as an animation of two frames, the second of which is missing.
fn animated(png: &[u8]) -> Vec<u8> {
    let mut chunk = b"acTL\0\0\0\x02\0\0\0\0".to_vec();
    chunk.extend(crc32(&chunk).to_be_bytes());
    // Behind the signature and the header.
    let (header, rest) = png.split_at(33);
    [header, &8_u32.to_be_bytes(), &chunk, rest].concat()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

#[test]
fn pictures_of_something_else_do_not_match() {
    let environment = environment();
    environment.write("waves.png", encoded(&waves(300, 200), ImageFormat::Png));
    environment.write(
        "white.png",
        encoded(&RgbImage::from_pixel(64, 64, Rgb([255; 3])), ImageFormat::Png),
    );
    environment.write("pixel.jpg", encoded(&RgbImage::new(1, 1), ImageFormat::Jpeg));
    environment.write("line.webp", encoded(&waves(4000, 1), ImageFormat::WebP));
    for picture in ["waves.png", "white.png", "pixel.jpg", "line.webp"] {
        let report = environment.json(&format!("verify {picture} {VERIFY}"), 2);
        assert_eq!(report["verdict"], "no_match", "{picture}: {report}");
        assert!(report["p_value"].as_f64().unwrap() > 1e-6, "{picture}: {report}");
    }
}

#[test]
fn files_that_are_no_pictures_are_told_by_name() {
    let environment = environment();
    let png = encoded(&waves(300, 200), ImageFormat::Png);
    let jpeg = encoded(&waves(300, 200), ImageFormat::Jpeg);
    let webp = encoded(&waves(300, 200), ImageFormat::WebP);
    for (name, bytes) in [
        ("empty.png", Vec::new()),
        ("half.png", png[..png.len() / 2].to_vec()),
        ("half.webp", webp[..webp.len() / 2].to_vec()),
        ("head.jpg", jpeg[..40].to_vec()),
        (
            "animated.gif",
            b"GIF89a\x01\0\x01\0\x80\0\0\0\0\0\xff\xff\xff,".to_vec(),
        ),
        // A still that was given a header of animations: what it shows first is not what it shows.
        ("animated.png", animated(&png)),
        ("text.png", b"this is no picture".to_vec()),
    ] {
        environment.write(name, bytes);
        environment.refuses(&format!("verify {name} {VERIFY}"), &[name]);
    }
}

#[test]
fn pictures_that_promise_too_much_take_no_memory() {
    let environment = environment();
    environment.write("huge.png", promised(20_000, 20_000));
    environment.write("wide.png", promised(2_000_000_000, 1));
    // 3 GiB: enough for the program and its models, and not for the pixels.
    let refuses = |name: &str, needles: &[&str]| {
        let output = environment.run_in_little_memory(3 << 20, &format!("verify {name} {VERIFY}"));
        check_refusal(name, &output, needles);
    };
    refuses("huge.png", &["huge.png", "20000"]);
    refuses("wide.png", &["wide.png"]);
}
