//! Peak signal to noise ratio, data range 1: mean squared error over all channels of a view, then mean over views.
use serde::Serialize;

use crate::error::{Error, Result};
use crate::picture::Picture;

/// PSNR of one view; identical pictures have no finite one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Psnr {
    /// Not a single value differs.
    Identical,
    /// 10 log10(1 / MSE), in decibel.
    Decibel(f64),
}

/// PSNR over several views, in a form that JSON can carry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanPsnr {
    /// Mean over the views that differ at all; `None` (null) when none does. Leaving the identical ones out, whose
    /// PSNR is infinite, can only lower it.
    pub psnr_db: Option<f64>,
    /// Whether every view is identical.
    pub identical: bool,
    /// How many views are.
    pub identical_views: usize,
}

/// PSNR of two pictures of one size, computed in f64. Fails when sizes differ or there are no pixels.
pub fn psnr(original: &Picture, marked: &Picture) -> Result<Psnr> {
    let bad = |reason| {
        Err(Error::BadOption {
            field: "pictures",
            reason,
        })
    };
    let sizes = [original, marked].map(|p| (p.width, p.height, p.pixels.len()));
    if sizes[0] != sizes[1] {
        return bad(format!("sizes differ: {:?} and {:?}", sizes[0], sizes[1]));
    }
    if original.pixels.is_empty() {
        return bad("they have no pixels".into());
    }
    Ok(squared_error(original, marked).into())
}

/// Mean squared error of two pictures of one size that have pixels.
pub(super) fn squared_error(original: &Picture, marked: &Picture) -> f64 {
    let squares = original
        .pixels
        .iter()
        .zip(&marked.pixels)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    squares.sum::<f64>() / original.pixels.len() as f64
}

impl From<f64> for Psnr {
    /// Of a mean squared error.
    fn from(error: f64) -> Self {
        if error == 0.0 {
            Self::Identical
        } else {
            Self::Decibel(-10.0 * error.log10())
        }
    }
}

/// Mean over views. Fails without views.
pub fn mean_psnr(views: &[Psnr]) -> Result<MeanPsnr> {
    if views.is_empty() {
        return Err(Error::BadOption {
            field: "pictures",
            reason: "there are none".into(),
        });
    }
    let finite: Vec<f64> = views
        .iter()
        .filter_map(|view| match view {
            Psnr::Identical => None,
            Psnr::Decibel(value) => Some(*value),
        })
        .collect();
    let identical_views = views.len() - finite.len();
    let psnr_db = (!finite.is_empty()).then(|| finite.iter().sum::<f64>() / finite.len() as f64);
    Ok(MeanPsnr {
        psnr_db,
        identical: finite.is_empty(),
        identical_views,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32) -> Picture {
        Picture {
            width: 4,
            height: 2,
            pixels: vec![value; 24],
        }
    }

    #[test]
    fn known_values() {
        let Psnr::Decibel(db) = psnr(&grey(0.5), &grey(0.6)).unwrap() else {
            panic!()
        };
        assert!((db - 20.0).abs() < 1e-5);
        let mut one = grey(0.5);
        one.pixels[7] = 0.75; // one of 24 values: MSE = 1 / 384
        let Psnr::Decibel(db) = psnr(&grey(0.5), &one).unwrap() else {
            panic!()
        };
        assert!((db - 10.0 * 384_f64.log10()).abs() < 1e-9);
    }

    #[test]
    fn identical_pictures_are_null_in_json() {
        assert_eq!(psnr(&grey(0.5), &grey(0.5)).unwrap(), Psnr::Identical);
        let json = serde_json::to_string(&mean_psnr(&[Psnr::Identical; 2]).unwrap()).unwrap();
        assert_eq!(json, r#"{"psnr_db":null,"identical":true,"identical_views":2}"#);
    }

    #[test]
    fn the_mean_is_over_views_that_differ() {
        let views = [Psnr::Decibel(30.0), Psnr::Identical, Psnr::Decibel(40.0)];
        let expected = MeanPsnr {
            psnr_db: Some(35.0),
            identical: false,
            identical_views: 1,
        };
        assert_eq!(mean_psnr(&views).unwrap(), expected);
        assert!(mean_psnr(&[]).is_err());
    }

    #[test]
    fn other_sizes_are_refused() {
        let turned = Picture {
            width: 2,
            height: 4,
            pixels: vec![0.5; 24],
        };
        assert!(
            psnr(&grey(0.5), &turned)
                .unwrap_err()
                .to_string()
                .contains("sizes differ")
        );
    }
}
