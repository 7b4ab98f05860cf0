//! The ZIP around the pictures: entries by name, unpacked within limits, and the ZIP again with one of them replaced.
use super::budget::Budget;
use std::io::{Cursor, Read, Write};
use zip::{ZipArchive, ZipWriter};

/// Start of the record at the end of a ZIP, and of the one 20 bytes before it where the ZIP is a ZIP64.
const END: &[u8] = b"PK\x05\x06";
const LOCATOR: &[u8] = b"PK\x06\x07";
/// Largest distance of that record from the end: its own 22 bytes and the longest comment. Some more does no harm.
const TAIL: usize = 128 << 10;

/// A ZIP in memory.
pub(super) struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
}

impl<'a> Archive<'a> {
    /// Reads the list of entries; `Err` is why it cannot be one of a SOG.
    pub fn open(file: &'a [u8]) -> Result<Archive<'a>, String> {
        // Players do not read ZIP64, and without it there are 65535 entries at most.
        if is_zip64(file) {
            return Err("a ZIP64; a SOG is a ZIP without that extension".into());
        }
        let broken = |e| format!("a broken ZIP: {e}");
        let mut zip = ZipArchive::new(Cursor::new(file)).map_err(broken)?;
        if zip.has_duplicate_names() {
            return Err("a ZIP with two entries of one name".into());
        }
        let mut packed = 0u64;
        for i in 0..zip.len() {
            let entry = zip.by_index_raw(i).map_err(broken)?;
            // Copied entries lose the mark of it.
            if entry.encrypted() {
                return Err(format!("a ZIP whose entry {i} is encrypted"));
            }
            let end = entry
                .data_start()
                .and_then(|start| start.checked_add(entry.compressed_size()));
            if end.is_none_or(|end| end > file.len() as u64) {
                return Err(format!("a broken ZIP: entry {i} ends after the file"));
            }
            packed = packed.saturating_add(entry.compressed_size());
        }
        // Entries that share bytes would be many times the file when it is written again.
        if packed > file.len() as u64 {
            return Err(format!(
                "a broken ZIP: entries of {packed} bytes in a file of {}",
                file.len()
            ));
        }
        Ok(Archive { zip })
    }

    /// The content of entry `name`, which messages call `role`, of `limit` bytes at most.
    pub fn unpack(&mut self, name: &str, role: &str, limit: u64, budget: &mut Budget) -> Result<Vec<u8>, String> {
        let unreadable = |e: &dyn std::fmt::Display| format!("{role} cannot be unpacked: {e}");
        let entry = self.zip.by_name(name).map_err(|e| match e {
            zip::result::ZipError::FileNotFound => format!("not an SOG, or not all of it: the ZIP has no {role}"),
            e => unreadable(&e),
        })?;
        let size = entry.size();
        if size > limit {
            return Err(format!("{role} has {size} bytes, limit {limit}"));
        }
        budget.spend(size).map_err(|e| format!("{role}: {e}"))?;
        let mut content = Vec::new();
        content.try_reserve_exact(size as usize).map_err(|e| unreadable(&e))?;
        entry
            .take(size + 1)
            .read_to_end(&mut content)
            .map_err(|e| unreadable(&e))?;
        if content.len() as u64 != size {
            return Err(format!("{role} has not the {size} bytes that the ZIP says"));
        }
        Ok(content)
    }
}

/// The ZIP `file` with `content` in place of that of entry `name`; all others keep their bytes, packed as they are.
pub(super) fn replace(file: &[u8], name: &str, content: &[u8]) -> Result<Vec<u8>, String> {
    let replaced = || -> zip::result::ZipResult<Vec<u8>> {
        let mut zip = ZipArchive::new(Cursor::new(file))?;
        let room = Vec::with_capacity(file.len() + content.len());
        let mut out = ZipWriter::new(Cursor::new(room));
        out.set_raw_comment(zip.comment().into())?;
        let index = zip.index_for_name(name);
        for i in 0..zip.len() {
            let entry = zip.by_index_raw(i)?;
            if Some(i) == index {
                // Method, time and attributes are those of the old one.
                out.start_file(name, entry.options())?;
                out.write_all(content)?;
            } else {
                out.raw_copy_file(entry)?;
            }
        }
        Ok(out.finish()?.into_inner())
    };
    replaced().map_err(|e| format!("a ZIP that cannot be written again: {e}"))
}

/// Whether some record at the end, the right one or one that only looks so, has that of a ZIP64 before it.
fn is_zip64(file: &[u8]) -> bool {
    let tail = &file[file.len().saturating_sub(TAIL)..];
    tail.windows(24)
        .any(|part| part.starts_with(LOCATOR) && part.ends_with(END))
}
