//! Writes checkpoints.
use super::KERNELS;

/// A checkpoint that is written opcode by opcode.
pub struct Pickle(pub Vec<u8>);

impl Pickle {
    pub fn new() -> Self {
        Self(b"\x80\x03".to_vec())
    }

    pub fn put(&mut self, code: &[u8]) -> &mut Self {
        self.0.extend_from_slice(code);
        self
    }

    pub fn text(&mut self, text: &str) -> &mut Self {
        self.put(b"X")
            .put(&(text.len() as u32).to_le_bytes())
            .put(text.as_bytes())
    }

    pub fn array(&mut self, shape: &[usize], numbers: &[u8]) -> &mut Self {
        self.put(b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R(K\x01(");
        for axis in shape {
            self.put(b"J").put(&(*axis as i32).to_le_bytes());
        }
        self.put(b"tcnumpy\ndtype\n")
            .text("f4")
            .put(b"\x89\x88\x87R(K\x03")
            .text("<");
        self.put(b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89B");
        self.put(&(numbers.len() as u32).to_le_bytes()).put(numbers).put(b"tb")
    }

    /// A whole checkpoint; `numbers` gives those of an array by its layer and shape.
    pub fn checkpoint(numbers: impl Fn(&str, &[usize]) -> Vec<u8>) -> Vec<u8> {
        let mut all = Self::new();
        all.put(b"}(").text("AlexNet_0").put(b"}(");
        for (i, kernel) in KERNELS.iter().enumerate() {
            let layer = format!("Conv_{i}");
            all.text(&layer)
                .put(b"}(")
                .text("kernel")
                .array(kernel, &numbers(&layer, kernel));
            let bias = &kernel[3..];
            all.text("bias").array(bias, &numbers(&layer, bias)).put(b"u");
        }
        all.put(b"u");
        for (i, kernel) in KERNELS.iter().enumerate() {
            let layer = format!("NetLinLayer_{i}");
            let head = [1, 1, kernel[3], 1];
            all.text(&layer).put(b"}").text("Conv_0").put(b"}").text("kernel");
            all.array(&head, &numbers(&layer, &head)).put(b"ss");
        }
        all.put(b"u.");
        all.0
    }
}
