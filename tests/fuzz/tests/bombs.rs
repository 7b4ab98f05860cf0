//! What inputs as small as a fuzzer's can't show: megabytes that are made to take many times as much in memory.
use guardsplat_fuzz::TARGETS;

/// So much of every bomb: enough for tenfold to be beyond twice the file and 64 MiB.
const SIZE: usize = 12 << 20;

fn run(target: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|t| t.name == target).expect("it is a target");
    (target.run)(bytes);
}

fn filled(start: &str, part: &str, end: &str) -> Vec<u8> {
    filled_to(SIZE, start, part, end)
}

fn filled_to(size: usize, start: &str, part: &str, end: &str) -> Vec<u8> {
    format!("{start}{}{end}", part.repeat(size / part.len())).into_bytes()
}

/// A safetensors file of nothing but a header.
fn safetensors(header: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes(), header].concat()
}

/// The header of a tensor of very many axes: too long to be parsed, and just short enough.
fn axes() -> [Vec<u8>; 2] {
    [SIZE, (1 << 20) - 100].map(|size| {
        let start = "{\"a\":{\"dtype\":\"F32\",\"data_offsets\":[0,4],\"shape\":[";
        safetensors(&filled_to(size, start, "1,", "1]}}"))
    })
}

// One test, since memory is counted for the whole process.
#[test]
fn nothing_takes_many_times_its_size() {
    for file in axes() {
        for target in ["key", "lpips", "clip_weights"] {
            run(target, &file);
        }
    }
    let pose = "\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    for (target, bytes) in [
        ("cameras", filled("[", "0,", "0]")),
        ("cameras", filled("{\"frames\":[", "{},", "{}]}")),
        ("cameras", filled("[{\"fx\":[", "0,", "0]}]")),
        ("cameras", filled("{\"w\":", " ", "\"frames\"}")),
        ("cameras", filled("[{\"fx\":\"", "a", "\"}]")),
        ("cameras", filled("{", "\"a\":0,", "\"frames\":[]}")),
        (
            "cameras",
            filled(
                "{\"fl_x\":9,\"frames\":[",
                &format!("{{{pose}}},"),
                &format!("{{{pose}}}]}}"),
            ),
        ),
        ("ply", filled("ply\nformat ascii 1.0\n", "comment\n", "end_header\n")),
        ("ply", filled("ply\n", "element a 1\n", "end_header\n")),
        ("scene", vec![0; SIZE]),
        ("spz", filled("NGSP\u{3}\0\0\0", "\0", "")),
        ("sog", filled("{\"means\":[", "0,", "0]}")),
        ("lpips_checkpoint", [&b"\x80\x03"[..], &vec![b'}'; SIZE]].concat()),
        ("lpips_checkpoint", [&b"\x80\x03N"[..], &vec![b'\x85'; SIZE]].concat()),
        ("message", filled("", "f", "")),
        ("names", filled("jobs/", "é", "")),
        ("page_token", filled("", "0", "")),
        ("requests", vec![0x0a; SIZE]),
        ("sealed", vec![b'G'; SIZE]),
    ] {
        run(target, &bytes);
    }
}
