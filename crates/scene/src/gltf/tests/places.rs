//! What splats are in the world: places, sizes, turns and what they look like from anywhere, under the nodes of the asset.
use super::*;

type Matrix = [[f64; 3]; 3];

/// The root turns by a quarter about z and doubles.
const ROOT: Matrix = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
/// Columns of the second node's matrix, and its shift.
const SECOND_NODE: Matrix = [[0.36, -0.8, 0.48], [0.48, 0.6, 0.64], [-0.8, 0.0, 0.6]];
const SHIFT: [f64; 3] = [1.0, 2.0, 3.0];

fn times(a: &Matrix, v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|j| a[i][j] * v[j]).sum())
}

/// The covariance of a Gaussian.
fn covariance(rotation: [f32; 4], log_scales: [f32; 3]) -> Matrix {
    let turn = crate::gltf::placement::matrix(rotation.map(f64::from));
    let squares = log_scales.map(|log| (2.0 * f64::from(log)).exp());
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| turn[i][k] * squares[k] * turn[j][k]).sum()))
}

/// Where a row of the scene should be: the space of its node, its turn and its shift there.
fn node(row: usize) -> (usize, usize, Matrix, [f64; 3]) {
    match row.checked_sub(ROWS[0]) {
        None => (0, row, ROOT, [0.0; 3]),
        Some(row) => {
            let turn = [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| ROOT[i][k] * SECOND_NODE[k][j]).sum()));
            (1, row, turn, times(&ROOT, SHIFT).map(|v| 2.0 * v))
        }
    }
}

#[test]
fn splats_are_where_their_nodes_put_them() {
    let own = splats();
    let scene = read(&asset()).unwrap().gaussians;
    assert_eq!((scene.len(), scene.sh.degree), (8, 3));
    for row in 0..scene.len() {
        let (part, i, turn, shift) = node(row);
        let place = times(&turn, own[part].positions[i].map(f64::from));
        for axis in 0..3 {
            let expected = 2.0 * place[axis] + shift[axis];
            let found = f64::from(scene.positions[row][axis]);
            assert!(
                (found - expected).abs() < 1e-5 * expected.abs().max(1.0),
                "{row}: {found}, not {expected}"
            );
        }
        let there = covariance(scene.rotations[row], scene.log_scales[row]);
        let here = covariance(own[part].rotations[i], own[part].log_scales[i]);
        // Rotations of the second part have 8 bits, scales 16.
        let slack = if part == 0 { 1e-5 } else { 0.08 };
        let size = (0..3).map(|k| here[k][k]).fold(0.0, f64::max).max(1e-8);
        for a in 0..3 {
            for b in 0..3 {
                let expected: f64 = (0..9)
                    .map(|k| turn[a][k / 3] * here[k / 3][k % 3] * turn[b][k % 3])
                    .sum();
                assert!((there[a][b] / 4.0 - expected).abs() < slack * size, "{row}");
            }
        }
        let logit = own[part].opacity_logits[i];
        assert!((scene.opacity(row) - opacity(logit)).abs() < if part == 0 { 1e-6 } else { 1.0 / 254.0 });
    }
}

/// Of degree 1, whose harmonics are a vector: it turns as positions do.
#[test]
fn harmonics_turn_with_their_nodes() {
    let own = splats();
    let scene = read(&asset()).unwrap().gaussians;
    for row in 0..scene.len() {
        let (part, i, turn, _) = node(row);
        let each = own[part].sh.per_gaussian();
        let here = &own[part].sh.coefficients[i * each..];
        let there = &scene.sh.coefficients[row * 48..(row + 1) * 48];
        assert_eq!(here[..3], there[..3], "the constant term has no direction");
        for channel in 0..3 {
            // -y, z, -x.
            let vector = |c: &[f32]| [-c[9 + channel], -c[3 + channel], c[6 + channel]].map(f64::from);
            let (expected, found) = (times(&turn, vector(here)), vector(there));
            assert!((0..3).all(|k| (expected[k] - found[k]).abs() < 1e-6), "{row}");
        }
        if part == 0 {
            assert_eq!(there[12..], [0.0; 36], "there is no more than degree 1");
        }
    }
}

#[test]
fn a_file_without_scenes_is_shown_from_its_roots() {
    let text = json(None);
    let scenes = text.find("\"scenes\"").unwrap();
    let asset_at = text.find("\"asset\"").unwrap();
    let without = format!("{}{}", &text[..scenes], &text[asset_at..]);
    let same = read(&glb(&without, &buffer())).unwrap().gaussians;
    assert_eq!(same, read(&asset()).unwrap().gaussians);
}

#[test]
fn nodes_that_do_nothing_leave_every_bit() {
    let own = splats()[0].clone();
    let text = json(None).replace(
        "[0,0,0.7071067811865476,0.7071067811865476],\"scale\":[2,2,2]",
        "[0,0,0,1]",
    );
    let scene = read(&glb(&text, &buffer())).unwrap().gaussians;
    assert_eq!(scene.positions[..5], own.positions);
    assert_eq!(scene.rotations[..5], own.rotations);
    assert_eq!(scene.sh.coefficients[..12], own.sh.coefficients[..12]);
}
