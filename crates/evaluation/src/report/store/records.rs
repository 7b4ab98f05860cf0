//! The records of a store, in the order they were written.
use super::FILE;
use crate::error::{Error, Result};
use crate::report::record::{Claims, Detection, Id, Mark, ReadingRecord, Record};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line that is read, in bytes; a detection of a million scores fits.
const MAX_LINE: u64 = 64 << 20;

/// Something about a store that a reader of its tables should know.
pub type Note = String;

/// The records of a store.
#[derive(Debug, Default)]
pub struct Records {
    folder: PathBuf,
    marks: Vec<(Id, Mark)>,
    readings: Vec<ReadingRecord>,
    detections: Vec<Detection>,
    claims: Vec<Claims>,
    /// Every identity; those of marks with their place among them.
    ids: BTreeMap<Id, Option<usize>>,
    notes: Vec<Note>,
}

#[derive(Deserialize)]
struct Line {
    id: Id,
    record: Record,
}

/// How much of a file is whole.
pub(super) struct Length {
    /// Bytes up to the end of the last record.
    pub whole: u64,
    /// The last record lacks the newline after it.
    pub newline_is_missing: bool,
}

impl Records {
    /// Reads the records of a folder as they are now, while a run may go on writing them; changes nothing.
    ///
    /// # Errors
    /// [`Error::Io`] if there are none; [`Error::BadResults`] with the line if the file holds anything else.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let mut file = File::open(&path).map_err(Error::io(&path))?;
        Ok(Self::parse(&mut file, &path)?.0)
    }

    /// Parses a file from its start. What follows the last newline is a record if it is whole, or else dropped.
    pub(super) fn parse(file: &mut File, path: &Path) -> Result<(Self, Length)> {
        let mut records = Self {
            folder: path.parent().unwrap_or(Path::new(".")).to_path_buf(),
            ..Self::default()
        };
        let mut length = Length {
            whole: 0,
            newline_is_missing: false,
        };
        let mut reader = BufReader::new(file);
        let mut line = Vec::new();
        for number in 1u64.. {
            line.clear();
            let read = (&mut reader).take(MAX_LINE + 1).read_until(b'\n', &mut line);
            let bytes = read.map_err(Error::io(path))? as u64;
            if bytes == 0 {
                break;
            }
            let bad = |reason: String| Error::BadResults {
                path: path.to_path_buf(),
                reason: format!("line {number}: {reason}"),
            };
            if bytes > MAX_LINE {
                return Err(bad(format!("over {MAX_LINE} bytes")));
            }
            let ends = line.last() == Some(&b'\n');
            match serde_json::from_slice::<Line>(&line) {
                Ok(line) => records.accept(line).map_err(bad)?,
                Err(e) if ends => return Err(bad(e.to_string())),
                Err(_) => {
                    let note = format!("line {number} of {FILE} was torn by a crash and is left out ({bytes} bytes)");
                    records.notes.push(note);
                    break;
                }
            }
            length.whole += bytes;
            length.newline_is_missing = !ends;
        }
        Ok((records, length))
    }

    fn accept(&mut self, line: Line) -> std::result::Result<(), String> {
        let id = line.record.id();
        if id != line.id {
            return Err(format!("the record is {id}, not {}", line.id));
        }
        self.check(&id, &line.record).map_err(|e| e.to_string())?;
        self.insert(id, line.record);
        Ok(())
    }

    /// Whether a record may be added.
    pub(in crate::report) fn check(&self, id: &Id, record: &Record) -> Result<()> {
        let bad = |field, reason| Err(Error::BadOption { field, reason });
        record.check()?;
        if self.has(id) {
            return bad("id", format!("{id} is there already"));
        }
        match record {
            Record::Mark(_) => Ok(()),
            Record::Reading(reading) => match self.mark(&reading.mark) {
                Some(mark) => reading.check_against(mark),
                None => bad("mark", format!("{} is not in the store", reading.mark)),
            },
            Record::Claims(claims) => match self.mark(&claims.mark) {
                Some(_) => Ok(()),
                None => bad("mark", format!("{} is not in the store", claims.mark)),
            },
            Record::Detection(detection) => match detection.marks.iter().find(|mark| self.mark(mark).is_none()) {
                Some(mark) => bad("marks", format!("{mark} is not in the store")),
                None => Ok(()),
            },
        }
    }

    /// Adds a record that was checked.
    pub(in crate::report) fn insert(&mut self, id: Id, record: Record) {
        let place = match record {
            Record::Mark(mark) => {
                self.marks.push((id.clone(), mark));
                Some(self.marks.len() - 1)
            }
            Record::Reading(reading) => {
                self.readings.push(reading);
                None
            }
            Record::Detection(detection) => {
                self.detections.push(detection);
                None
            }
            Record::Claims(claims) => {
                self.claims.push(claims);
                None
            }
        };
        self.ids.insert(id, place);
    }

    /// Whether there is a record of this identity.
    pub fn has(&self, id: &Id) -> bool {
        self.ids.contains_key(id)
    }

    /// The mark of this identity.
    pub fn mark(&self, id: &Id) -> Option<&Mark> {
        let place = (*self.ids.get(id)?)?;
        self.marks.get(place).map(|(_, mark)| mark)
    }

    /// All marks with their identities, in the order they were written.
    pub fn marks(&self) -> &[(Id, Mark)] {
        &self.marks
    }

    /// All readings, in the order they were written; each one's mark is among [`Records::marks`].
    pub fn readings(&self) -> &[ReadingRecord] {
        &self.readings
    }

    /// All detections, in the order they were written; each one's marks are among [`Records::marks`].
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// All claims, in the order they were made; each one's mark is among [`Records::marks`].
    pub fn claims(&self) -> &[Claims] {
        &self.claims
    }

    /// The folder that paths in records start from.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What happened to the file, such as a line that a crash tore.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }
}
