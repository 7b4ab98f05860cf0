//! Memory that was freed is kept for the next step instead of given back.

/// Bytes that are asked for at once, besides those that are needed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const ROOM: libc::c_int = 64 << 20;
/// Bytes at the end of a heap that may be free before they are given back.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const KEPT: libc::c_int = 256 << 20;
/// Blocks from this size on are the kernel's, which has them back at once.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: libc::c_int = 256 << 20;

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
