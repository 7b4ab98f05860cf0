//! Small 3DGS scene files, made by hand so that one thing at a time can be wrong with them.

/// A binary scene file in the layout of the reference implementation.
#[derive(Clone, Debug)]
pub struct Ply {
    /// What the header says the number of Gaussians is.
    pub promised: String,
    /// Properties of a row.
    pub properties: Vec<String>,
    /// The rows, as many numbers each as there are properties.
    pub rows: Vec<Vec<f32>>,
}

impl Ply {
    /// `count` opaque Gaussians on a circle, with `rest` coefficients `f_rest_*` each.
    pub fn new(count: usize, rest: usize) -> Self {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let mut properties: Vec<String> = names.split(' ').map(str::to_owned).collect();
        properties.extend((0..rest).map(|i| format!("f_rest_{i}")));
        let row = |i: usize| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / count as f32).sin_cos();
            let fixed = [cos, 0.0, sin, 0.5, -0.5, 0.1, 3.0, -2.0, -2.0, -2.0, 1.0, 0.0, 0.0, 0.0];
            fixed.into_iter().chain(std::iter::repeat_n(0.0, rest)).collect()
        };
        Self {
            promised: count.to_string(),
            properties,
            rows: (0..count).map(row).collect(),
        }
    }

    /// Gives a row's property another value.
    ///
    /// # Panics
    /// When there is no such property or row.
    pub fn set(mut self, row: usize, property: &str, value: f32) -> Self {
        let column = self.properties.iter().position(|p| p == property);
        self.rows[row][column.expect("a property of the scene")] = value;
        self
    }

    /// Makes the header promise another number of Gaussians.
    pub fn promise(mut self, count: &str) -> Self {
        self.promised = count.into();
        self
    }

    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
            self.promised
        );
        for property in &self.properties {
            header += &format!("property float {property}\n");
        }
        let mut bytes = (header + "end_header\n").into_bytes();
        bytes.extend(self.rows.iter().flatten().flat_map(|value| value.to_le_bytes()));
        bytes
    }
}
