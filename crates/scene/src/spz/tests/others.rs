//! Files that Niantic's library (the build in splat-transform 2.7.1) made of two Gaussians, one for each version.
//!
//! It was told no axes, so that it copies the numbers, and rounded harmonics to 5 bits as it does on its own. The
//! expected values are those that it was given.
use super::*;

const FILES: [&str; 3] = [
    "1f8b0800000000000003f3730f0e606260600061461e4606060906863bff41dc033f193818180a18d6f24c8e5cdf709f37a2610983ce84ded4\
     e58245db17384c68789050718061c60a8f131a2f7e14340000defef43d48000000",
    "1f8b0800000000000003f3730f0e60666060600262461e4606060906863bff41dc033f193818180a18d6f24c8e5cdf709f37a2610983ce847b\
     01ab8ecc7df5866581c38486070915071866acf038a1f1e2474103007d957aa44a000000",
    "4e4753500400000002000000010c0106200000000000000000000000000000001b0000000000000012000000000000000b0000000000000002\
     000000000000000f0000000000000006000000000000000f000000000000000600000000000000110000000000000008000000000000001b00\
     000000000000120000000000000028b52ffd201291000000180000dcff00020000c0f900080000700028b52ffd2002110000ad0c28b52ffd20\
     063100009359af80df0d28b52ffd20063100005880a4002c9028b52ffd2008410000de50aac49deaec0428b52ffd2012910000a0409080e060\
     78c00098a848c828e8f87080",
];
const POSITIONS: [[f32; 3]; 2] = [[1.5, -2.25, 0.125], [-100.0, 0.5, 7.0]];
const LOG_SCALES: [[f32; 3]; 2] = [[-4.5, -2.0, 0.25], [-10.0, -7.25, -1.0]];
/// w, x, y, z, not normalised.
const ROTATIONS: [[f32; 4]; 2] = [[0.9, 0.1, -0.2, 0.3], [-0.2, 0.8, 0.1, -0.4]];
const LOGITS: [f32; 2] = [0.75, -3.0];
const COLOUR: [[f32; 12]; 2] = [
    [0.5, -1.0, 1.25, 0.25, -0.5, 0.125, 0.0, 0.75, -0.25, -0.0625, 0.5, -1.0],
    [
        0.0, 2.5, -3.0, 0.1875, 0.3125, -0.4375, 0.5625, -0.6875, 0.8125, 0.9375, -0.125, 0.0,
    ],
];

fn bytes(hex: &str) -> Vec<u8> {
    let pairs = hex.as_bytes().chunks_exact(2);
    pairs
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

#[test]
fn niantics_library_is_understood() {
    for (version, hex) in VERSIONS.into_iter().zip(FILES) {
        let scene = read(&bytes(hex)).unwrap();
        let g = &scene.gaussians;
        assert_eq!((g.len(), g.sh.degree), (2, 1));
        assert_eq!(
            (g.positions.as_slice(), g.log_scales.as_slice()),
            (&POSITIONS[..], &LOG_SCALES[..])
        );
        for row in 0..2 {
            // One step of the opacity's byte is 1/255.
            let expected = 1.0 / (1.0 + (-LOGITS[row]).exp());
            assert!((g.opacity(row) - expected).abs() <= 0.5 / 255.0 + 1e-6);
            let (q, expected) = (unit(g.rotations[row]), unit(ROTATIONS[row]));
            let dot: f32 = (0..4).map(|i| q[i] * expected[i]).sum();
            let least = if version == 2 { 0.9995 } else { 0.999_99 };
            assert!(dot.abs() > least, "version {version}: {q:?} is not {expected:?}");
            for (i, value) in g.sh.coefficients[12 * row..12 * row + 12].iter().enumerate() {
                let error = (value - COLOUR[row][i]).abs();
                let step = if i < 3 { 1.0 / 38.25 } else { 1.0 / 128.0 };
                assert!(error <= 0.5 * step + 1e-6, "version {version}, row {row}, {i}: {value}");
            }
        }
        assert_eq!(plain(&written(&scene, &g.sh)), plain(&bytes(hex)));
    }
}

fn unit(q: [f32; 4]) -> [f32; 4] {
    let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
    q.map(|v| v / length)
}
