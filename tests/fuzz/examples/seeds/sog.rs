//! SOG: whole files, texts and pictures.
use super::{put, put_damaged};
use guardsplat_fuzz::sog::{META, PICTURES, bundle, webp};

pub fn put_all() {
    let file = bundle(META.as_bytes(), None);
    put_damaged("sog", "whole", &file);
    put("sog", "loose", META);
    put("sog", "index", r#"{"lodLevels": 3, "filenames": []}"#);
    put("scene", "sog", &file);
    put("summary", "sog", &file);
    put("sog_meta", "version-2", META);
    let with = |from: &str, to: &str| {
        assert!(META.contains(from), "{from}");
        META.replace(from, to)
    };
    put("sog_meta", "none", with("\"count\":4", "\"count\":0"));
    put("sog_meta", "too-many", with("\"count\":4", "\"count\":5"));
    put(
        "sog_meta",
        "most",
        with("\"count\":4", "\"count\":18446744073709551615"),
    );
    put("sog_meta", "bands-2", with("\"bands\":1", "\"bands\":2"));
    put("sog_meta", "palette-empty", with("\"count\":64", "\"count\":0"));
    put("sog_meta", "one-file-twice", with("means_u.webp", "means_l.webp"));
    put("sog_meta", "no-file", with("sh0.webp", "sh1.webp"));
    put("sog_meta", "log-large", with("\"maxs\":[1,", "\"maxs\":[1e300,"));
    put("sog_meta", "version-1", VERSION_1);
    put("sog_meta", "version-1-wide", VERSION_1.replace("-9", "-1e38"));
    for (i, name) in PICTURES.iter().enumerate() {
        let labels = if i == 6 {
            webp(2, 2, |i| [70 - i as u8, i as u8, 0, 255])
        } else {
            webp(3, 2, |i| [i as u8; 4])
        };
        put("sog_picture", name, [&[i as u8][..], &labels].concat());
    }
    let usual = webp(2, 2, |i| [i as u8 * 9, 7, 8, 253]);
    put_damaged("sog_picture", "usual", &[&[4u8][..], &usual].concat());
    put(
        "sog_picture",
        "wide",
        [&[5u8][..], &webp(512, 1, |i| [i as u8, 1, 2, 255])].concat(),
    );
}

/// The older form, with steps instead of tables.
const VERSION_1: &str = r#"{"means":{"shape":[4,3],"dtype":"float32","mins":[-1,-2,-3],"maxs":[1,2,3],
"files":["means_l.webp","means_u.webp"]},"scales":{"shape":[4,3],"mins":[-9,-8,-7],"maxs":[1,2,3],"files":["scales.webp"]},
"quats":{"shape":[4,4],"encoding":"quaternion_packed","files":["quats.webp"]},
"sh0":{"shape":[4,1,4],"mins":[-2,-2,-2,-9],"maxs":[2,2,2,9],"files":["sh0.webp"]},
"shN":{"shape":[4,45],"mins":-4,"maxs":4,"quantization":8,"files":["shN_centroids.webp","shN_labels.webp"]}}"#;
