//! How much memory a job may take: of the machine, of its container, of an operator's budget, of a GPU's buffers.
use super::requirements::{Bytes, MemoryRequirements};
use crate::error::{Error, Result};

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
    pub fn admit(&self, memory: &MemoryRequirements) -> Result<()> {
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

    /// Bytes that are left beside `memory`.
    pub fn left(&self, memory: &MemoryRequirements) -> u64 {
        self.memory.saturating_sub(memory.total())
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
        let mut memory = MemoryRequirements {
            scene: 2 << 30,
            views: 1 << 30,
            ..MemoryRequirements::default()
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
}
