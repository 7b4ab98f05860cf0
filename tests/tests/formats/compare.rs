//! Compares scenes as different programs read them.
use guardsplat_scene::{Format, Gaussians, Scene};
use guardsplat_tests::TestEnvironment;
use guardsplat_tests::ply::Ply;

/// Numbers that two programs compute from the same bytes differ by rounding.
const ROUNDING: f32 = 1e-5;
/// How far opacities may differ: programs bound the logits of 0 and 1 in ways of their own.
const OPACITY: f32 = 1e-4;

/// How far rotations of a `.splat` may differ: of the byte for 0 some programs say that it is 127.5, others that it is
/// 128.
const SPLAT_ROTATION: f32 = 5e-5;
/// A band of a compressed PLY that has nothing but this and its opposite says nothing: they are next to 0, which it does
/// not have.
const COMPRESSED_ZERO: f32 = 1.0 / 64.0;

/// Gaussians whose colours differ.
pub fn changed(before: &Gaussians, after: &Gaussians) -> usize {
    assert_eq!((before.len(), before.sh.degree), (after.len(), after.sh.degree));
    let rows = |g: &Gaussians| {
        g.sh.coefficients
            .chunks(g.sh.per_gaussian())
            .map(<[f32]>::to_vec)
            .collect::<Vec<_>>()
    };
    rows(before).iter().zip(rows(after)).filter(|(a, b)| *a != b).count()
}

/// Rows of a marked scene whose colours are not those of the original, both read by the same program; all else must be
/// the same to the bit.
#[track_caller]
pub fn marked_rows(original: &Ply, marked: &Ply) -> usize {
    assert_eq!(original.properties, marked.properties);
    assert_eq!(original.rows.len(), marked.rows.len());
    let is_colour = |name: &String| name.starts_with("f_dc_") || name.starts_with("f_rest_");
    let colour: Vec<bool> = original.properties.iter().map(is_colour).collect();
    let mut count = 0;
    for (row, (a, b)) in original.rows.iter().zip(&marked.rows).enumerate() {
        let differ =
            |of_colour: bool| (0..colour.len()).find(|i| colour[*i] == of_colour && a[*i].to_bits() != b[*i].to_bits());
        if let Some(i) = differ(false) {
            panic!("row {row}, {}: {} became {}", original.properties[i], a[i], b[i]);
        }
        count += usize::from(differ(true).is_some());
    }
    count
}

/// Checks that a program found in a file what we found. Where it turned the scene by half a turn about x, y and z have
/// other signs.
#[track_caller]
pub fn agrees(scene: &Scene, theirs: &Ply, turned: bool) {
    let ours = &scene.gaussians;
    let (rotations, zero) = match scene.format() {
        Format::Splat => (SPLAT_ROTATION, 0.0),
        Format::CompressedPly => (ROUNDING, COMPRESSED_ZERO),
        _ => (ROUNDING, 0.0),
    };
    assert_eq!(ours.len(), theirs.rows.len());
    let position = theirs.columns(["x", "y", "z"]);
    let scale = theirs.columns(["scale_0", "scale_1", "scale_2"]);
    let rotation = theirs.columns(["rot_0", "rot_1", "rot_2", "rot_3"]);
    let [opacity] = theirs.columns(["opacity"]);
    let colours = Colours::of(theirs, turned);
    let flip = if turned { -1.0 } else { 1.0 };
    for (row, values) in theirs.rows.iter().enumerate() {
        let told = |what: &str, a: f32, b: f32| panic!("row {row}, {what}: we read {a}, the other {b}");
        let [x, y, z] = ours.positions[row];
        for (a, i) in [x, flip * y, flip * z].into_iter().zip(position) {
            if apart(a, values[i], ROUNDING * a.abs().max(1.0)) {
                told("position", a, values[i]);
            }
        }
        for (a, i) in ours.log_scales[row].into_iter().zip(scale) {
            if apart(a, values[i], ROUNDING * a.abs().max(1.0)) {
                told("scale", a, values[i]);
            }
        }
        let [w, x, y, z] = ours.rotations[row];
        // About axes of the Gaussian's own, half a turn more or less shows nothing.
        let a = [w, x, flip * y, flip * z];
        let same = cosine(a, rotation.map(|i| values[i]));
        if apart(1.0, same.abs(), rotations) {
            told("cosine of rotations", 1.0, same);
        }
        let (a, b) = (ours.opacity(row), 1.0 / (1.0 + (-values[opacity]).exp()));
        if apart(a, b, OPACITY) {
            told("opacity", a, b);
        }
        let per_gaussian = ours.sh.per_gaussian();
        let own = &ours.sh.coefficients[row * per_gaussian..][..per_gaussian];
        for i in 0..own.len().max(colours.columns.len()) {
            // Bands that one of them left out are zero.
            let (a, tolerance) = own.get(i).map_or((0.0, zero.max(ROUNDING)), |a| (*a, ROUNDING));
            let b = colours.value(values, i);
            if apart(a, b, tolerance) {
                told(&format!("coefficient {i}"), a, b);
            }
        }
    }
}

/// NaN is apart from everything, an infinity from all but itself.
fn apart(a: f32, b: f32, tolerance: f32) -> bool {
    let distance = (a - b).abs();
    a != b && (distance.is_nan() || distance > tolerance)
}

fn cosine(a: [f32; 4], b: [f32; 4]) -> f32 {
    let dot = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

/// Where the coefficients of a Gaussian are, in our order: all channels of one after the other.
struct Colours {
    /// Columns, and signs.
    columns: Vec<(usize, f32)>,
}

impl Colours {
    fn of(ply: &Ply, turned: bool) -> Self {
        let rest = ply.properties.iter().filter(|name| name.starts_with("f_rest_")).count();
        let bands = rest / 3;
        let mut columns = Vec::new();
        for i in 0..=bands {
            for channel in 0..3 {
                let name = match i {
                    0 => format!("f_dc_{channel}"),
                    _ => format!("f_rest_{}", channel * bands + i - 1),
                };
                let column = ply.find(&name).unwrap_or_else(|| panic!("no {name}"));
                columns.push((column, if turned { sign(i) } else { 1.0 }));
            }
        }
        Self { columns }
    }

    fn value(&self, row: &[f32], i: usize) -> f32 {
        self.columns.get(i).map_or(0.0, |(column, sign)| sign * row[*column])
    }
}

/// What half a turn about x makes of a spherical harmonic: those that are odd in y and z together change their sign.
fn sign(harmonic: usize) -> f32 {
    let degree = harmonic.isqrt();
    // From -degree to degree: those below 0 are odd in y, and with z even or odd so that the whole has its degree.
    let order = harmonic as i32 - (degree * degree + degree) as i32;
    let odd_in_y = order < 0;
    let odd_in_z = (degree as i32 - order.abs()) % 2 == 1;
    if odd_in_y == odd_in_z { 1.0 } else { -1.0 }
}

/// Checks that the pictures of two folders are the same but for one step of 8 bits.
#[track_caller]
pub fn pictures_agree(environment: &TestEnvironment, a: &str, b: &str, views: usize) {
    for view in 0..views {
        let [a, b] = [a, b].map(|folder| {
            let bytes = environment.read(&format!("{folder}/view_{view:03}.png"));
            image::load_from_memory(&bytes).unwrap().to_rgb8().into_raw()
        });
        let differences: Vec<u8> = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).collect();
        let worst = differences.iter().max().unwrap();
        let count = differences.iter().filter(|d| **d > 0).count();
        println!("view {view}: worst {worst}, {count} of {} differ", differences.len());
        assert!(a.len() == b.len() && *worst <= 1, "view {view}: {worst}");
        assert!(a.iter().any(|v| *v != 255), "view {view} shows nothing");
    }
}
