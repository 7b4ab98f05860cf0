//! Texts of users of the engine.
use super::{put, put_damaged};

pub fn put_all() {
    put_damaged("cameras", "reference", REFERENCE.as_bytes());
    put_damaged("cameras", "nerf", NERF.as_bytes());
    put(
        "cameras",
        "nerf-frames-first",
        r#"{"frames": [{"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}], "fl_x": 9}"#,
    );
    put(
        "cameras",
        "frames-twice",
        NERF.replacen("\"w\":", "\"frames\": [], \"w\":", 1),
    );
    put(
        "cameras",
        "principal-large",
        REFERENCE.replace("\"fx\"", "\"cx\": 1e300, \"fx\""),
    );
    put(
        "cameras",
        "position-large",
        REFERENCE.replace("[1, 2, 3]", "[1e30, 1e38, -1e38]"),
    );
    put(
        "cameras",
        "width-half",
        REFERENCE.replace("\"width\": 10", "\"width\": 0.5"),
    );
    put("cameras", "angle-zero", NERF.replace("0.69", "0"));
    put("cameras", "deep", "[".repeat(300));
    put(
        "cameras",
        "deep-field",
        format!("[{{\"fx\": {}1{}}}]", "[".repeat(120), "]".repeat(120)),
    );
    put("cameras", "many", format!("[{}0]", "0,".repeat(2000)));
    put("cameras", "none", "[]");
    put("embed_settings", "none", "{}");
    put(
        "embed_settings",
        "some",
        r#"{"steps": 7, "lambda": {"message": 0.5}, "early_stop": null, "adam": {"rate_dc": 0.1}}"#,
    );
    put(
        "embed_settings",
        "stop",
        r#"{"early_stop": {"every": 18446744073709551615, "margin": -1e308}, "balance": null}"#,
    );
    put(
        "embed_settings",
        "tiny",
        r#"{"lambda": {"l1": 1e-46, "ssim": 1e38}, "views": 8, "seed": 18446744073709551615}"#,
    );
    put("embed_settings", "unknown", r#"{"stepz": 7}"#);
    put("embed_settings", "size", r#"{"size": 4096, "enlarged": 16}"#);
    put("embed_settings", "null", r#"{"lambda": null}"#);
    for (name, text) in [
        ("bits-32", "c0ffee42"),
        ("prefix", "0xC0FFEE42"),
        ("bits-3", "7"),
        ("bits-33", "1c0ffee42"),
        ("bits-75", "7ffffffffffffffffff"),
        ("too-large", "8ffffffffffffffffff"),
        ("prefix-only", "0x"),
        ("other-digits", "c0ff\u{664}e42"),
        ("none", ""),
    ] {
        put("message", name, text);
    }
    for (name, text) in [
        // Of c0ffee42 under a key of sevens.
        ("bits-32", "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2"),
        ("no-message", "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FU="),
        ("not-base64", "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul!"),
    ] {
        put("soft_binding", name, text);
    }
    for (name, text) in [
        (
            "by-binding",
            "GET /matches/byBinding?alg=org.guardsplat.sh.1&value=\
             ABEiM0RVZneImaq7zN3u%2F26%2FlQiL7oK86zTNnhnW0FUnSul2&maxResults=5",
        ),
        (
            "by-json",
            "POST /matches/byBinding?maxResults=2\n{\"alg\": \"org.guardsplat.sh.1\", \"value\": \
             \"ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2\"}",
        ),
        ("manifest", "GET /manifests/urn%3Ac2pa%3A1?returnActiveManifest=true"),
        ("algorithms", "GET /services/supportedAlgorithms"),
        ("by-content", "POST /matches/byContent\nply"),
    ] {
        put("resolution", name, text);
    }
}

const REFERENCE: &str = r#"[{"id": 0, "img_name": "a", "width": 10, "height": 20, "position": [1, 2, 3],
"rotation": [[0,0,1],[1,0,0],[0,1,0]], "fy": 30, "fx": 40}]"#;
const NERF: &str = r#"{"camera_angle_x": 0.69, "w": 8, "h": 6, "frames": [{"file_path": "./r_0", "fl_y": 7.5,
"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}, {"file_path": "./r_1", "cx": 3,
"transform_matrix": [[1,0,0,0],[0,0,1,0],[0,-1,0,4],[0,0,0,1]]}]}"#;
