//! The header of a file and those of its sections: what is where. 4096 bytes, then 1024 a section, of which the first few
//! say something; then the sections, one after the other.

/// Bytes of the header of a file.
pub(crate) const HEADER: usize = 4096;
/// Bytes of the header of a section.
pub(crate) const SECTION: usize = 1024;
/// Bytes by which a file is known, of the header.
const KNOWN_BY: usize = 24;
/// Most sections for a file to be known as one. Its name counts on it: nothing else is magic.
const MOST_SECTIONS: u32 = 1 << 20;
/// Bytes of the centre of a bucket.
const CENTRE: u64 = 12;
/// Steps from the centre of a bucket to its side, where the header says none.
const STEPS: u32 = 32_767;
/// Half of the range of harmonics of 8 bits, where the header says none.
const HARMONICS: f32 = 1.5;
/// Highest degree of spherical harmonics.
pub(crate) const MAX_DEGREE: usize = 2;

/// How numbers are stored, in all sections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// Single precision.
    Single,
    /// Half precision; positions as steps from the centre of a bucket.
    Half,
    /// The same, but for harmonics, which are bytes.
    Byte,
}

impl Level {
    /// Bytes of position, deviations and rotation, after which the colour comes.
    pub fn geometry(self) -> usize {
        match self {
            Level::Single => 40,
            Level::Half | Level::Byte => 20,
        }
    }

    /// Bytes of a harmonic.
    pub fn harmonic(self) -> usize {
        match self {
            Level::Single => 4,
            Level::Half => 2,
            Level::Byte => 1,
        }
    }

    /// Bytes of a Gaussian.
    pub fn row(self, degree: usize) -> usize {
        self.geometry() + 4 + self.harmonic() * crate::fields::rest_count(degree)
    }
}

/// What the header of a file says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Header {
    pub level: Level,
    pub sections: usize,
    /// In all sections.
    pub gaussians: u64,
    /// What the least and the largest byte of a harmonic stand for.
    pub harmonics: (f32, f32),
}

/// What the header of a section says, and where its parts are in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Section {
    /// The first of its Gaussians, of those of the file.
    pub first: u64,
    pub gaussians: u64,
    pub degree: usize,
    /// Gaussians of a bucket that is full.
    pub bucket: u64,
    pub full: u64,
    pub partial: u64,
    /// Side of a bucket for each step of a coordinate, and the step of its centre.
    pub step: f64,
    pub middle: f64,
    /// First byte: lengths of buckets that are not full, then centres of all.
    pub start: u64,
    /// First byte of its Gaussians.
    pub rows: u64,
    /// The byte after them.
    pub end: u64,
}

/// Whether a file that starts so is to be read as one, be it only to say what is wrong with it: major version 0, some minor
/// one, two bytes of nothing, and numbers of sections that can be.
pub(super) fn detect(first: &[u8]) -> bool {
    first.len() >= KNOWN_BY
        && first[0] == 0
        && (1..16).contains(&first[1])
        && first[2..4] == [0, 0]
        && (1..=MOST_SECTIONS).contains(&u32_at(first, 4))
        && u32_at(first, 8) <= u32_at(first, 4)
        && u32_at(first, 16) <= u32_at(first, 12)
        && first[21..24] == [0, 0, 0]
}

/// Reads the header of a file of `size` bytes; `Err` says what is wrong with it.
pub(super) fn header(head: &[u8], size: u64) -> Result<Header, String> {
    if head.len() < HEADER {
        return Err(format!("truncated: {size} bytes, the header has {HEADER}"));
    }
    if head[1] != 1 {
        return Err(format!("version 0.{}; known is 0.1", head[1]));
    }
    let [most_sections, sections, most, gaussians] = [4, 8, 12, 16].map(|at| u32_at(head, at));
    if sections != most_sections {
        return Err(format!("{sections} of {most_sections} sections are there; all must be"));
    }
    if gaussians != most {
        return Err(format!("{gaussians} of {most} Gaussians are there; all must be"));
    }
    let level = match u16_at(head, 20) {
        0 => Level::Single,
        1 => Level::Half,
        2 => Level::Byte,
        other => return Err(format!("compression level {other}; known are 0, 1 and 2")),
    };
    let room = size.saturating_sub(HEADER as u64);
    if u64::from(sections) * SECTION as u64 > room {
        return Err(format!(
            "truncated: {size} bytes for {sections} sections of {SECTION} and more"
        ));
    }
    if u64::from(gaussians) * level.row(0) as u64 > room {
        return Err(format!("truncated: {size} bytes for {gaussians} Gaussians"));
    }
    let harmonics = (end_of_range(head, 36, -HARMONICS)?, end_of_range(head, 40, HARMONICS)?);
    Ok(Header {
        level,
        sections: sections as usize,
        gaussians: u64::from(gaussians),
        harmonics,
    })
}

/// Viewers take 0 and NaN for a number that was not written.
fn end_of_range(head: &[u8], at: usize, default: f32) -> Result<f32, String> {
    match f32_at(head, at) {
        value if value == 0.0 || value.is_nan() => Ok(default),
        value if value.is_finite() => Ok(value),
        value => {
            let end = if at == 36 { "least" } else { "largest" };
            Err(format!("the {end} harmonic is {value}, must be finite"))
        }
    }
}

/// Reads the headers of those sections that `head`, the first bytes of a file of `size`, has whole; `Err` says what is
/// wrong with one of them, or with all if they are there.
pub(super) fn sections(head: &[u8], header: &Header, size: u64) -> Result<Vec<Section>, String> {
    let whole = head[HEADER..].chunks_exact(SECTION).take(header.sections);
    let mut all = Vec::with_capacity(whole.len());
    let (mut first, mut start) = (0, (HEADER + header.sections * SECTION) as u64);
    for (i, bytes) in whole.enumerate() {
        let section = section(bytes, header.level, first, start).map_err(|reason| format!("section {i}: {reason}"))?;
        if section.end > size {
            let end = section.end;
            return Err(format!("truncated: section {i} ends at byte {end} of a file of {size}"));
        }
        (first, start) = (first + section.gaussians, section.end);
        all.push(section);
    }
    if all.len() == header.sections && first != header.gaussians {
        let told = header.gaussians;
        return Err(format!("sections of {first} Gaussians in a file of {told}"));
    }
    Ok(all)
}

fn section(bytes: &[u8], level: Level, first: u64, start: u64) -> Result<Section, String> {
    let number = |at| u64::from(u32_at(bytes, at));
    let [gaussians, most, bucket, buckets] = [0, 4, 8, 12].map(number);
    let (full, partial) = (number(32), number(36));
    let (block, centre) = (f32_at(bytes, 16), u64::from(u16_at(bytes, 20)));
    let middle = match u32_at(bytes, 24) {
        0 => STEPS,
        steps => steps,
    };
    let degree = usize::from(u16_at(bytes, 40));
    if gaussians != most {
        return Err(format!("{gaussians} of {most} Gaussians are there; all must be"));
    }
    if degree > MAX_DEGREE {
        return Err(format!(
            "spherical harmonics of degree {degree}; the limit is {MAX_DEGREE}"
        ));
    }
    if level != Level::Single && gaussians > 0 {
        if centre != CENTRE {
            return Err(format!("buckets have {centre} bytes, must have {CENTRE}"));
        }
        if buckets < full + partial {
            return Err(format!("{buckets} buckets, of which {full} full and {partial} others"));
        }
        if !block.is_finite() {
            return Err(format!("the side of buckets is {block}"));
        }
        if full * bucket > gaussians {
            return Err(format!("{full} full buckets of {bucket}, and {gaussians} Gaussians"));
        }
    }
    // None of it comes near the limit of 64 bits: 32 bits each.
    let rows = start + 4 * partial + centre * buckets;
    Ok(Section {
        first,
        gaussians,
        degree,
        bucket,
        full,
        partial,
        step: f64::from(block) / 2.0 / f64::from(middle),
        middle: f64::from(middle),
        start,
        rows,
        end: rows + gaussians * level.row(degree) as u64,
    })
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

pub(super) fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}
