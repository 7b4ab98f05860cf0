//! What the first bytes of a file tell of a scene, and of the memory that it will take: enough to refuse one that is too
//! large before it is read, or queued.
use crate::container::Format;

/// Numbers of a Gaussian besides its colour: position, rotation, scale, opacity.
const GEOMETRY: u64 = 11;
/// Arrays that the optimiser has, each as large as the coefficients: learned changes, their gradient, two moments.
const LEARNED: u64 = 4;

/// What the head of a scene's file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The format.
    pub format: Format,
    /// Gaussians, rows that may have to be ignored included.
    pub gaussians: u64,
    /// Degree of the spherical harmonics that the file has room for; those in use may be of a lower one.
    pub degree: u64,
    /// Bytes that are in memory of the file once it is read, uncompressed, at least.
    pub file: u64,
}

impl Summary {
    /// Bytes that the scene has in memory at least, once it is read: `file + 4 n (11 + 3)`, with `n` Gaussians of 11
    /// numbers and a colour. Bands of zeros are not in memory, so that the degree says nothing for certain.
    pub fn least_to_read(&self) -> u64 {
        self.scene(0)
    }

    /// Bytes that it will probably have: `file + 4 n (11 + 3 (degree + 1)²)`, all bands being in use.
    pub fn likely_to_read(&self) -> u64 {
        self.scene(self.degree)
    }

    /// Bytes that marking takes at least, whatever the settings: two scenes, `2 (file + 4 n (11 + 3))`, because the
    /// marked file is read back and compared with the first. What is learned is left out: it depends on the Gaussians
    /// that views show. So are models, views and pictures.
    pub fn least_to_mark(&self) -> u64 {
        self.least_to_read().saturating_mul(2)
    }

    /// Bytes that it will probably take, all bands being in use and all Gaussians seen, without models, views and
    /// pictures: the scene and `4 · 4 n · 3 (degree + 1)²` for what is learned, or two scenes, if that is more.
    pub fn likely_to_mark(&self) -> u64 {
        let scene = self.likely_to_read();
        let learned = LEARNED.saturating_mul(self.numbers(coefficients(self.degree)));
        scene.saturating_add(learned.max(scene))
    }

    fn scene(&self, degree: u64) -> u64 {
        self.file.saturating_add(self.numbers(GEOMETRY + coefficients(degree)))
    }

    /// Bytes of so many numbers a Gaussian.
    fn numbers(&self, each: u64) -> u64 {
        self.gaussians.saturating_mul(4 * each)
    }
}

/// Coefficients of a Gaussian, all channels.
fn coefficients(degree: u64) -> u64 {
    3 * (degree + 1) * (degree + 1)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::testing::scene_path;
    use crate::{Error, Scene};
    use crate::{HEAD, summary};
    use std::path::Path;

    /// Holds the summary of a file that was read against its scene. The files that other tests read come by here.
    pub(crate) fn agrees(bytes: &[u8], scene: &Scene) {
        let head = &bytes[..bytes.len().min(HEAD)];
        let said = summary(Path::new("it"), head, bytes.len() as u64).unwrap().unwrap();
        let (gaussians, sh) = (&scene.gaussians, &scene.gaussians.sh);
        assert_eq!(
            (said.format, said.gaussians),
            (scene.format(), gaussians.len() as u64),
            "{said:?}"
        );
        assert!(said.degree >= sh.degree as u64, "{said:?}, used {}", sh.degree);
        let there = scene.file_bytes() as u64;
        match said.format {
            Format::Ply | Format::Splat | Format::Ksplat => assert_eq!(said.file, there),
            // Chunks are kept besides, and what follows the Gaussians.
            _ => assert!(said.file <= there, "{said:?}, there are {there}"),
        }
        let numbers = size_of_val(&gaussians.positions[..])
            + size_of_val(&gaussians.rotations[..])
            + size_of_val(&gaussians.log_scales[..])
            + size_of_val(&gaussians.opacity_logits[..])
            + size_of_val(&sh.coefficients[..]);
        let all = there + numbers as u64;
        assert!(said.least_to_read() <= all, "{said:?}, there are {all}");
        if sh.degree as u64 == said.degree {
            assert_eq!(said.likely_to_read() - said.file, numbers as u64);
        }
    }

    #[test]
    fn real_files_are_told_by_their_heads() {
        for (name, degree, gaussians) in [
            ("pod.ply", 3, 101_407),
            ("pod.spz", 3, 101_407),
            ("biker.spz", 0, 152_746),
            ("biker.compressed.ply", 0, 152_746),
            ("plant.splat", 0, 0),
            ("playbot_8k.ply", 3, 0),
        ] {
            let Some(path) = scene_path(name) else { continue };
            let bytes = std::fs::read(&path).unwrap();
            agrees(&bytes, &Scene::read(&path).unwrap());
            let said = summary(&path, &bytes[..HEAD], bytes.len() as u64).unwrap().unwrap();
            assert_eq!(said.degree, degree, "{name}");
            assert!(gaussians == 0 || said.gaussians == gaussians, "{name}: {said:?}");
        }
    }

    #[test]
    fn memory_is_what_the_formulas_say() {
        let mut said = Summary {
            format: Format::Ply,
            gaussians: 1000,
            degree: 3,
            file: 248_000,
        };
        assert_eq!(said.least_to_read(), 248_000 + 56_000);
        assert_eq!(said.likely_to_read(), 248_000 + 236_000);
        assert_eq!(said.least_to_mark(), 2 * 304_000);
        assert_eq!(said.likely_to_mark(), 484_000 + 4 * 192_000);
        // Of a scene without bands, two take more than what is learned of one.
        said.degree = 0;
        assert_eq!(said.likely_to_mark(), said.least_to_mark());
        said.gaussians = u64::MAX / 2;
        assert_eq!(said.likely_to_mark(), u64::MAX, "sums do not wrap");
    }

    #[test]
    fn what_is_no_scene_is_refused_and_what_may_be_one_is_left() {
        let of = |head: &[u8], size| summary(Path::new("artifacts/7"), head, size);
        let reason = |head: &[u8], size| match of(head, size) {
            Err(Error::BadScene { path, reason }) => {
                assert_eq!(path, Path::new("artifacts/7"));
                reason
            }
            other => panic!("{other:?}"),
        };
        assert_eq!(of(b"PK\x03\x04 and so on", 5 << 30).unwrap(), None);
        assert!(reason(b"scene", 5).contains("not a scene"));
        assert!(reason(b"", 0).contains("it is empty"));
        // A picture as long as whole rows, and text.
        let picture = [
            &b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x01\0\0\0\x01\0\x08\x06"[..],
            &[0xff; 70],
        ]
        .concat();
        assert!(reason(&picture, 32 << 20).contains("row 1"));
        assert!(reason(&b"Dear diary, ".repeat(100), 32 << 20).contains("rotation"));
        assert!(reason(b"ply\nformat ascii 1.0\n", 5000).contains("end_header"));
        assert!(reason(b"NGSP\x04\0\0\0", 5000).contains("truncated"));
        assert!(reason(b"\x1f\x8b\x08\0\0", 5000).contains("truncated"));
    }

    /// No count is believed that the file is too short for.
    #[test]
    fn promises_without_bytes_are_no_scenes() {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let mut head = "ply\nformat binary_little_endian 1.0\nelement vertex 400000000\n".to_string();
        for name in names.split(' ') {
            head += &format!("property float {name}\n");
        }
        head += "end_header\n";
        let body = 400_000_000 * 56;
        let of = |size| summary(Path::new("it"), head.as_bytes(), size);
        assert!(
            of(head.len() as u64 + body - 1)
                .unwrap_err()
                .to_string()
                .contains("truncated")
        );
        let said = of(head.len() as u64 + body).unwrap().unwrap();
        assert_eq!((said.gaussians, said.degree), (400_000_000, 0));
        assert_eq!(said.least_to_read(), head.len() as u64 + 2 * body);
    }
}
