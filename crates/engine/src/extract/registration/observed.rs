//! The picture at a size at which cameras are fitted to it.
use crate::error::Result;
use crate::extract::photometric::ground;
use crate::picture::Picture;
use crate::resize::resized;
use crate::view::Camera;

/// A picture, made small.
pub(super) struct Observed {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[f32; 3]>,
    /// The colour all around the scene, where there is one.
    pub ground: Option<[f32; 3]>,
    /// How many times as large the picture is.
    pub times: f32,
}

impl Observed {
    /// The picture with its longer side made `side` pixels, or as it is if it is smaller.
    ///
    /// # Errors
    /// A picture without pixels.
    pub fn of(picture: &Picture, side: u32) -> Result<Self> {
        let longer = picture.width.max(picture.height).max(1);
        let scale = (side as f32 / longer as f32).min(1.0);
        let made = |side: u32| ((side as f32 * scale).round() as usize).max(1);
        let (width, height) = (made(picture.width), made(picture.height));
        Ok(Self {
            width,
            height,
            pixels: resized(picture, height, width)?.pixels.as_chunks::<3>().0.to_vec(),
            ground: ground::seen(picture),
            times: 1.0 / scale,
        })
    }

    /// A camera of this picture at another size, as one of this size.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let x = self.width as f32 / camera.width as f32;
        let y = self.height as f32 / camera.height as f32;
        Camera {
            width: self.width as u32,
            height: self.height as u32,
            fx: camera.fx * x,
            fy: camera.fy * y,
            cx: camera.cx * x,
            cy: camera.cy * y,
            ..camera.clone()
        }
    }

    /// The colour of a pixel of which the scene covers this share, without what is behind it, times that share.
    pub fn without_ground(&self, pixel: usize, coverage: f32) -> [f32; 3] {
        let seen = self.pixels[pixel];
        match self.ground {
            Some(ground) => std::array::from_fn(|k| seen[k] - (1.0 - coverage) * ground[k]),
            None => seen.map(|v| coverage * v),
        }
    }
}
