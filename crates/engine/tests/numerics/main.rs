//! The extremes that must be tested, each as a test of its own with the outcome that it must have, in the order of the
//! list: `cargo test --release --workspace --test numerics`. `docs/numerics.md` is this table for people.
mod arithmetic;
mod drift;
mod files;
mod gradients;
mod hand;
mod input;
mod list;
mod machine;
mod marking;
mod poison;
mod scale;
mod scenes;

use list::{ELSEWHERE, LIST};
use machine::On;

/// A line of the table: one test.
struct Line {
    /// A phrase of the list; it may have several lines.
    phrase: &'static str,
    /// What must happen.
    outcome: &'static str,
    /// The name of its test.
    test: &'static str,
    on: On,
}

/// Makes the table, and of each of its lines a test.
macro_rules! lines {
    ($($phrase:literal: $outcome:literal, $test:ident = $on:ident($check:path);)*) => {
        const TABLE: &[Line] = &[
            $(Line { phrase: $phrase, outcome: $outcome, test: stringify!($test), on: On::$on($check) },)*
        ];
        $(
            #[test]
            fn $test() {
                On::$on($check).run();
            }
        )*
    };
}

lines! {
    "0 or 1 Gaussian":
        "none: the background alone and no gradient, and no cameras are placed around nothing",
        input_no_gaussian = Both(input::no_gaussian);
    "0 or 1 Gaussian":
        "one: drawn as the reference draws it",
        input_one_gaussian = Both(input::one_gaussian);
    "0 or 1 Gaussian":
        "one: can be marked",
        input_one_gaussian_is_marked = Both(marking::one_gaussian);
    "0 or 1 Gaussian":
        "in a file: read and written; that there is nothing to see in the former is an error",
        files_of_none_or_one = None(files::none_or_one);
    "no Gaussian in view":
        "the background alone, and a gradient of zeros",
        input_no_gaussian_in_view = Both(input::none_in_view);
    "all behind the camera":
        "the background alone, and a gradient of zeros; so for what is nearer than the near plane",
        input_all_behind_the_camera = Both(input::all_behind);
    "camera at a Gaussian's centre":
        "that Gaussian is not drawn, the others are as they were, to the bit",
        input_camera_at_a_centre = Both(input::camera_at_a_centre);
    "quaternion all zero (whole files of them exist)":
        "not turned: the picture is that of the identity, to the bit",
        input_zero_quaternions = Both(input::zero_quaternions);
    "quaternion all zero (whole files of them exist)":
        "in a file: read, kept, and drawn without a NaN",
        files_of_zero_quaternions = None(files::zero_quaternions);
    "±∞ opacity and −∞ log-scale (legal, clamp as viewers do: ±20 for the logit)":
        "opacity: as ±20, to the bit; transparent, or an alpha of 0.99",
        input_infinite_opacities = Both(input::infinite_opacities);
    "±∞ opacity and −∞ log-scale (legal, clamp as viewers do: ±20 for the logit)":
        "scale: flat, a line or a point, drawn as the reference draws it",
        input_flat_axes = Both(input::flat_axes);
    "NaN anywhere (not legal: a clear error naming the property and the row, or dropped and counted when asked for)":
        "in a scene that was made in memory: that Gaussian is not drawn",
        input_not_numbers = Both(input::not_numbers);
    "NaN anywhere (not legal: a clear error naming the property and the row, or dropped and counted when asked for)":
        "in a file: an error that names property and row; or, asked for, rows left out, counted, and written as they were",
        files_with_nan = None(files::nan_anywhere);
    "log-scale +20":
        "covers the picture evenly; along one axis, a line across it",
        input_vast_scales = Both(input::vast_scales);
    "SH at 1e6":
        "finite pictures, beyond 1; below 0 a colour is 0 and has no gradient",
        input_colours_of_a_million = Both(input::colours_of_a_million);
    "SH degree 0..4":
        "drawn as the reference draws it",
        input_degrees = Both(input::degrees);
    "SH degree 0..4":
        "in a file: read with all coefficients, written back to the byte",
        files_of_all_degrees = None(files::degrees);
    "a wrong `f_rest` count":
        "an error with the count and those that would do",
        files_with_a_wrong_count = None(files::a_wrong_f_rest_count);
    "truncated body":
        "an error with the rows that are there and those promised",
        files_cut_short = None(files::truncated_body);
    "header that promises 10²³ vertices or 400 million property-less ones (an error in constant memory, no panic, no abort)":
        "an error that names the count; in constant memory, as `crates/scene/tests/promises.rs` measures",
        files_that_promise_too_much = None(files::promises);
    "ASCII and big-endian":
        "the same scene, written back in the same encoding",
        files_of_other_encodings = None(files::ascii_and_big_endian);
    "extra properties, comments and row order (all kept in the output)":
        "kept in the output to the byte",
        files_keep_what_is_not_ours = None(files::extras_are_kept);
    "CRLF headers":
        "read, and kept in the output",
        files_with_crlf_headers = None(files::crlf_headers);

    "BCE from logits at ±1e4":
        "value and gradient are those of the formula in double precision, within 1e-6",
        arithmetic_cross_entropy = Both(arithmetic::cross_entropy);
    "decoder fed a zero feature":
        "stays zero when normalised; finite logits and a finite gradient",
        arithmetic_zero_feature = Both(arithmetic::zero_feature);
    "SSIM of two constant images = 1":
        "1 within 1e-5 for black, grey and white, with a finite gradient",
        arithmetic_constant_similarity = Both(arithmetic::constant_similarity);
    "PSNR of identical images":
        "told as identical, `null` and a flag in JSON; a difference in the last bit has a number",
        arithmetic_identical_pictures = None(arithmetic::identical_pictures);
    "JPEG stand-in at quality 1 and 100":
        "finite values within 0 and 1 and finite gradients, of flat pictures and of noise; noise hardly changes at 100",
        arithmetic_jpeg = Both(arithmetic::jpeg);
    "white and black backgrounds (clamp kills gradients)":
        "brighter than white over white, or darker than black: nothing is learned; over black the edges still teach",
        arithmetic_backgrounds = Both(marking::backgrounds);
    "Adam at 10 million Gaussians, where the offset penalty's gradient is ~1e-9 and a common eps of 1e-8 freezes it":
        "a whole step of the rate; an epsilon under 1e-20 is refused",
        arithmetic_adam_in_a_vast_scene = None(arithmetic::adam_in_a_vast_scene);
    "a Gaussian that no view sees keeps a zero offset and never a NaN":
        "no place in the offsets; its colours come out as they went in, to the bit",
        arithmetic_unseen_gaussians = Both(marking::unseen);
    "f16 overflow at 65504":
        "models: refused with the tensor's name when written, and when read; the renderer's weights are below 1",
        arithmetic_half_precision_overflow = Cpu(arithmetic::half_precision_overflow);
    "the loss may not become NaN at any preset: if it does, the job stops with the step and the term named and nothing is written":
        "every term stays finite, also on strange scenes and on white over white",
        arithmetic_loss_of_every_preset = Both(marking::every_preset);
    "the loss may not become NaN at any preset: if it does, the job stops with the step and the term named and nothing is written":
        "poisoned weights: the error names step and term (message, gradient, LPIPS), the file before is untouched",
        arithmetic_poisoned_loss = Cpu(marking::poison);

    "1, 10³, 10⁵, 10⁶ and 10⁷ Gaussians: memory predicted before the work starts and compared with the adapter's limits (`max_buffer_size`)":
        "predicted by arithmetic, admitted or refused to the byte",
        scale_memory_is_predicted = None(scale::memory_is_predicted);
    "1, 10³, 10⁵, 10⁶ and 10⁷ Gaussians: memory predicted before the work starts and compared with the adapter's limits (`max_buffer_size`)":
        "a view whose lists exceed the adapter's largest buffer is refused with both numbers, before they are allocated",
        scale_buffers = Wgpu(scale::buffers);
    "1, 10³, 10⁵, 10⁶ and 10⁷ Gaussians: memory predicted before the work starts and compared with the adapter's limits (`max_buffer_size`)":
        "drawn, and finite: up to 10⁶ on the CPU and 10⁵ on wgpu",
        scale_drawn = Both(scale::drawn);
    "a scene that cannot fit is refused at admission with the numbers in the message":
        "by the head of its file, unread, to the byte, at each of these sizes",
        scale_refused_at_admission = None(scale::refused_at_admission);
    "a scene that cannot fit is refused at admission with the numbers in the message":
        "a small file whose views take more than the adapter's largest buffer: before the first step",
        scale_refused_by_the_adapter = Wgpu(marking::too_much_for_the_adapter);
    "a full-screen splat at 800² touches 2500 tiles: pair counts must not overflow 32 bits":
        "counted in 64 bits: 2²⁸ + and 4.3 · 10⁹ pairs are refused with their number",
        scale_pairs = None(scale::pairs);

    "lower precision and fewer steps are options, so their cost is measured":
        "half weights: pictures within 2⁻¹¹ of the brightest pixel, gradient within 1e-3 (L2), 1e-6 (angle), 1e-4 (bias)",
        drift_half_weights = Cpu(drift::half_weights);

    "the reference against cases computed by hand":
        "one Gaussian at the middle of a pixel, over a background",
        renderer_centre_and_background = None(hand::centre_and_background);
    "the reference against cases computed by hand":
        "0.3 px² of low-pass, and nothing below 1/255",
        renderer_low_pass_and_cutoff = None(hand::low_pass_and_cutoff);
    "the reference against cases computed by hand":
        "alpha is at most 0.99",
        renderer_alpha_is_at_most_099 = None(hand::alpha_is_at_most_099);
    "the reference against cases computed by hand":
        "two that overlap, front to back whatever their rows",
        renderer_order = None(hand::order);
    "the reference against cases computed by hand":
        "degree 1 from both sides and along two axes",
        renderer_direction = None(hand::direction);
    "the reference's gradient against central differences":
        "within 1e-7, for each of the kinds below and each degree",
        renderer_central_differences = None(gradients::of_the_reference);
    "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4":
        "within 1e-4: all shapes",
        renderer_gradients = Both(gradients::of_ordinary);
    "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4":
        "within 1e-4: clamped colours",
        renderer_gradients_of_clamped_colours = Both(gradients::of_clamped);
    "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4":
        "within 1e-4: saturated and faint opacities",
        renderer_gradients_of_saturated_opacities = Both(gradients::of_saturated);
    "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4":
        "within 1e-4: needles",
        renderer_gradients_of_needles = Both(gradients::of_needles);
    "gradients against the reference, by relative L1, L2, cosine and signed bias together, degree 0 to 4":
        "within 1e-4: much smaller than a pixel",
        renderer_gradients_of_small_ones = Both(gradients::of_small);
    "random scenes of legal numbers, the strangest among them":
        "pictures between black and the brightest colour, finite gradients, no panic",
        renderer_nothing_is_corrupted = Both(poison::nothing_is_corrupted);
    "random scenes of legal numbers, the strangest among them":
        "all but vast ones as the reference draws them, within 1e-4 of the largest coefficient",
        renderer_the_reference_agrees = Both(poison::the_reference_agrees);
}

/// Phrases of the list, in order.
fn phrases() -> impl Iterator<Item = &'static str> {
    LIST.iter().flat_map(|(_, phrases)| phrases.iter().copied())
}

#[test]
fn every_line_of_the_list_has_a_test() {
    let place = |phrase: &str| phrases().position(|p| p == phrase);
    for phrase in phrases() {
        let tests = TABLE.iter().filter(|line| line.phrase == phrase).count();
        let elsewhere = ELSEWHERE.iter().any(|(p, _)| *p == phrase);
        assert!(tests > 0 || elsewhere, "{phrase:?} has no test");
    }
    let places: Vec<Option<usize>> = TABLE.iter().map(|line| place(line.phrase)).collect();
    assert!(places.iter().all(Option::is_some), "a line is of no phrase of the list");
    assert!(places.is_sorted(), "the table has another order than the list");
    assert!(ELSEWHERE.iter().all(|(phrase, _)| place(phrase).is_some()));
}

/// The rows of a paragraph's table in `docs/numerics.md`.
fn rows(phrases: &[&str]) -> Vec<String> {
    let mut rows = Vec::new();
    for phrase in phrases {
        let lines = TABLE.iter().filter(|line| line.phrase == *phrase);
        rows.extend(lines.map(|l| format!("| {phrase} | {} | `{}` | {} |", l.outcome, l.test, l.on.devices())));
        let elsewhere = ELSEWHERE.iter().filter(|(p, _)| p == phrase);
        rows.extend(elsewhere.map(|(_, why)| format!("| {phrase} | {why} | - | - |")));
    }
    rows
}

/// Fails with the tables as they must be.
#[test]
fn the_document_has_the_same_tables() {
    const HEAD: &str = "| condition | outcome | test | devices |\n|---|---|---|---|\n";
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/numerics.md");
    let document = std::fs::read_to_string(path).unwrap();
    let tables: Vec<String> = LIST
        .iter()
        .map(|(paragraph, phrases)| format!("## {paragraph}\n\n{HEAD}{}\n", rows(phrases).join("\n")))
        .collect();
    let same = tables.iter().all(|table| document.contains(&format!("{table}\n")));
    assert!(same, "docs/numerics.md has other tables than:\n\n{}", tables.join("\n"));
}
