//! OpenEXR pictures, read within limits: the limits of the crate `image` do not reach into these.
//!
//! A header may promise a window of data of any size, behind a small one that is shown, and blocks of any size, which
//! are unpacked whole. Both are held against the file before anything is allocated, and blocks are unpacked one after
//! the other: in parallel, a damaged one could take the program with it.
use std::io::Cursor;

use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::math::Vec2;
use exr::meta::attribute::Text;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::read;

use super::files::MAX_PIXELS;
use crate::picture::Picture;

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Largest side of a picture or a tile, and most layers and channels: more than anybody needs, and numbers that stay
/// within bounds when they are multiplied.
const MAX_SIDE: usize = 1 << 26;
const MAX_PARTS: usize = 1024;
/// Bytes of a block that any file may have: 256 lines, the most that a compression takes at once, of 16 KiB.
const BLOCK: u64 = 4 << 20;
/// Bytes of a block beyond these, for each byte of the file.
const BLOCK_RATIO: u64 = 64;

/// Whether a file that begins so is an OpenEXR picture.
pub(super) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// The first layer of red, green and blue, cut to the window that is shown; what is transparent or has no data shows
/// `background` through.
pub(super) fn decode(bytes: &[u8], background: [f32; 3]) -> Result<Picture, String> {
    let meta = MetaData::read_from_buffered(bytes, false).map_err(|e| e.to_string())?;
    let header = check(&meta, bytes.len() as u64)?;
    let window = header.shared_attributes.display_window;
    let Vec2(width, height) = window.size;
    let Vec2(left, top) = header.own_attributes.layer_position;
    let (left, top) = (
        i64::from(left) - i64::from(window.position.0),
        i64::from(top) - i64::from(window.position.1),
    );
    let set = move |pixels: &mut Vec<f32>, at: Vec2<usize>, (r, g, b, a): (f32, f32, f32, f32)| {
        let (x, y) = (left + at.0 as i64, top + at.1 as i64);
        if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
            let place = 3 * (y as usize * width + x as usize);
            for ((out, value), behind) in pixels[place..place + 3].iter_mut().zip([r, g, b]).zip(background) {
                *out = value * a + behind * (1.0 - a);
            }
        }
    };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(move |_, _| background.repeat(width * height), set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    Ok(Picture {
        width: width as u32,
        height: height as u32,
        pixels: image.layer_data.channel_data.pixels,
    })
}

/// The header of the layer that is read; `Err` says which limit the file breaks.
fn check(meta: &MetaData, file: u64) -> Result<&Header, String> {
    let mut table = 0u64;
    if meta.headers.len() > MAX_PARTS {
        return Err(format!("{} layers are more than {MAX_PARTS}", meta.headers.len()));
    }
    for header in &meta.headers {
        limited(header, file)?;
        table = table.saturating_add((header.chunk_count as u64).saturating_mul(8));
    }
    if table > file {
        return Err(format!("truncated: a table of {table} bytes in a file of {file}"));
    }
    let has = |header: &Header, name: &str| header.channels.find_index_of_channel(&Text::from(name)).is_some();
    let mut layers = meta
        .headers
        .iter()
        .filter(|header| ["R", "G", "B"].iter().all(|name| has(header, name)));
    layers
        .next()
        .ok_or_else(|| "it has no layer of red, green and blue".to_string())
}

fn limited(header: &Header, file: u64) -> Result<(), String> {
    if header.deep {
        return Err("deep pictures are not read".into());
    }
    let window = header.shared_attributes.display_window.size;
    let lines = header.compression.scan_lines_per_block();
    let width = header.layer_size.0;
    let block = match header.blocks {
        BlockDescription::Tiles(tiles) => tiles.tile_size,
        BlockDescription::ScanLines => Vec2(width, lines),
    };
    for size in [window, header.layer_size, block] {
        if !(1..=MAX_SIDE).contains(&size.0) || !(1..=MAX_SIDE).contains(&size.1) {
            return Err(format!("a window or block of {} x {} pixels", size.0, size.1));
        }
    }
    for Vec2(width, height) in [window, header.layer_size] {
        if width as u64 * height as u64 > MAX_PIXELS {
            return Err(format!("{width} x {height} pixels are more than {MAX_PIXELS}"));
        }
    }
    let channels = &header.channels;
    if channels.list.len() > MAX_PARTS {
        return Err(format!("{} channels are more than {MAX_PARTS}", channels.list.len()));
    }
    if channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err("channels of fewer samples than pixels are not read".into());
    }
    let bytes = (block.0 as u64 * block.1 as u64).saturating_mul(channels.bytes_per_pixel as u64);
    let most = BLOCK.max(file.saturating_mul(BLOCK_RATIO));
    if bytes > most {
        return Err(format!(
            "blocks of {bytes} bytes; a file of {file} bytes may have {most} at most"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{PictureFormat, encode_picture};
    use image::{DynamicImage, ImageFormat, RgbaImage};

    fn picture() -> Picture {
        Picture {
            width: 9,
            height: 5,
            pixels: (0..9 * 5 * 3).map(|i| i as f32 / 8.0 - 2.0).collect(),
        }
    }

    /// A file whose attribute `name` has other bytes from `at` on.
    fn with(name: &str, at: usize, bytes: &[u8]) -> Vec<u8> {
        let mut file = encode_picture(&picture(), PictureFormat::Exr).unwrap();
        let attribute = [name.as_bytes(), b"\0"].concat();
        let kind = file.windows(attribute.len()).position(|w| w == attribute).unwrap() + attribute.len();
        // Its name, its kind, four bytes of its length, its value.
        let start = kind + file[kind..].iter().position(|b| *b == 0).unwrap() + 5 + at;
        file[start..start + bytes.len()].copy_from_slice(bytes);
        file
    }

    fn reason(file: &[u8]) -> String {
        decode(file, [0.0; 3]).unwrap_err()
    }

    #[test]
    fn pictures_are_as_the_window_shows_them() {
        assert_eq!(decode(&with("compression", 0, b""), [0.5; 3]).unwrap(), picture());
        let shown = |left: i32, right: i32| {
            let window = [left, 1, right, 2].map(i32::to_le_bytes).concat();
            decode(&with("displayWindow", 0, &window), [7.0; 3]).unwrap()
        };
        // Two rows, of three columns that are there...
        let cut = shown(2, 4);
        assert_eq!((cut.width, cut.height), (3, 2));
        assert_eq!(cut.pixels[..9], picture().pixels[3 * 11..3 * 14]);
        // ...and of one beyond the right edge, which shows the background.
        let beyond = shown(8, 9);
        assert_eq!(beyond.pixels[..3], picture().pixels[3 * 17..3 * 18]);
        assert_eq!(beyond.pixels[3..6], [7.0; 3]);
    }

    #[test]
    fn transparent_pixels_show_the_background() {
        let mut image = RgbaImage::new(2, 1);
        image.put_pixel(0, 0, image::Rgba([255, 0, 0, 255]));
        let mut bytes = Cursor::new(Vec::new());
        let image = DynamicImage::ImageRgba32F(DynamicImage::ImageRgba8(image).to_rgba32f());
        image.write_to(&mut bytes, ImageFormat::OpenExr).unwrap();
        let decoded = decode(bytes.get_ref(), [0.25, 0.5, 1.0]).unwrap();
        assert_eq!(decoded.pixels, [1.0, 0.0, 0.0, 0.25, 0.5, 1.0]);
    }

    #[test]
    fn windows_that_promise_too_much_are_refused() {
        let far = 99_999i32.to_le_bytes();
        let both = [far, far].concat();
        for window in ["dataWindow", "displayWindow"] {
            let found = reason(&with(window, 8, &both));
            assert!(
                found.contains("100000 x 100000 pixels are more than 64000000"),
                "{window}: {found}"
            );
            let found = reason(&with(window, 8, &(1i32 << 27).to_le_bytes()));
            assert!(found.contains("a window or block of"), "{window}: {found}");
        }
        // The encoder writes tiles of 64 by 64 pixels.
        let tiles = reason(&with("tiles", 0, &(1u32 << 20).to_le_bytes()));
        assert!(
            tiles.contains("blocks of 805306368 bytes") && tiles.contains("may have 4194304 at most"),
            "{tiles}"
        );
        let high = reason(&with("dataWindow", 12, &4_000_000i32.to_le_bytes()));
        assert!(high.contains("truncated: a table of"), "{high}");
    }
}
