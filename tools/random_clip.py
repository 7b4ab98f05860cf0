#!/usr/bin/env python3
"""Writes a CLIP of the shape of ViT-B/32 with random weights, to time what published weights cost where there are none.

    python3 tools/random_clip.py DIR [--seed 1]
    guardsplat-worker models add random-b32 DIR --sha256 HASH

DIR gets model.safetensors (0.6 GB, in the form of Hugging Face) and config.json; the hash is printed. Needs numpy. The same
seed gives the same bytes. Marks made with it say nothing: it knows nothing.
"""
import argparse
import hashlib
import json
import pathlib

import numpy as np

EMBED = 512
VISION = {"hidden_size": 768, "intermediate_size": 3072, "num_hidden_layers": 12, "num_attention_heads": 12,
          "image_size": 224, "patch_size": 32}
TEXT = {"hidden_size": 512, "intermediate_size": 2048, "num_hidden_layers": 12, "num_attention_heads": 8,
        "max_position_embeddings": 77, "vocab_size": 49408}


def norm(prefix: str, width: int) -> dict[str, tuple[tuple[int, ...], float | str]]:
    """A normalisation: ones and zeros."""
    return {f"{prefix}.weight": ((width,), "ones"), f"{prefix}.bias": ((width,), 0.0)}


def blocks(prefix: str, config: dict) -> dict[str, tuple[tuple[int, ...], float | str]]:
    """Shapes and deviations of a transformer's blocks, as CLIP begins with them."""
    width, inner, layers = config["hidden_size"], config["intermediate_size"], config["num_hidden_layers"]
    residual = width**-0.5 * (2 * layers) ** -0.5
    tensors = {}
    for layer in range(layers):
        at = f"{prefix}.encoder.layers.{layer}"
        for name, deviation in (("q", width**-0.5), ("k", width**-0.5), ("v", width**-0.5), ("out", residual)):
            tensors[f"{at}.self_attn.{name}_proj.weight"] = ((width, width), deviation)
            tensors[f"{at}.self_attn.{name}_proj.bias"] = ((width,), 0.0)
        tensors[f"{at}.mlp.fc1.weight"] = ((inner, width), (2 * width) ** -0.5)
        tensors[f"{at}.mlp.fc1.bias"] = ((inner,), 0.0)
        tensors[f"{at}.mlp.fc2.weight"] = ((width, inner), residual)
        tensors[f"{at}.mlp.fc2.bias"] = ((width,), 0.0)
        tensors |= norm(f"{at}.layer_norm1", width) | norm(f"{at}.layer_norm2", width)
    return tensors


def shapes() -> dict[str, tuple[tuple[int, ...], float | str]]:
    """Every tensor: its shape, and the deviation of its numbers, or "ones"."""
    wide, narrow, patch = VISION["hidden_size"], TEXT["hidden_size"], VISION["patch_size"]
    places = (VISION["image_size"] // patch) ** 2 + 1
    return {
        "logit_scale": ((), "ones"),
        "visual_projection.weight": ((EMBED, wide), wide**-0.5),
        "text_projection.weight": ((EMBED, narrow), narrow**-0.5),
        "vision_model.embeddings.class_embedding": ((wide,), wide**-0.5),
        "vision_model.embeddings.patch_embedding.weight": ((wide, 3, patch, patch), 0.02),
        "vision_model.embeddings.position_embedding.weight": ((places, wide), wide**-0.5),
        "text_model.embeddings.token_embedding.weight": ((TEXT["vocab_size"], narrow), 0.02),
        "text_model.embeddings.position_embedding.weight": ((TEXT["max_position_embeddings"], narrow), 0.01),
        **norm("vision_model.pre_layrnorm", wide),
        **norm("vision_model.post_layernorm", wide),
        **norm("text_model.final_layer_norm", narrow),
        **blocks("vision_model", VISION),
        **blocks("text_model", TEXT),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    arguments.directory.mkdir(parents=True, exist_ok=True)
    config = {"model_type": "clip", "projection_dim": EMBED, "vision_config": VISION, "text_config": TEXT}
    (arguments.directory / "config.json").write_text(json.dumps(config, indent=1))

    random = np.random.Generator(np.random.PCG64(arguments.seed))
    header, end = {}, 0
    for name, (shape, _) in sorted(shapes().items()):
        size = 4 * int(np.prod(shape, dtype=np.int64))
        header[name] = {"dtype": "F32", "shape": list(shape), "data_offsets": [end, end + size]}
        end += size
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    digest = hashlib.sha256()
    with open(arguments.directory / "model.safetensors", "wb") as file:
        def write(data: bytes) -> None:
            digest.update(data)
            file.write(data)

        write(len(text).to_bytes(8, "little") + text)
        for _, (shape, deviation) in sorted(shapes().items()):
            if deviation == "ones":
                numbers = np.ones(shape, np.float32)
            else:
                # Uniform of that deviation: numpy keeps these numbers the same from version to version.
                numbers = (random.random(shape, np.float32) - np.float32(0.5)) * np.float32(deviation * 12**0.5)
            write(np.ascontiguousarray(numbers, "<f4").tobytes())
    print(digest.hexdigest())


if __name__ == "__main__":
    main()
