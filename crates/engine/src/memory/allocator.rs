//! Memory that was freed is kept for the next step instead of given back.

/// Bytes that are asked for at once, besides those that are needed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const ROOM: libc::c_int = 64 << 20;
/// Bytes at the end of a heap that may be free before they are given back.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const KEPT: libc::c_int = 256 << 20;
/// Blocks from this size on are the kernel's, which has them back at once: the most that all versions of the library take.
/// Without it they would be those of 128 KiB and more, once anything is set.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: libc::c_int = 32 << 20;

/// Has the C library keep what this process frees, up to 256 MiB of each heap. For programs that embed, at their start.
///
/// A step frees tens of megabytes and asks for as many again. Given back between, each page is fetched and cleared anew,
/// while the other threads wait: a tenth of the time of an embedding (docs/performance.md). Does nothing where the C library
/// is not GNU's, or does not heed it.
#[allow(unsafe_code)]
pub fn keep_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    for (option, bytes) in [
        (libc::M_TOP_PAD, ROOM),
        (libc::M_TRIM_THRESHOLD, KEPT),
        (libc::M_MMAP_THRESHOLD, LARGE),
    ] {
        // SAFETY: sets a number of the allocator, under its own lock; no memory is touched.
        unsafe { libc::mallopt(option, bytes) };
    }
}

/// Gives the kernel what was freed, but for the end of each thread's heap (64 MiB at most), as a program that waits for its
/// next job should.
#[allow(unsafe_code)]
pub fn give_back_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: looks at free memory only, under the allocator's locks.
    unsafe {
        libc::malloc_trim(0);
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    use super::*;

    /// Mebibytes that the process has in memory.
    fn held() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() >> 10
    }

    /// In a process of its own: other tests ask for memory, too.
    #[test]
    fn freed_memory_is_kept_and_given_back_when_that_is_asked_for() {
        const ALONE: &str = "GUARDSPLAT_TEST_ALLOCATOR_ALONE";
        if std::env::var_os(ALONE).is_none() {
            let this = std::env::current_exe().unwrap();
            let name = "memory::allocator::tests::freed_memory_is_kept_and_given_back_when_that_is_asked_for";
            let done = std::process::Command::new(this)
                .args(["--exact", name, "--test-threads", "1"])
                .env(ALONE, "1")
                .output()
                .unwrap();
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stdout));
            return;
        }
        keep_freed();
        let before = held();
        // Many blocks: as one large one it would be the kernel's.
        let blocks: Vec<Vec<u8>> = (0..150).map(|i| vec![i as u8 + 1; 1 << 20]).collect();
        drop(std::hint::black_box(blocks));
        let kept = held();
        assert!(kept >= before + 140, "{before} {kept}");
        give_back_freed();
        let left = held();
        assert!(left <= before + 70, "{before} {kept} {left}");
    }
}
