#!/usr/bin/env python3
"""Makes crates/engine/fixtures/clip: what the reference implementations compute, for crates/engine/tests/clip_parity.rs.

    pip install torch transformers open_clip_torch safetensors numpy
    python3 tools/parity/make_fixtures.py

The committed fixtures were made with torch 2.15.0+cu132 (run on the CPU), transformers 5.23.0 and open_clip_torch 3.3.0.

Two kinds:
- small models of the real architectures, weights and all (`small_*`: config.json, model.safetensors in f16,
  expected.json);
- the real shapes (`full_*.json`: ViT-B/32 of transformers, RN50 of open_clip). Their weights come from a formula
  that the Rust test evaluates too, so only tensor names, shapes and expected features are stored.
"""
import json
import math
from pathlib import Path

import numpy as np
import open_clip
import safetensors.torch
import torch
import transformers

OUT = Path(__file__).resolve().parents[2] / "worker" / "fixtures" / "clip"
MASK = (1 << 64) - 1


def uniform(name, count):
    """`count` values in [-1, 1), exact in f32: splitmix64 seeded with the FNV-1a hash of the name."""
    seed = 0xCBF29CE484222325
    for byte in name.encode():
        seed = ((seed ^ byte) * 0x100000001B3) & MASK
    with np.errstate(over="ignore"):
        z = np.uint64(seed) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(40)).astype(np.float32) / np.float32(1 << 23) - np.float32(1)


def tensor(name, shape):
    """The formula's value of the tensor with this name and shape."""
    count = math.prod(shape)
    if name.endswith("running_var"):
        base, scale = 1.0, 0.5
    elif name.endswith("running_mean"):
        base, scale = 0.0, 0.1
    elif len(shape) == 1 and name.endswith("weight"):
        base, scale = 1.0, 0.1
    elif len(shape) <= 1 or "embedding" in name and len(shape) == 2:
        base, scale = 0.0, 0.05
    else:
        # Variance 4/3 / inputs, so that the picture's signal is not drowned by the biases on its way through.
        base, scale = 0.0, math.sqrt(4.0 * shape[0] / count)
    values = np.float32(base) + np.float32(scale) * uniform(name, count)
    return torch.from_numpy(values.reshape(shape))


def fill(model, half):
    """Gives every weight the formula's value; returns names and shapes."""
    state = {k: v for k, v in model.state_dict().items() if v.is_floating_point() and "attn_mask" not in k}
    for name, value in state.items():
        new = tensor(name, list(value.shape))
        value.copy_(new.half().float() if half else new)
    model.eval()
    return state


def pictures(size):
    """Two pictures, [2, 3, size, size], of values around 0 (as if mean and deviation were removed): 8 x 8 blocks of
    colour, so that averaging over positions does not make them equal, with noise."""
    blocks = uniform("blocks", 2 * 3 * 8 * 8).reshape(2, 3, 8, 8)
    blocks = blocks.repeat(size // 8, axis=2).repeat(size // 8, axis=3)
    noise = uniform("noise", 2 * 3 * size * size).reshape(2, 3, size, size)
    return torch.from_numpy(blocks + np.float32(0.25) * noise)


def rows(values):
    return [[float(v) for v in row] for row in values]


def hugging_face(config, tokens, half):
    """Expected features of a transformers CLIPModel."""
    model = transformers.CLIPModel(config)
    state = fill(model, half)
    size = config.vision_config.image_size
    image = model.visual_projection(model.vision_model(pictures(size)).pooler_output)
    text = model.text_projection(model.text_model(torch.tensor(tokens)).pooler_output)
    return state, {"tokens": tokens, "image_features": rows(image), "text_features": rows(text)}


def openclip(config, tokens, half):
    """Expected features of an open_clip CLIP."""
    model = open_clip.model.CLIP(**config)
    state = fill(model, half)
    image = model.encode_image(pictures(config["vision_cfg"]["image_size"]))
    text = model.encode_text(torch.tensor(tokens))
    return state, {"tokens": tokens, "image_features": rows(image), "text_features": rows(text)}


def write_small(name, config, state, expected):
    folder = OUT / f"small_{name}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "config.json").write_text(json.dumps(config, indent=1, sort_keys=True) + "\n")
    (folder / "expected.json").write_text(json.dumps(expected) + "\n")
    weights = {k: v.half().contiguous() for k, v in state.items()}
    safetensors.torch.save_file(weights, folder / "model.safetensors")


def write_full(name, state, expected):
    expected["tensors"] = {k: list(v.shape) for k, v in state.items()}
    (OUT / f"full_{name}.json").write_text(json.dumps(expected) + "\n")


def small_hugging_face(name, act, eos, tokens):
    text = dict(hidden_size=32, intermediate_size=128, num_hidden_layers=2, num_attention_heads=2, vocab_size=100,
                max_position_embeddings=16, hidden_act=act, eos_token_id=eos, bos_token_id=97, pad_token_id=0)
    vision = dict(hidden_size=48, intermediate_size=96, num_hidden_layers=3, num_attention_heads=4, image_size=64,
                  patch_size=16, hidden_act=act)
    # Written by hand, not by save_pretrained, so that it does not change with transformers' version.
    written = {"text_config": text, "vision_config": vision, "projection_dim": 24}
    config = transformers.CLIPConfig(text_config=dict(text), vision_config=dict(vision), projection_dim=24)
    state, expected = hugging_face(config, tokens, half=True)
    write_small(name, written, state, expected)


def small_open_clip(name, quick_gelu, vision, tokens):
    text = dict(context_length=16, vocab_size=100, width=32, heads=2, layers=2)
    config = dict(embed_dim=24, quick_gelu=quick_gelu, vision_cfg=vision, text_cfg=text)
    state, expected = openclip(config, tokens, half=True)
    write_small(name, config, state, expected)


def resizes():
    """torch's antialiased bilinear resize, enlarging and shrinking."""
    cases = []
    for (h, w), (to_h, to_w) in [((20, 37), (16, 16)), ((7, 5), (16, 16)), ((64, 9), (8, 24)), ((16, 50), (16, 16))]:
        x = torch.from_numpy(uniform(f"resize {h} {w}", h * w).reshape(1, 1, h, w))
        y = torch.nn.functional.interpolate(x, (to_h, to_w), mode="bilinear", antialias=True)
        cases.append({"from": [h, w], "to": [to_h, to_w], "values": y.flatten().tolist()})
    (OUT / "resize.json").write_text(json.dumps(cases) + "\n")


@torch.no_grad()
def main():
    OUT.mkdir(parents=True, exist_ok=True)
    # Ids above the end token, ends that repeat, and padding with the end token tell the two conventions apart.
    legacy = [[97, 5, 6, 7, 99] + [0] * 11, [97, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 99, 0]]
    newer = [[97, 5, 99, 7, 98] + [0] * 11, [97, 1, 99, 98, 5] + [98] * 11]
    small_hugging_face("hf_legacy_end", "quick_gelu", 2, legacy)
    small_hugging_face("hf_end_id", "gelu", 98, newer)
    small_open_clip("openclip_vit", False, dict(image_size=64, layers=2, width=48, patch_size=16, head_width=12), legacy)
    small_open_clip("openclip_rn", True, dict(image_size=64, layers=[2, 1, 1, 2], width=6, head_width=16), newer)
    resizes()

    # The configuration of openai/clip-vit-base-patch32 is what CLIPConfig defaults to, but for the end token.
    config = transformers.CLIPConfig(text_config=dict(eos_token_id=2))
    tokens = [[49406, 320, 1125, 539, 320, 2368, 49407] + [0] * 70, [49406] + list(range(1000, 1075)) + [49407]]
    write_full("vit_b32", *hugging_face(config, tokens, half=False))

    vision = dict(image_size=224, layers=[3, 4, 6, 3], width=64)
    text = dict(context_length=77, vocab_size=49408, width=512, heads=8, layers=12)
    state, expected = openclip(dict(embed_dim=1024, quick_gelu=True, vision_cfg=vision, text_cfg=text), tokens, half=False)
    # The text tower is ViT-B/32's.
    expected = {"image_features": expected["image_features"]}
    write_full("rn50", {k: v for k, v in state.items() if k.startswith("visual.") or k == "logit_scale"}, expected)


if __name__ == "__main__":
    main()
