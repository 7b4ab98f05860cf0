//! Small 3DGS scene files, made by hand so that one thing at a time can be wrong with them; and a reader of what other
//! programs write, which shares nothing with the engine's.

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

    /// Reads a binary file of one element, whose properties are all floats.
    ///
    /// # Panics
    /// When it is something else.
    pub fn parse(bytes: &[u8]) -> Self {
        let end = b"end_header\n";
        let at = bytes.windows(end.len()).position(|part| part == end);
        let (header, body) = bytes.split_at(at.expect("a header with an end") + end.len());
        let header = std::str::from_utf8(header).expect("a header of text");
        let (mut promised, mut properties) = (String::new(), Vec::new());
        for line in header.lines() {
            match line.split(' ').collect::<Vec<_>>()[..] {
                ["format", kind, _] => assert_eq!(kind, "binary_little_endian"),
                ["element", "vertex", count] => promised = count.to_owned(),
                ["property", "float", name] => properties.push(name.to_owned()),
                ["ply" | "end_header"] | ["comment", ..] => {}
                _ => panic!("{line}"),
            }
        }
        let values = body.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let values: Vec<f32> = values.collect();
        let rows: Vec<Vec<f32>> = values.chunks(properties.len()).map(<[f32]>::to_vec).collect();
        assert_eq!(
            (rows.len().to_string(), body.len()),
            (promised.clone(), 4 * values.len())
        );
        Self {
            promised,
            properties,
            rows,
        }
    }

    /// Where a property is in every row, if it is there.
    pub fn find(&self, property: &str) -> Option<usize> {
        self.properties.iter().position(|p| p == property)
    }

    /// Where these properties are in every row.
    ///
    /// # Panics
    /// When one is missing.
    pub fn columns<const N: usize>(&self, properties: [&str; N]) -> [usize; N] {
        properties.map(|name| {
            self.find(name)
                .unwrap_or_else(|| panic!("no {name} in {:?}", self.properties))
        })
    }

    /// Gives a row's property another value.
    ///
    /// # Panics
    /// When there is no such property or row.
    pub fn set(mut self, row: usize, property: &str, value: f32) -> Self {
        let column = self.find(property);
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
