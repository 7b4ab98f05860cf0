//! How much memory a parser may take: the peak of what it asks for, over what was in use before.
use peakmem_alloc::{PeakMemAlloc, PeakMemAllocTrait as _};
use std::alloc::System;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts for whatever links this crate: the fuzzing programs and the tests.
#[global_allocator]
static MEMORY: PeakMemAlloc<System> = PeakMemAlloc::system();

/// The highest peak so far.
static HIGHEST: AtomicUsize = AtomicUsize::new(0);
/// The highest peak that was told of.
static TOLD: AtomicUsize = AtomicUsize::new(1 << 20);

/// What any file may take besides twice its size.
pub const SLACK: usize = 64 << 20;

/// Runs a parser of `size` bytes, which must be in memory already.
///
/// # Panics
/// Where it takes more than twice as much and [`SLACK`]. Other threads are counted too: one parser at a time.
pub fn bounded<T>(size: usize, parse: impl FnOnce() -> T) -> T {
    MEMORY.reset_peak_memory();
    let parsed = parse();
    let peak = MEMORY.get_peak_memory();
    let allowed = 2 * size + SLACK;
    assert!(
        peak <= allowed,
        "{size} bytes took {peak} bytes of memory, allowed are {allowed}"
    );
    HIGHEST.fetch_max(peak, Ordering::Relaxed);
    // For whoever reads the fuzzer's log; rarely, since it is the tenfold that matters.
    if peak > TOLD.load(Ordering::Relaxed) {
        TOLD.store(peak + peak / 4, Ordering::Relaxed);
        eprintln!("peak: {peak} bytes of memory for {size} bytes");
    }
    parsed
}

/// The highest peak since the last call.
pub fn take_highest() -> usize {
    HIGHEST.swap(0, Ordering::Relaxed)
}
