//! Where nodes put splats: from a node's space to the world, by a turn, a scale alike along all axes, and a shift.
use super::document::{Document, Node};
use super::harmonics::{Matrix, Turn};
use crate::fields::quote;

/// How much the scales along axes may differ, and axes lean, for rounded numbers in a file: a share of 1.
const ROUNDING: f64 = 1e-4;

/// A transformation as nodes have it: the upper three rows of its matrix.
pub(super) type Affine = [[f64; 4]; 3];

const NOWHERE: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Where a node is in the world.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    scale: f64,
    /// w, x, y, z, of length 1; `None` without a turn.
    rotation: Option<[f64; 4]>,
    matrix: Matrix,
    shift: [f64; 3],
}

impl Placement {
    /// Takes a transformation apart; `Err` is what no Gaussian can follow.
    fn new(all: &Affine) -> Result<Placement, String> {
        let column = |j: usize| [all[0][j], all[1][j], all[2][j]];
        let length = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let lengths = [0, 1, 2].map(|j| length(column(j)));
        let shift = column(3);
        // As people write them.
        let shown = lengths.map(|v| v as f32);
        if !lengths.iter().all(|v| v.is_finite() && *v > 0.0) || !shift.iter().all(|v| v.is_finite()) {
            return Err(format!(
                "scale {shown:?}, translation {shift:?}; must be finite, and scales more than 0"
            ));
        }
        let scale = (lengths[0] * lengths[1] * lengths[2]).cbrt();
        if lengths.iter().any(|v| (v / scale - 1.0).abs() > ROUNDING) {
            return Err(format!(
                "scale {shown:?}: Gaussians are scaled alike along all axes only"
            ));
        }
        let axes = [0, 1, 2].map(|j| column(j).map(|v| v / lengths[j]));
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let [x, y, z] = axes;
        if [dot(x, y), dot(y, z), dot(z, x)].iter().any(|v| v.abs() > ROUNDING) {
            return Err("a matrix that shears: its axes are not at right angles".into());
        }
        let cross = [
            x[1] * y[2] - x[2] * y[1],
            x[2] * y[0] - x[0] * y[2],
            x[0] * y[1] - x[1] * y[0],
        ];
        if dot(cross, z) < 0.0 {
            return Err("a scale that mirrors: its determinant is negative".into());
        }
        let quaternion = quaternion([x, y, z]);
        let rotation = Some(quaternion).filter(|q| *q != [1.0, 0.0, 0.0, 0.0]);
        Ok(Placement {
            scale,
            matrix: rotation.map_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], matrix),
            rotation,
            shift,
        })
    }

    /// By a turn w, x, y, z of any length but 0, then a scale of more than 0, then a shift; `None` for others.
    pub(crate) fn of(rotation: [f32; 4], scale: f32, shift: [f32; 3]) -> Option<Placement> {
        let [w, x, y, z] = rotation.map(f64::from);
        let length = (w * w + x * x + y * y + z * z).sqrt();
        let finite = length.is_finite() && scale.is_finite() && shift.iter().all(|v| v.is_finite());
        let unit = [w, x, y, z].map(|v| v / length);
        (finite && length > 0.0 && scale > 0.0).then(|| Placement {
            scale: scale.into(),
            matrix: matrix(unit),
            rotation: Some(unit).filter(|q| *q != [1.0, 0.0, 0.0, 0.0]),
            shift: shift.map(f64::from),
        })
    }

    /// How spherical harmonics are turned, if they are.
    pub fn turn(&self) -> Option<Turn> {
        self.rotation.map(|_| Turn::new(&self.matrix))
    }

    pub fn position(&self, p: [f32; 3]) -> [f32; 3] {
        if self.rotation.is_none() && self.scale == 1.0 && self.shift == [0.0; 3] {
            return p;
        }
        let p = p.map(f64::from);
        std::array::from_fn(|i| {
            let turned: f64 = (0..3).map(|j| self.matrix[i][j] * p[j]).sum();
            (self.scale * turned + self.shift[i]) as f32
        })
    }

    /// A quaternion w, x, y, z after another.
    pub fn rotation(&self, q: [f32; 4]) -> [f32; 4] {
        let Some([w, x, y, z]) = self.rotation else {
            return q;
        };
        let [a, b, c, d] = q.map(f64::from);
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
        .map(|v| v as f32)
    }

    pub fn log_scale(&self, log: f64) -> f32 {
        (log + self.scale.ln()) as f32
    }
}

/// Hands every node that the scene shows to `each`, with where it is, parents before their children; `Err` names a node that
/// is not there or twice, or is a reason of `each`.
pub(super) fn for_each_shown<'d>(
    document: &'d Document<'_>,
    mut each: impl FnMut(usize, &'d Node, &Affine) -> Result<(), String>,
) -> Result<(), String> {
    let nodes = &document.nodes;
    let mut visited = vec![false; nodes.len()];
    let mut open: Vec<(usize, Affine)> = roots(document)?.into_iter().rev().map(|root| (root, NOWHERE)).collect();
    while let Some((index, parent)) = open.pop() {
        let node = nodes
            .get(index)
            .ok_or_else(|| format!("node {index} of {}", nodes.len()))?;
        if std::mem::replace(&mut visited[index], true) {
            return Err(format!("node {index} is in the scene twice"));
        }
        let here = product(&parent, &transformation(node));
        open.extend(node.children.iter().rev().map(|child| (*child as usize, here)));
        each(index, node, &here).map_err(|reason| match &node.name {
            Some(name) => format!("node {index} ({:?}): {reason}", quote(name)),
            None => format!("node {index}: {reason}"),
        })?;
    }
    Ok(())
}

/// Where each mesh with splats is, `None` for those that the scene shows nowhere; `Err` names the node, and what can't
/// be.
pub(super) fn placements(document: &Document<'_>) -> Result<Vec<Option<Placement>>, String> {
    let mut placements: Vec<Option<Placement>> = vec![None; document.meshes.len()];
    let mut places: Vec<usize> = vec![usize::MAX; document.meshes.len()];
    for_each_shown(document, |index, node, here| {
        let Some(mesh) = node.mesh else { return Ok(()) };
        match document.meshes.get(mesh) {
            None => return Err(format!("mesh {mesh} of {}", document.meshes.len())),
            Some(found) if found.splats.is_empty() => return Ok(()),
            Some(_) => (),
        }
        if node.skin.is_some() {
            return Err("skin: splats that bend are not read".into());
        }
        if node.extensions.instancing.is_some() {
            return Err("EXT_mesh_gpu_instancing: splats at several places at once are not read".into());
        }
        if placements[mesh].is_some() {
            let first = places[mesh];
            return Err(format!(
                "mesh {mesh} of splats is at node {first} too; splats at several places at once are not read"
            ));
        }
        placements[mesh] = Some(Placement::new(here)?);
        places[mesh] = index;
        Ok(())
    })?;
    Ok(placements)
}

/// The nodes that the scene begins with; where a file has no scenes, those that are nobody's children.
fn roots(document: &Document<'_>) -> Result<Vec<usize>, String> {
    let scene = document.scene.unwrap_or(0);
    match document.scenes.get(scene) {
        Some(scene) => Ok(scene.nodes.iter().map(|node| *node as usize).collect()),
        None if document.scenes.is_empty() => {
            let mut root = vec![true; document.nodes.len()];
            for child in document.nodes.iter().flat_map(|node| &node.children) {
                if let Some(root) = root.get_mut(*child as usize) {
                    *root = false;
                }
            }
            Ok((0..root.len()).filter(|node| root[*node]).collect())
        }
        None => Err(format!("scene {scene} of {}", document.scenes.len())),
    }
}

fn transformation(node: &Node) -> Affine {
    if let Some(matrix) = &node.matrix {
        return std::array::from_fn(|i| std::array::from_fn(|j| matrix[4 * j + i]));
    }
    let scale = node.scale.as_deref().copied().unwrap_or([1.0; 3]);
    let shift = node.translation.as_deref().copied().unwrap_or_default();
    let [x, y, z, w] = node.rotation.as_deref().copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let turn = matrix([w, x, y, z]);
    std::array::from_fn(|i| std::array::from_fn(|j| if j == 3 { shift[i] } else { turn[i][j] * scale[j] }))
}

fn product(a: &Affine, b: &Affine) -> Affine {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let sum: f64 = (0..3).map(|k| a[i][k] * b[k][j]).sum();
            if j == 3 { sum + a[i][3] } else { sum }
        })
    })
}

/// The matrix of a quaternion w, x, y, z of length 1.
pub(crate) fn matrix([w, x, y, z]: [f64; 4]) -> Matrix {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// The quaternion w, x, y, z, of length 1, that turns the axes to these, from the largest of its components.
fn quaternion([a, b, c]: [[f64; 3]; 3]) -> [f64; 4] {
    let four = [
        1.0 + a[0] + b[1] + c[2],
        1.0 + a[0] - b[1] - c[2],
        1.0 - a[0] + b[1] - c[2],
        1.0 - a[0] - b[1] + c[2],
    ];
    let largest = (0..4).fold(0, |most, i| if four[i] > four[most] { i } else { most });
    let (wx, wy, wz) = (b[2] - c[1], c[0] - a[2], a[1] - b[0]);
    let (xy, yz, zx) = (a[1] + b[0], b[2] + c[1], c[0] + a[2]);
    let q = match largest {
        0 => [four[0], wx, wy, wz],
        1 => [wx, four[1], xy, zx],
        2 => [wy, xy, four[2], yz],
        _ => [wz, zx, yz, four[3]],
    };
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / length)
}
