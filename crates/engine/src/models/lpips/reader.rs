//! The bytes of a pickle, one after another.

/// Longest name of a module or of what is in it.
const MAX_NAME: usize = 64;

pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// How many bytes were read.
    pub fn at(&self) -> usize {
        self.at
    }

    /// What was not read yet.
    pub fn left(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// So many bytes.
    pub fn take(&mut self, length: usize) -> Result<&'a [u8], String> {
        let rest = self.left();
        let taken = rest.get(..length).ok_or_else(|| {
            let left = rest.len();
            format!("the pickle ends here: {length} bytes are announced, {left} are left")
        })?;
        self.at += length;
        Ok(taken)
    }

    /// The bytes of a number.
    pub fn word<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let taken = self.take(N)?;
        taken
            .first_chunk()
            .copied()
            .ok_or_else(|| "the pickle ends here".into())
    }

    pub fn byte(&mut self) -> Result<u8, String> {
        self.word().map(|[byte]| byte)
    }

    /// A length of four bytes; not more than a promise.
    pub fn length(&mut self) -> Result<usize, String> {
        let length = u32::from_le_bytes(self.word()?);
        usize::try_from(length).map_err(|e| e.to_string())
    }

    /// A text after its length.
    pub fn text(&mut self) -> Result<&'a str, String> {
        let length = self.length()?;
        std::str::from_utf8(self.take(length)?).map_err(|e| format!("a text is not UTF-8: {e}"))
    }

    /// A name that ends with its line.
    pub fn line(&mut self) -> Result<&'a str, String> {
        let rest = self.left();
        let end = rest.iter().take(MAX_NAME + 1).position(|byte| *byte == b'\n');
        let end = end.ok_or_else(|| format!("a name has no end within {MAX_NAME} bytes"))?;
        let line = self.take(end)?;
        self.byte()?;
        std::str::from_utf8(line).map_err(|e| format!("a name is not UTF-8: {e}"))
    }
}
