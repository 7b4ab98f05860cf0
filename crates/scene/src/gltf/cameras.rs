//! The cameras of a glTF, where its nodes put them.
use super::document::{Document, Perspective};
use super::envelope;
use super::placement::for_each_shown;

/// A perspective camera in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfCamera {
    /// Right, up and backward, each of length 1.
    pub axes: [[f64; 3]; 3],
    /// Where it is.
    pub position: [f64; 3],
    /// Radians from the lower to the upper edge of its picture.
    pub field_of_view: f64,
    /// Width over height; `None` for that of whatever shows it.
    pub aspect_ratio: Option<f64>,
}

/// Whether bytes may be a binary glTF.
pub fn is_binary_gltf(file: &[u8]) -> bool {
    file.starts_with(&envelope::MAGIC)
}

/// The perspective cameras that the scene of a glTF shows, in the order of its nodes. Orthographic ones are left out, scales
/// of nodes do nothing to a camera, and animations are not played. Of a binary file what comes after the JSON need not be
/// there.
///
/// # Errors
/// Why it can't be read: no glTF 2.0, over 16 MiB of JSON, nodes that are not there or twice, a camera that is not there, has no
/// size, or sees nothing.
pub fn gltf_cameras(file: &[u8]) -> Result<Vec<GltfCamera>, String> {
    let document = Document::parse(envelope::json(file)?)?;
    let mut cameras = Vec::new();
    for_each_shown(&document, |_, node, here| {
        let Some(index) = node.camera else { return Ok(()) };
        let count = document.cameras.len();
        let camera = document.cameras.get(index);
        let camera = camera.ok_or_else(|| format!("camera {index} of {count}"))?;
        let Some(perspective) = camera.perspective else {
            return Ok(());
        };
        let seen = seen(perspective).map_err(|reason| format!("camera {index}: {reason}"))?;
        let column = |j: usize| [here[0][j], here[1][j], here[2][j]];
        let mut axes = [0, 1, 2].map(column);
        for axis in &mut axes {
            let length = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
            if !(length.is_finite() && length > 0.0) {
                return Err(format!(
                    "camera {index}: a scale of {length}; must be finite and more than 0"
                ));
            }
            *axis = axis.map(|v| v / length);
        }
        cameras.push(GltfCamera {
            axes,
            position: column(3),
            field_of_view: seen.yfov,
            aspect_ratio: seen.aspect_ratio,
        });
        Ok(())
    })?;
    Ok(cameras)
}

/// A field of view that shows something.
fn seen(perspective: Perspective) -> Result<Perspective, String> {
    let Perspective { yfov, aspect_ratio } = perspective;
    if !(yfov > 0.0 && yfov < std::f64::consts::PI) {
        return Err(format!("yfov is {yfov}, must be more than 0 and less than pi"));
    }
    match aspect_ratio {
        Some(ratio) if !(ratio.is_finite() && ratio > 0.0) => {
            Err(format!("aspectRatio is {ratio}, must be finite and more than 0"))
        }
        _ => Ok(perspective),
    }
}
