//! Memory: how much a job will need, before it begins; how much there may be; how much was used.
//!
//! What is needed is predicted from the sizes of arrays, not from what was measured on some machine: the few constants
//! that no array explains are said where they stand. `memory-bench` (a program of the tests) holds predictions against
//! peaks.
use serde::Serialize;

use crate::error::{Error, Result};

/// What the program takes before it has read anything: its code, the tensor library, threads.
const PROGRAM: u64 = 36 << 20;

/// Bytes that a job needs at once, by what they are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Memory {
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

impl Memory {
    /// With nothing but the program.
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

impl std::fmt::Display for Memory {
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

/// What a job may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of this machine's memory.
    pub memory: u64,
    /// Whether an operator set that, rather than the machine.
    pub budget: bool,
    /// Bytes of one buffer on the GPU, where there is one.
    pub buffer: Option<u64>,
}

impl Limits {
    /// All that the machine has, or what its container may use; no more than `budget`, where an operator set one.
    pub fn of_machine(budget: Option<u64>) -> Self {
        let machine = machine();
        Self {
            memory: budget.map_or(machine, |budget| budget.min(machine)),
            budget: budget.is_some_and(|budget| budget <= machine),
            buffer: None,
        }
    }

    /// Of nothing but a GPU's buffers.
    pub fn of_buffers(buffer: u64) -> Self {
        Self {
            memory: u64::MAX,
            budget: false,
            buffer: Some(buffer),
        }
    }

    /// Whether a job that needs `memory` may begin.
    ///
    /// # Errors
    /// [`Error::DoesNotFit`] with both numbers.
    pub fn admit(&self, memory: &Memory) -> Result<()> {
        if memory.total() <= self.memory {
            return Ok(());
        }
        let whose = if self.budget {
            "its budget is"
        } else {
            "the machine has"
        };
        Err(Error::DoesNotFit {
            reason: format!("it needs {memory}, {whose} {}", Bytes(self.memory)),
        })
    }

    /// Whether the GPU can hold `bytes` in one buffer.
    ///
    /// # Errors
    /// [`Error::DoesNotFit`] with `what` it is, and both numbers.
    pub fn admit_buffer(&self, what: &str, bytes: u64) -> Result<()> {
        match self.buffer {
            Some(limit) if bytes > limit => Err(Error::DoesNotFit {
                reason: format!(
                    "{what} takes {} on the GPU, whose largest buffer is {}",
                    Bytes(bytes),
                    Bytes(limit)
                ),
            }),
            _ => Ok(()),
        }
    }
}

/// Memory of the machine, or of the container that this process is in.
fn machine() -> u64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let total = match system.total_memory() {
        0 => u64::MAX, // the system does not tell
        total => total,
    };
    system
        .cgroup_limits()
        .map_or(total, |limits| limits.total_memory.min(total))
}

/// Lets [`peak`] begin anew with what is in use now. Says whether the system did so.
pub fn forget_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// The most memory that this process has had in use at once, in bytes; `None` where the system does not tell.
pub fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_ascii_whitespace()
        .next()?
        .parse::<u64>()
        .ok()
        .map(|kib| kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_the_numbers() {
        let limits = Limits {
            memory: 3 << 30,
            budget: true,
            buffer: Some(128 << 20),
        };
        let mut memory = Memory {
            scene: 2 << 30,
            views: 1 << 30,
            ..Memory::default()
        };
        limits.admit(&memory).unwrap();
        memory.optimiser = 512 << 20;
        let told = limits.admit(&memory).unwrap_err().to_string();
        let all = "needs 3.5 GiB (scene 2.0 GiB, optimiser 512 MiB, views 1.0 GiB), its budget is 3.0 GiB";
        assert!(told.contains(all), "{told}");
        assert!(limits.admit_buffer("a view", 129 << 20).is_err());
        limits.admit_buffer("a view", 128 << 20).unwrap();
        memory.scene = u64::MAX;
        assert!(limits.admit(&memory).is_err(), "sums do not wrap");
    }

    #[test]
    fn a_budget_is_not_more_than_the_machine_has() {
        let all = Limits::of_machine(None);
        assert!(!all.budget && all.memory > 64 << 20);
        assert_eq!(Limits::of_machine(Some(u64::MAX)).memory, all.memory);
        let small = Limits::of_machine(Some(5 << 20));
        assert_eq!((small.memory, small.budget), (5 << 20, true));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_stays() {
        let before = peak().unwrap();
        // Written to and looked at, or the compiler does without.
        let mut held = vec![1u8; 200 << 20];
        std::hint::black_box(&mut held);
        let with = peak().unwrap();
        drop(std::hint::black_box(held));
        // The kernel counts each core's pages in batches, so the figure is a little off.
        assert!(with >= 190 << 20 && with >= before / 10 * 9, "{before} {with}");
        assert!(peak().unwrap() >= with / 10 * 9);
    }
}
