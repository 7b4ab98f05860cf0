//! What one table is made of: records of one engine version, of each length one CLIP, and of each variant the newest settings.
use super::record::{Claims, Detection, Id, Mark, ReadingRecord};
use super::store::Records;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// An engine version with a CLIP; tables never mix two for messages of one length.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Pair {
    /// Version of the engine.
    pub engine_version: String,
    /// Name of the CLIP.
    pub clip: String,
    /// Hash of its weights.
    pub clip_hash: String,
}

impl Pair {
    fn of(mark: &Mark) -> Self {
        let embedding = &mark.embedding;
        Self {
            engine_version: embedding.engine_version.clone(),
            clip: embedding.clip.clone(),
            clip_hash: embedding.clip_hash.clone(),
        }
    }

    /// All pairs of some records; last the newest, which is that of the mark written last. Those whose marks are all told
    /// with a newer one are none of their own: lengths may have CLIPs of their own.
    pub fn all(records: &Records) -> Vec<Pair> {
        let mut pairs: Vec<(Pair, ClipsByLength)> = Vec::new();
        for (_, mark) in records.marks().iter().rev() {
            let pair = Pair::of(mark);
            if !pairs
                .iter()
                .any(|(newer, clips)| *newer == pair || clips.have(&pair, mark))
            {
                let clips = ClipsByLength::of(records, &pair);
                pairs.push((pair, clips));
            }
        }
        pairs.reverse();
        pairs.into_iter().map(|(pair, _)| pair).collect()
    }
}

/// Which CLIP messages of each length are told of, beside those of a pair: its own where it has marks of that length, else
/// the one of the mark written last.
struct ClipsByLength(BTreeMap<u32, Pair>);

impl ClipsByLength {
    fn of(records: &Records, pair: &Pair) -> Self {
        let mut clips = BTreeMap::new();
        for (_, mark) in records.marks() {
            let other = Pair::of(mark);
            let bits = mark.embedding.bits;
            if other.engine_version == pair.engine_version && clips.get(&bits) != Some(pair) {
                clips.insert(bits, other);
            }
        }
        Self(clips)
    }

    /// Whether a mark of that pair is among them.
    fn have(&self, pair: &Pair, mark: &Mark) -> bool {
        self.0.get(&mark.embedding.bits) == Some(pair)
    }
}

/// One mark with one of its readings: a run, whose views are not independent of each other.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// The mark.
    pub mark: &'a Mark,
    /// What was read of it.
    pub reading: &'a ReadingRecord,
}

/// Records that may be told together, in an order that does not depend on when they were made.
#[derive(Debug)]
pub struct Selection<'a> {
    records: &'a Records,
    pair: Pair,
    marks: Vec<(&'a Id, &'a Mark)>,
    readings: BTreeMap<(&'a Id, &'a str), &'a ReadingRecord>,
    notes: Vec<String>,
}

impl<'a> Selection<'a> {
    /// Records of the newest pair, see [`Pair::all`]; `None` without any marks.
    pub fn newest(records: &'a Records) -> Option<Self> {
        let pair = Pair::all(records).pop()?;
        Some(Self::of(records, &pair))
    }

    /// Records of one pair, and of lengths that it has no marks of.
    ///
    /// Where marks of the same bits and variant were made with different settings or sizes of views, those like the
    /// one written last are taken. Where a mark was read twice under one attack, the reading from most views counts,
    /// then that at the mark's own size, then that from views that no decision was taken on, then the one written last. [`Selection::notes`] says what was left out.
    pub fn of(records: &'a Records, pair: &Pair) -> Self {
        let mut notes: Vec<String> = records.notes().to_vec();
        let clips = ClipsByLength::of(records, pair);
        let of_pair = || {
            records
                .marks()
                .iter()
                .filter(|(_, mark)| clips.have(&Pair::of(mark), mark))
        };
        for (bits, other) in clips.0.iter().filter(|(_, other)| *other != pair) {
            notes.push(format!(
                "{bits} bits are of the CLIP {} ({})",
                other.clip, other.clip_hash
            ));
        }
        let mut newest = BTreeMap::new();
        for (_, mark) in of_pair() {
            newest.insert(group(mark), settings(mark));
        }
        let (taken, old): (Vec<_>, Vec<_>) =
            of_pair().partition(|(_, mark)| newest.get(&group(mark)) == Some(&settings(mark)));
        let mut marks: Vec<(&Id, &Mark)> = taken.into_iter().map(|(id, mark)| (id, mark)).collect();
        marks.sort_by_key(|(id, mark)| (&mark.embedding.scene, group(mark), mark.embedding.seed, *id));
        let others = records.marks().len() - of_pair().count();
        if others > 0 {
            notes.push(format!("{others} marks of other engine versions or CLIPs are left out"));
        }
        if !old.is_empty() {
            notes.push(format!("{} marks made with other settings are left out", old.len()));
        }
        let devices: BTreeSet<&str> = marks.iter().map(|(_, mark)| mark.device.as_str()).collect();
        if devices.len() > 1 {
            let devices = devices.into_iter().collect::<Vec<_>>().join(", ");
            notes.push(format!("seconds are of several devices: {devices}"));
        }
        let sizes: BTreeMap<&Id, u32> = marks.iter().map(|(id, mark)| (*id, mark.embedding.size)).collect();
        let mut readings: BTreeMap<(&Id, &str), &ReadingRecord> = BTreeMap::new();
        let mut repeated = 0;
        for reading in records.readings() {
            let Some(size) = sizes.get(&reading.mark) else {
                continue;
            };
            let worth = |reading: &ReadingRecord| (reading.views, reading.size == *size, reading.first_view);
            let place = (&reading.mark, reading.attack.as_str());
            let known = readings.get(&place).copied();
            repeated += usize::from(known.is_some());
            if known.is_none_or(|known| worth(reading) >= worth(known)) {
                readings.insert(place, reading);
            }
        }
        if repeated > 0 {
            notes.push(format!(
                "{repeated} readings of a mark and attack that was read better are left out"
            ));
        }
        Self {
            records,
            pair: pair.clone(),
            marks,
            readings,
            notes,
        }
    }

    /// The engine version and CLIP.
    pub fn pair(&self) -> &Pair {
        &self.pair
    }

    /// The records that these were chosen from.
    pub fn records(&self) -> &'a Records {
        self.records
    }

    /// What was left out, and what a reader should know.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The marks, by scene, bits, variant and seed.
    pub fn marks(&self) -> &[(&'a Id, &'a Mark)] {
        &self.marks
    }

    /// Marks of a variant, of so many bits.
    pub fn marks_of(&self, bits: u32, variant: &str) -> Vec<&'a Mark> {
        let marks = self.marks.iter().map(|(_, mark)| *mark);
        marks.filter(|mark| group(mark) == (bits, variant)).collect()
    }

    /// All runs: marks in their order, their readings by attack.
    pub fn all_runs(&self) -> Vec<Run<'a>> {
        let of_mark = |(id, mark): &(&'a Id, &'a Mark)| {
            let (id, mark) = (*id, *mark);
            let from = self.readings.range((id, "")..);
            from.take_while(move |((of, _), _)| *of == id)
                .map(move |(_, reading)| Run { mark, reading })
        };
        self.marks.iter().flat_map(of_mark).collect()
    }

    /// Runs of a variant, of so many bits, under an attack.
    pub fn runs(&self, bits: u32, variant: &str, attack: &str) -> Vec<Run<'a>> {
        let of_group = self.marks.iter().filter(|(_, mark)| group(mark) == (bits, variant));
        let read = of_group.filter_map(|(id, mark)| {
            let reading = self.readings.get(&(*id, attack)).copied()?;
            Some(Run { mark, reading })
        });
        read.collect()
    }

    /// Attacks that anything was read under, in the order of their names.
    pub fn attacks(&self) -> BTreeSet<&'a str> {
        self.readings.keys().map(|(_, attack)| *attack).collect()
    }

    /// Bits and variants that there are marks of.
    pub fn groups(&self) -> BTreeSet<(u32, &'a str)> {
        self.marks.iter().map(|(_, mark)| group(mark)).collect()
    }

    /// Claims about these marks, with them; by mark, then as they were made.
    pub fn claims(&self) -> Vec<(&'a Mark, &'a Claims)> {
        let all = self.records.claims();
        let of_mark = |(id, mark): &(&'a Id, &'a Mark)| {
            let (id, mark) = (*id, *mark);
            all.iter().filter(move |c| c.mark == *id).map(move |c| (mark, c))
        };
        self.marks.iter().flat_map(of_mark).collect()
    }

    /// Detections all of whose marks are among these, by detector and identity.
    pub fn detections(&self) -> Vec<&'a Detection> {
        let marks: BTreeSet<&Id> = self.marks.iter().map(|(id, _)| *id).collect();
        let all = self.records.detections().iter();
        let mut chosen: Vec<_> = all
            .filter(|d| d.marks.iter().all(|mark| marks.contains(mark)))
            .collect();
        chosen.sort_by_cached_key(|detection| (detection.detector.clone(), detection.id()));
        chosen
    }
}

fn group(mark: &Mark) -> (u32, &str) {
    (mark.embedding.bits, mark.embedding.variant.as_str())
}

fn settings(mark: &Mark) -> (&str, u32) {
    (mark.embedding.settings_hash.as_str(), mark.embedding.size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::record::Record;
    use crate::report::testing::{mark, reading, records};

    #[test]
    fn versions_are_not_mixed_and_the_newest_is_told() {
        let old = mark("lego", 16, "standard", 1);
        let mut new = old.clone();
        new.embedding.engine_version = "0.2.0".into();
        let records = records([
            Record::Mark(new.clone()),
            Record::Reading(reading(&new, "none", &[16])),
            Record::Mark(old.clone()),
            Record::Reading(reading(&old, "none", &[4])),
        ]);
        let pairs = Pair::all(&records);
        assert_eq!(pairs.len(), 2);
        let newest = Selection::newest(&records).unwrap();
        assert_eq!(newest.pair().engine_version, "0.1.0");
        assert_eq!(newest.all_runs().len(), 1);
        assert_eq!(newest.runs(16, "standard", "none")[0].reading.accuracy(), 0.25);
        assert!(newest.notes()[0].starts_with("1 marks of other engine versions"));
        let chosen = Selection::of(&records, &pairs[0]);
        assert_eq!(chosen.runs(16, "standard", "none")[0].reading.accuracy(), 1.0);
        assert!(Selection::newest(&Records::default()).is_none());
    }

    #[test]
    fn lengths_may_have_clips_of_their_own_and_one_length_has_one() {
        let long = mark("lego", 32, "standard", 1);
        let mut short = mark("lego", 16, "standard", 1);
        short.embedding.clip_hash = "short".into();
        let told_together = records([Record::Mark(short.clone()), Record::Mark(long.clone())]);
        let pairs = Pair::all(&told_together);
        assert_eq!(pairs, [Pair::of(&long)]);
        let selection = Selection::of(&told_together, &pairs[0]);
        assert_eq!(selection.marks.len(), 2);
        assert!(
            selection.notes()[0].contains("16 bits are of the CLIP"),
            "{:?}",
            selection.notes()
        );

        let again = mark("lego", 16, "standard", 2);
        let told_apart = records([Record::Mark(short.clone()), Record::Mark(long), Record::Mark(again)]);
        assert_eq!(Pair::all(&told_apart).len(), 2);
        let newest = Selection::newest(&told_apart).unwrap();
        assert!(newest.marks.iter().all(|(_, mark)| mark.embedding.clip_hash != "short"));
    }

    #[test]
    fn settings_and_repeated_readings_are_not_mixed() {
        let new = mark("lego", 16, "standard", 1);
        let mut old = mark("ship", 16, "standard", 1);
        old.embedding.settings_hash = "old".into();
        let records = records([
            Record::Mark(old.clone()),
            Record::Reading(reading(&old, "none", &[16])),
            Record::Mark(new.clone()),
            Record::Reading(reading(&new, "none", &[16, 16, 8])),
            Record::Reading(reading(&new, "none", &[4])),
        ]);
        let selection = Selection::newest(&records).unwrap();
        let runs = selection.runs(16, "standard", "none");
        assert_eq!(runs.len(), 1);
        assert_eq!(runs[0].reading.views, 3);
        assert_eq!(selection.notes().len(), 2);
    }
}
