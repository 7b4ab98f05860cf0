"""From a sample scene to a verdict, with plots; cells as notebooks have them. Needs matplotlib."""

# %% A scene and a key. Any PLY, SPZ, SOG, glTF or .splat will do; keep the key file secret.
import matplotlib.pyplot as plt
import numpy as np

import guardsplat

guardsplat.sample("scene.ply", gaussians=20_000, seed=1)
key = guardsplat.Key.create(bits=32, seed=7)
key.save("my.key")

# %% The mark. `draft` is quick, and `force` hands it out even if it misses its target. Leave both out for a better one.
steps = []
report = guardsplat.embed(
    "scene.ply", "marked.ply", key=key, message="c0ffee42", preset="draft", force=True, progress=steps.append
)
print(
    f"{report.bit_accuracy:.1%} of bits a view, PSNR {report.psnr_db:.1f} dB, {report.seconds:.0f} s on {report.device}"
)

# %% How it was learned.
learned = [step for step in steps if step.stage == "optimising"]
figure, accuracy = plt.subplots()
accuracy.plot([step.done for step in learned], [step.bit_accuracy for step in learned], label="bits")
accuracy.set(xlabel="step", ylabel="share of right bits")
psnr = accuracy.twinx()
psnr.plot([step.done for step in learned], [step.psnr_db or np.nan for step in learned], "C1", label="PSNR")
psnr.set(ylabel="PSNR in dB")
figure.savefig("learning.png")

# %% The same view of both, and ten times their difference.
before, cameras = guardsplat.render("scene.ply", views=1, return_cameras=True)
after = guardsplat.render("marked.ply", cameras=cameras)
difference = 0.5 + 10 * (after[0] / 255 - before[0] / 255)
figure, axes = plt.subplots(1, 3, figsize=(12, 4))
for axis, picture, title in zip(axes, (before[0], after[0], difference.clip(0, 1)), ("original", "marked", "10 x")):
    axis.imshow(picture)
    axis.set_title(title)
    axis.axis("off")
figure.savefig("comparison.png")

# %% What pictures say. An unmarked scene, or another key, does not match.
pictures = guardsplat.render("marked.ply", views=5)
print("marked:  ", guardsplat.verify(pictures, key=key, message="c0ffee42"))
print("unmarked:", guardsplat.verify("scene.ply", key=key, message="c0ffee42"))
other = guardsplat.Key.create(bits=32, seed=8)
print("other key:", guardsplat.verify("marked.ply", key=other, message="c0ffee42"))
