//! PLY files made by hand, of every encoding, so that one thing at a time can be wrong with them.

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    Ascii,
    Little,
    Big,
}
pub const ENCODINGS: [Encoding; 3] = [Encoding::Ascii, Encoding::Little, Encoding::Big];
/// Numbers of `f_rest_*` properties by degree.
pub const RESTS: [usize; 5] = [0, 9, 24, 45, 72];

/// A PLY under construction.
#[derive(Clone)]
pub struct File {
    pub encoding: Encoding,
    pub newline: &'static str,
    /// Lines of the header before element vertex.
    pub before: &'static str,
    /// What the header says the number of rows is.
    pub promised: String,
    pub names: Vec<String>,
    pub rows: Vec<Vec<f32>>,
}

impl File {
    /// Gaussians of different places and colours with `rest` coefficients `f_rest_*` each.
    pub fn new(encoding: Encoding, rows: usize, rest: usize) -> File {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let mut names: Vec<String> = names.split(' ').map(str::to_owned).collect();
        names.extend((0..rest).map(|i| format!("f_rest_{i}")));
        let row = |row: usize| {
            let at = row as f32;
            let fixed = [
                at - 1.0,
                0.25 * at,
                1.5,
                0.5,
                -0.25,
                1.0,
                2.0,
                -1.5,
                -2.5,
                -2.0,
                1.0,
                0.0,
                0.5,
                0.0,
            ];
            let rest = (0..rest).map(|i| 0.125 * (i + row + 1) as f32);
            fixed.into_iter().chain(rest).collect()
        };
        File {
            encoding,
            newline: "\n",
            before: "",
            promised: rows.to_string(),
            names,
            rows: (0..rows).map(row).collect(),
        }
    }

    /// Gives a value of a row another one.
    pub fn set(&mut self, row: usize, name: &str, value: f32) {
        let column = self.names.iter().position(|other| other == name).unwrap();
        self.rows[row][column] = value;
    }

    /// The header.
    pub fn header(&self) -> String {
        let format = match self.encoding {
            Encoding::Ascii => "ascii",
            Encoding::Little => "binary_little_endian",
            Encoding::Big => "binary_big_endian",
        };
        let properties: String = self
            .names
            .iter()
            .map(|name| format!("property float {name}\n"))
            .collect();
        let (before, promised) = (self.before, &self.promised);
        format!("ply\nformat {format} 1.0\n{before}element vertex {promised}\n{properties}end_header\n")
            .replace('\n', self.newline)
    }

    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.header().into_bytes();
        for row in &self.rows {
            match self.encoding {
                Encoding::Ascii => {
                    let words: Vec<String> = row.iter().map(|value| format!("{value:?}")).collect();
                    bytes.extend((words.join(" ") + self.newline).bytes());
                }
                Encoding::Little => bytes.extend(row.iter().flat_map(|value| value.to_le_bytes())),
                Encoding::Big => bytes.extend(row.iter().flat_map(|value| value.to_be_bytes())),
            }
        }
        bytes
    }
}
