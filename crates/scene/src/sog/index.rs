//! `lod-meta.json`: which files hold which level of detail of a SOG that is streamed, as splat-transform writes it.
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Most levels of detail.
const MAX_LEVELS: u64 = 32;
/// Longest part of the parser's message, which quotes the file.
const MAX_MESSAGE: usize = 200;

/// A file of Gaussians of one level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Unit {
    /// Its `meta.json`, or a bundle, within the folder of the index.
    pub name: String,
    /// How many Gaussians the tiles have of it, which is all.
    pub gaussians: u64,
}

impl Unit {
    /// What is read and written: the folder of the `meta.json`, or the bundle.
    pub fn path(&self) -> PathBuf {
        let path = Path::new(&self.name);
        match path.file_name() {
            Some(name) if name == "meta.json" => path.parent().unwrap_or(path).into(),
            _ => path.into(),
        }
    }
}

#[derive(Deserialize)]
struct Json {
    version: Option<u64>,
    #[serde(rename = "lodLevels")]
    levels: u64,
    counts: Option<Vec<u64>>,
    filenames: Vec<String>,
    tree: Node,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<Node>,
    #[serde(default)]
    lods: BTreeMap<String, Part>,
}

/// What a tile has of a file.
#[derive(Clone, Copy, Deserialize)]
struct Part {
    file: u64,
    offset: u64,
    count: u64,
}

/// The files of every level, the finest first; `Err` says what is missing or wrong.
pub(super) fn parse(text: &[u8]) -> Result<Vec<Vec<Unit>>, String> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    // The parser refuses what is nested deeper than 128 times, and with it trees.
    let json: Json =
        serde_json::from_slice(text).map_err(|e| e.to_string().chars().take(MAX_MESSAGE).collect::<String>())?;
    if let Some(version) = json.version.filter(|version| *version != 1) {
        return Err(format!("version {version}; known is 1"));
    }
    if !(1..=MAX_LEVELS).contains(&json.levels) {
        return Err(format!("lodLevels is {}, must be 1 to {MAX_LEVELS}", json.levels));
    }
    check_names(&json.filenames)?;
    let mut files = vec![File::default(); json.filenames.len()];
    collect(&json.tree, json.levels, &mut files)?;
    let mut levels = vec![Vec::new(); json.levels as usize];
    for (i, (name, mut file)) in json.filenames.into_iter().zip(files).enumerate() {
        let gaussians = file.all().map_err(|reason| format!("file {i}, {name:?}: {reason}"))?;
        if let Some(level) = file.level {
            levels[level as usize].push(Unit { name, gaussians });
        }
    }
    for (level, told) in json.counts.iter().flatten().enumerate() {
        let units = levels.get(level).into_iter().flatten();
        let there: u64 = units.map(|unit| unit.gaussians).sum();
        if there != *told {
            return Err(format!(
                "tiles have {there} Gaussians of level {level}, counts has {told}"
            ));
        }
    }
    Ok(levels)
}

/// What tiles have of a file.
#[derive(Clone, Default)]
struct File {
    level: Option<u64>,
    parts: Vec<(u64, u64)>,
}

impl File {
    /// How many Gaussians there are; every one of them is in one tile.
    fn all(&mut self) -> Result<u64, String> {
        self.parts.sort_unstable();
        let mut end = 0u64;
        for (offset, count) in self.parts.iter().filter(|(_, count)| *count > 0) {
            if *offset != end {
                let which = if *offset < end { "in two tiles" } else { "in no tile" };
                return Err(format!("row {} is {which}", end.min(*offset)));
            }
            end = end.checked_add(*count).ok_or("more rows than 64 bits can count")?;
        }
        Ok(end)
    }
}

fn collect(node: &Node, levels: u64, files: &mut [File]) -> Result<(), String> {
    for (key, part) in &node.lods {
        let level = key.parse().ok().filter(|level| *level < levels);
        let level = level.ok_or_else(|| format!("a tile of level {key:?}, must be less than {levels}"))?;
        let count = files.len();
        let file = usize::try_from(part.file).ok().and_then(|file| files.get_mut(file));
        let file = file.ok_or_else(|| format!("a tile of file {}, there are {count}", part.file))?;
        if file.level.is_some_and(|other| other != level) {
            return Err(format!("file {} is of two levels; each must be of one", part.file));
        }
        file.level = Some(level);
        file.parts.push((part.offset, part.count));
    }
    node.children.iter().try_for_each(|child| collect(child, levels, files))
}

/// Files are in folders below that of the index, or are bundles, and no two are one.
fn check_names(names: &[String]) -> Result<(), String> {
    for (i, name) in names.iter().enumerate() {
        let path = Path::new(name);
        let below = path.components().all(|part| matches!(part, Component::Normal(_)));
        let depth = path.components().count();
        let loose = path.file_name().is_some_and(|name| name == "meta.json") && depth > 1;
        let bundle = path.extension().is_some_and(|extension| extension == "sog");
        if name.contains(['\\', '\0', ':']) || !below || !(loose || bundle) {
            let name: String = name.chars().take(MAX_MESSAGE).collect();
            return Err(format!(
                "filenames {i}, {name:?}, must be the meta.json of a folder below that of the scene, or a .sog"
            ));
        }
    }
    let mut sorted: Vec<&String> = names.iter().collect();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("filenames has {:?} twice", pair[0])),
        None => Ok(()),
    }
}

/// An index of one level, whose files are each in a tile.
pub(super) fn of_one_level<'a>(units: impl Iterator<Item = &'a Unit>) -> Vec<u8> {
    let units: Vec<&Unit> = units.collect();
    let tile = |(i, unit): (usize, &&Unit)| serde_json::json!({"lods": {"0": {"file": i, "offset": 0, "count": unit.gaussians}}});
    let total: u64 = units.iter().map(|unit| unit.gaussians).sum();
    let json = serde_json::json!({
        "version": 1,
        "count": total,
        "counts": [total],
        "lodLevels": 1,
        "filenames": units.iter().map(|unit| &unit.name).collect::<Vec<_>>(),
        "tree": {"children": units.iter().enumerate().map(tile).collect::<Vec<_>>()},
    });
    json.to_string().into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An index of three files and two levels, as splat-transform writes it, with something else in its place.
    fn index(from: &str, to: &str) -> String {
        let text = r#"{"version":1,"asset":{"generator":"it"},"count":17,"counts":[12,5],"lodLevels":2,"environment":"env/meta.json",
"filenames":["0_0/meta.json","1_0/meta.json","0_1/unit.sog"],"tree":{"bound":{"min":[0,0,0],"max":[1,1,1]},"children":[
{"bound":{"min":[0,0,0],"max":[1,1,1]},"lods":{"0":{"file":0,"offset":0,"count":4},"1":{"file":1,"offset":0,"count":5}}},
{"children":[{"lods":{"0":{"file":0,"offset":4,"count":1}}},{"lods":{"0":{"file":2,"offset":0,"count":7}}}]}]}}"#;
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    }

    #[test]
    fn files_are_found_by_level() {
        let unit = |name: &str, gaussians| Unit {
            name: name.into(),
            gaussians,
        };
        let levels = parse(index("", "").as_bytes()).unwrap();
        assert_eq!(levels[0], [unit("0_0/meta.json", 5), unit("0_1/unit.sog", 7)]);
        assert_eq!(levels[1], [unit("1_0/meta.json", 5)]);
        let paths = levels[0].iter().map(Unit::path).collect::<Vec<_>>();
        assert_eq!(paths, [Path::new("0_0"), Path::new("0_1/unit.sog")]);
        // Indices of old writers have no version and no counts.
        assert_eq!(
            parse(
                index(r#""version":1,"#, "")
                    .replace(r#""counts":[12,5],"#, "")
                    .as_bytes()
            ),
            Ok(levels.clone())
        );
        let one = of_one_level(levels[0].iter());
        assert_eq!(parse(&one), Ok(vec![levels[0].clone()]));
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (from, to, reason) in [
            (r#""version":1"#, r#""version":2"#, "version 2; known is 1"),
            (
                r#""lodLevels":2"#,
                r#""lodLevels":0"#,
                "lodLevels is 0, must be 1 to 32",
            ),
            (
                r#""lodLevels":2"#,
                r#""lodLevels":1"#,
                "a tile of level \"1\", must be less than 1",
            ),
            (r#"{"file":2"#, r#"{"file":3"#, "a tile of file 3, there are 3"),
            (r#"{"file":2"#, r#"{"file":1"#, "file 1 is of two levels"),
            (
                r#""offset":4"#,
                r#""offset":5"#,
                "file 0, \"0_0/meta.json\": row 4 is in no tile",
            ),
            (r#""offset":4"#, r#""offset":3"#, "row 3 is in two tiles"),
            ("[12,5]", "[12,6]", "tiles have 5 Gaussians of level 1, counts has 6"),
            (
                "1_0/meta.json",
                "../1/meta.json",
                "filenames 1, \"../1/meta.json\", must be",
            ),
            ("1_0/meta.json", "/tmp/meta.json", "filenames 1"),
            ("1_0/meta.json", "meta.json", "filenames 1"),
            ("1_0/meta.json", "1_0/scene.ply", "filenames 1"),
            (
                "1_0/meta.json",
                "0_0/meta.json",
                "filenames has \"0_0/meta.json\" twice",
            ),
            (r#""tree""#, r#""trees""#, "missing field `tree`"),
            (r#""offset":4"#, r#""offset":-4"#, "invalid value"),
        ] {
            let told = parse(index(from, to).as_bytes()).unwrap_err();
            assert!(told.contains(reason), "{told}, not {reason}");
        }
        let deep = format!("{}{}", r#"{"children":["#.repeat(9999), "]}".repeat(9999));
        let told = parse(
            index(
                r#"{"bound":{"min":[0,0,0],"max":[1,1,1]},"lods""#,
                &format!("{deep},{{\"lods\""),
            )
            .as_bytes(),
        );
        assert!(told.unwrap_err().contains("recursion limit"));
    }
}
