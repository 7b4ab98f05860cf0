//! Pictures to tensors and back.
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::picture::Picture;

/// That there are pictures, all of one size that is not empty, with as many numbers as that needs. The error says what
/// is not so.
pub(crate) fn comparable(pictures: &[&Picture]) -> Result<()> {
    let bad = |reason| {
        Err(Error::BadOption {
            field: "pictures",
            reason,
        })
    };
    let Some(first) = pictures.first() else {
        return bad("there are none".into());
    };
    let (width, height) = (first.width, first.height);
    let area = width as usize * height as usize;
    if area == 0 {
        return bad(format!("a picture of {width} x {height} pixels has none"));
    }
    for picture in pictures {
        let (other_width, other_height, len) = (picture.width, picture.height, picture.pixels.len());
        if (other_width, other_height) != (width, height) {
            return bad(format!(
                "sizes differ: {width} x {height} and {other_width} x {other_height}"
            ));
        }
        if len != 3 * area {
            return bad(format!("{len} values are not {width} x {height} pixels"));
        }
    }
    Ok(())
}

/// Stacks pictures of one size into `[b, 3, height, width]`, values as they are.
///
/// Fails without pictures, when sizes differ, and when a picture's pixels do not fit its size.
pub fn batch(pictures: &[&Picture], device: &Device) -> Result<Tensor<4>> {
    comparable(pictures)?;
    let (width, height) = (pictures[0].width as usize, pictures[0].height as usize);
    let area = width * height;
    let mut values = vec![0.0_f32; pictures.len() * 3 * area];
    let planes = values.par_chunks_exact_mut(3 * area).zip(pictures);
    planes.for_each(|(planes, picture)| {
        let (red, rest) = planes.split_at_mut(area);
        let (green, blue) = rest.split_at_mut(area);
        let places = red.iter_mut().zip(green).zip(blue);
        for (((red, green), blue), pixel) in places.zip(picture.pixels.as_chunks::<3>().0) {
            [*red, *green, *blue] = *pixel;
        }
    });
    Ok(Tensor::from_data(
        TensorData::new(values, [pictures.len(), 3, height, width]),
        device,
    ))
}

/// Splits `[b, 3, height, width]` into pictures, values as they are. Fails when the device does.
pub fn unbatch(tensor: Tensor<4>) -> Result<Vec<Picture>> {
    let [_, channels, height, width] = tensor.dims();
    if channels != 3 {
        return Err(Error::BadOption {
            field: "pictures",
            reason: format!("{channels} channels instead of 3"),
        });
    }
    let values = tensor.try_into_vec_as::<f32>().map_err(|e| Error::Device {
        device: "pictures".into(),
        reason: e.to_string(),
    })?;
    let area = height * width;
    let picture = |planes: &[f32]| {
        let (red, rest) = planes.split_at(area);
        let (green, blue) = rest.split_at(area);
        let mut pixels = vec![0.0; 3 * area];
        let places = pixels.as_chunks_mut::<3>().0.iter_mut();
        for (pixel, ((red, green), blue)) in places.zip(red.iter().zip(green).zip(blue)) {
            *pixel = [*red, *green, *blue];
        }
        Picture {
            width: width as u32,
            height: height as u32,
            pixels,
        }
    };
    Ok(values.par_chunks_exact((3 * area).max(1)).map(picture).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_and_layout() {
        let picture = |seed: u32| Picture {
            width: 3,
            height: 2,
            pixels: (0..18).map(|i| (i + seed) as f32).collect(),
        };
        let (a, b) = (picture(0), picture(100));
        let tensor = batch(&[&a, &b], &Device::flex()).unwrap();
        assert_eq!(tensor.dims(), [2, 3, 2, 3]);
        let green = tensor.clone().slice([0..1, 1..2]).try_into_vec_as::<f32>().unwrap();
        assert_eq!(green, [1.0, 4.0, 7.0, 10.0, 13.0, 16.0]);
        assert_eq!(unbatch(tensor).unwrap(), [a, b]);
    }

    #[test]
    fn bad_input_is_refused() {
        let device = Device::flex();
        let picture = |width, n| Picture {
            width,
            height: 1,
            pixels: vec![0.0; n],
        };
        let reason = |pictures: &[&Picture]| batch(pictures, &device).unwrap_err().to_string();
        assert!(reason(&[]).contains("none"));
        assert!(reason(&[&picture(0, 0)]).contains("0 x 1"));
        assert!(reason(&[&picture(1, 3), &picture(2, 6)]).contains("1 x 1 and 2 x 1"));
        assert!(reason(&[&picture(2, 3)]).contains("3 values are not 2 x 1"));
    }
}
