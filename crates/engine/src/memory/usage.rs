//! How much memory this process has used.

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
