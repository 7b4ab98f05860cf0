"""Marks what a training script exports, in memory: the parameters as gsplat's trainers keep them."""

import guardsplat

# Stands for `splats` of a trainer: a dictionary, or ParameterDict, of arrays or tensors. Scales are logarithms and
# opacities logits, as they are learned.
guardsplat.sample("trained.ply", gaussians=20_000, seed=2)
splats = guardsplat.load_gaussians("trained.ply")
key = guardsplat.Key.create(bits=32, seed=7)

# The three lines before the export. Training cameras say where viewers are: `cameras=[guardsplat.Camera(viewmat, K, w, h)]`.
marked = guardsplat.embed_gaussians(**splats, key=key, message="c0ffee42", preset="draft", force=True)
splats["sh0"], splats["shN"] = marked.sh0, marked.shN
print(f"{marked.report.bit_accuracy:.1%} of bits a view, PSNR {marked.report.psnr_db:.1f} dB")

# The export of the trainer, or this one. Then pictures of what was exported say whose it is.
guardsplat.save_gaussians("exported.ply", **splats)
pictures = guardsplat.render("exported.ply", views=5)
print(guardsplat.verify(pictures, key=key, message="c0ffee42"))
