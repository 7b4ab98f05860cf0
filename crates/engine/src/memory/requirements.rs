//! Bytes that a job needs at once, by what they are for.
use serde::Serialize;

/// What the program takes before it has read anything: its code, the tensor library, threads.
const PROGRAM: u64 = 36 << 20;

/// Bytes that a job needs at once, by what they are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MemoryRequirements {
    /// Code and threads.
    pub program: u64,
    /// Weights of the models that are loaded.
    pub models: u64,
    /// The scene's file and its numbers; for a verification of a marked scene, both scenes.
    pub scene: u64,
    /// Learned changes and their gradient.
    pub offsets: u64,
    /// The optimiser's state.
    pub optimiser: u64,
    /// Prepared views that are kept.
    pub views: u64,
    /// Pictures and what differentiation keeps of them, or what views are prepared in, if that is more.
    pub pictures: u64,
}

impl MemoryRequirements {
    /// Of the program alone.
    pub fn of_program() -> Self {
        Self {
            program: PROGRAM,
            ..Self::default()
        }
    }

    /// All of it.
    pub fn total(&self) -> u64 {
        self.parts()
            .iter()
            .map(|(_, bytes)| bytes)
            .fold(0, |sum, b| sum.saturating_add(*b))
    }

    fn parts(&self) -> [(&'static str, u64); 7] {
        [
            ("program", self.program),
            ("models", self.models),
            ("scene", self.scene),
            ("offsets", self.offsets),
            ("optimiser", self.optimiser),
            ("views", self.views),
            ("pictures", self.pictures),
        ]
    }
}

impl std::fmt::Display for MemoryRequirements {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (", Bytes(self.total()))?;
        let parts = self.parts().into_iter().filter(|(_, bytes)| *bytes > 0);
        for (i, (name, bytes)) in parts.enumerate() {
            let comma = if i > 0 { ", " } else { "" };
            write!(f, "{comma}{name} {}", Bytes(bytes))?;
        }
        f.write_str(")")
    }
}

/// A number of bytes, for people.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            b if b < 1 << 20 => write!(f, "{:.1} KiB", b as f64 / 1024.0),
            b if b < 1 << 30 => write!(f, "{:.0} MiB", b as f64 / f64::from(1 << 20)),
            b => write!(f, "{:.1} GiB", b as f64 / f64::from(1 << 30)),
        }
    }
}
