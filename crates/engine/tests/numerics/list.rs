//! The list: what must be tested, phrase by phrase and in order. The table in `main.rs` is held against it.

/// A paragraph of the list and its phrases.
pub type Paragraph = (&'static str, &'static [&'static str]);

pub const LIST: &[Paragraph] = &[
    (
        "Input",
        &[
            "0 or 1 Gaussian",
            "no Gaussian in view",
            "all behind the camera",
            "camera at a Gaussian's centre",
            "quaternion all zero (whole files of them exist)",
            "±∞ opacity and −∞ log-scale (legal, clamp as viewers do: ±20 for the logit)",
            "NaN anywhere (not legal: a clear error naming the property and the row, or dropped and counted when asked for)",
            "log-scale +20",
            "SH at 1e6",
            "SH degree 0..4",
            "a wrong `f_rest` count",
            "truncated body",
            "header that promises 10²³ vertices or 400 million property-less ones (an error in constant memory, no panic, no abort)",
            "ASCII and big-endian",
            "extra properties, comments and row order (all kept in the output)",
            "CRLF headers",
        ],
    ),
    (
        "Arithmetic",
        &[
            "BCE from logits at ±1e4",
            "decoder fed a zero feature",
            "SSIM of two constant images = 1",
            "PSNR of identical images",
            "JPEG stand-in at quality 1 and 100",
            "white and black backgrounds (clamp kills gradients)",
            "Adam at 10 million Gaussians, where the offset penalty's gradient is ~1e-9 and a common eps of 1e-8 freezes it",
            "a Gaussian that no view sees keeps a zero offset and never a NaN",
            "f16 overflow at 65504",
            "the loss may not become NaN at any preset: if it does, the job stops with the step and the term named and nothing is written",
        ],
    ),
    (
        "Scale",
        &[
            "1, 10³, 10⁵, 10⁶ and 10⁷ Gaussians: memory predicted before the work starts and compared with the adapter's limits (`max_buffer_size`)",
            "a scene that cannot fit is refused at admission with the numbers in the message",
            "a full-screen splat at 800² touches 2500 tiles: pair counts must not overflow 32 bits",
        ],
    ),
    (
        "Drift",
        &["lower precision and fewer steps are options, so their cost is measured"],
    ),
    (
        "Renderer",
        &[
            "the reference against cases computed by hand",
            "the reference's gradient against central differences",
            "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4",
            "random scenes of legal numbers, the strangest among them",
        ],
    ),
];

/// Phrases without a row in the table, and why.
pub const ELSEWHERE: &[(&str, &str)] = &[(
    "lower precision and fewer steps are options, so their cost is measured",
    "fewer steps and smaller views: measured, not held to a limit",
)];
