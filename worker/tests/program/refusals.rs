//! Bad input: an error that names what is wrong, and nothing written.
use guardsplat_engine::clip::Precision;
use guardsplat_engine::testing::tiny::{cpu, model};

use super::{Bench, files, write};

#[test]
fn bad_input_is_told_clearly_and_leaves_nothing() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 50 --sh-degree 0", 0);
    bench.exits("key create --bits 8 --seed 7 -o k.key --device cpu", 0);
    write(&bench.path("text.ply"), "this is no scene\n");
    let before = files(bench.0.path());
    for (line, needle) in [
        (
            "embed text.ply out.ply --key k.key --message 5c --device cpu",
            "text.ply",
        ),
        (
            "embed none.ply out.ply --key k.key --message 5c --device cpu",
            "none.ply",
        ),
        (
            "embed in.ply no/out.ply --key k.key --message 5c --device cpu",
            "no/out.ply",
        ),
        (
            "embed in.ply in.ply --key k.key --message 5c --device cpu",
            "is the input",
        ),
        (
            "embed in.ply out.ply --key k.key --message 5c5c --device cpu",
            "longer than the key's 8 bits",
        ),
        ("embed in.ply out.ply --key k.key --message 5g --device cpu", "'g'"),
        (
            "embed in.ply out.ply --key text.ply --message 5c --device cpu",
            "key text.ply",
        ),
        (
            "embed in.ply out.ply --key k.key --message 5c --device cuda",
            "auto, wgpu or cpu",
        ),
        (
            "embed in.ply out.ply --key k.key --message 5c --preset fast",
            "draft, standard, robust, thorough or paper",
        ),
        (
            "embed in.ply out.ply --key k.key --message 5c --device cpu --size 4",
            "size: 4 is outside 16",
        ),
        (
            "embed in.ply out.ply --key k.key --message 5c --device cpu --clip other",
            "model other",
        ),
        ("key create --bits 0 -o new.key --device cpu", "0 is outside 1 to 150"),
        (
            "key create --bits 151 -o new.key --device cpu",
            "151 is outside 1 to 150",
        ),
        ("verify none.png --key k.key --device cpu", "none.png"),
        ("verify in.ply --key k.key --message 5c5c --device cpu", "longer"),
        ("render text.ply views --views 1 --device cpu", "text.ply"),
        ("render in.ply views --cameras text.ply --device cpu", "text.ply"),
        ("sample new.ply --gaussians 0", "--gaussians"),
        ("sample new.ply --sh-degree 5", "--sh-degree"),
        ("models verify other", "models add"),
        ("mark in.ply", "unrecognized subcommand"),
    ] {
        let told = bench.fails(line);
        assert!(told.contains(needle), "{line}: {told}");
        assert_eq!(files(bench.0.path()), before, "{line}");
    }
    // Another CLIP under the same name.
    std::fs::remove_file(bench.path("clip/model.safetensors")).unwrap();
    let (config, _) = model(&cpu());
    use guardsplat_engine::clip::{ClipModel, Parts};
    ClipModel::init(&config, Parts::Both, &cpu().device, 6)
        .save(&bench.path("clip/model.safetensors"), Precision::F32)
        .unwrap();
    let told = bench.fails("verify in.ply --key k.key --message 5c --device cpu");
    assert!(told.contains("key k.key: it belongs to the CLIP"), "{told}");
}
