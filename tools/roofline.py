#!/usr/bin/env python3
"""What a step of `standard` would take on a card if nothing but its arithmetic and its memory counted, and what the host needs.

    python3 tools/roofline.py [--visible 101172 --pairs 132211 --gaussians 101407 --columns 48]

`visible` and `pairs` are Gaussians and (Gaussian, tile) pairs of a view of 160 px, as `--example bench_views` prints them;
`columns` are the numbers that are learned of a Gaussian: 3 of degree 0, 48 of degree 3. Prints Markdown. FLOPs are counted
by hand from the kernels; a pair is counted for all pixels of its tile, though tiles stop where they are opaque.
"""
import argparse

# FLOP/s in single precision without matrix units, bytes/s of memory, bytes/s of PCIe: data sheets.
CARDS = {
    "H200": (67e12, 4.8e12, 50e9),
    "RTX 4090": (82e12, 1.0e12, 25e9),
    "L4": (30e12, 0.3e12, 25e9),
}
VIEWS, FRESH, SIDE, TILE = 8, 2, 160, 256
PIXELS = VIEWS * SIDE * SIDE
SINES = 34.4e6  # Of all views, in each direction (docs/performance.md).


def kernels(visible: float, pairs: float, gaussians: float, columns: float) -> dict[str, tuple[float, float]]:
    """FLOPs and bytes of each part of a step."""
    terms = columns / 3
    words = 4 * (8 * visible + 2 * pairs)  # A packed view: six of a splat, its slots' place and its row; lists.
    splat = 24 + 12 + 4  # What a tile loads of a pair: shape, colour, index.
    lights = 4 * (VIEWS * pairs + PIXELS)  # What pixels have left before each chunk of a tile's list.
    return {
        "views side by side": (0, VIEWS * 2 * words),
        "colours": (VIEWS * visible * (40 + 15 * terms), VIEWS * visible * (8 * columns + 24 + 16)),
        "drawing": (VIEWS * pairs * TILE * 28, VIEWS * pairs * (splat + 12) + 24 * PIXELS + lights),
        "gradient to splats": (VIEWS * pairs * TILE * 22, VIEWS * pairs * (splat + 12) + 12 * PIXELS + lights),
        "gradient to coefficients": (
            VIEWS * visible * (40 + 6 * terms) + VIEWS * pairs * 3,
            VIEWS * (pairs * 16 + visible * 40) + gaussians * 4 * columns,
        ),
        "likeness": (PIXELS * 3 * 22 * 16, PIXELS * 3 * 4 * 40),
        "tower": (SINES * 20 + PIXELS * 1.4 * 125 * 8, PIXELS * 3 * 4 * 20),
        "optimiser": (gaussians * columns * 12, gaussians * columns * 4 * 8),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--visible", type=float, default=101_172)
    parser.add_argument("--pairs", type=float, default=132_211)
    parser.add_argument("--gaussians", type=float, default=101_407)
    parser.add_argument("--columns", type=float, default=48)
    parser.add_argument("--launches", type=float, default=37)
    parser.add_argument("--launch-us", type=float, default=60, help="of the host for one: launching by a step's log, over launches")
    parser.add_argument("--copy", type=float, default=5e9, help="bytes a second that the host copies to where the card fetches them")
    a = parser.parse_args()
    parts = kernels(a.visible, a.pairs, a.gaussians, a.columns)
    sent = FRESH * 4 * (8 * a.visible + 2 * a.pairs)
    print("| | GFLOP | MB | " + " | ".join(f"{card}, ms" for card in CARDS) + " |\n|---|---|---|" + "---|" * len(CARDS))
    sums = dict.fromkeys(CARDS, 0.0)
    for name, (flops, size) in parts.items():
        cells = []
        for card, (speed, memory, _) in CARDS.items():
            ms = 1e3 * max(flops / speed, size / memory)
            sums[card] += ms
            cells.append(f"{ms:.2f}")
        print(f"| {name} | {flops / 1e9:.2f} | {size / 1e6:.0f} | " + " | ".join(cells) + " |")
    bus = {card: 1e3 * sent / speed for card, (_, _, speed) in CARDS.items()}
    print(f"| fresh views over PCIe | | {sent / 1e6:.0f} | " + " | ".join(f"{bus[card]:.2f}" for card in CARDS) + " |")
    print("| **the card, all** | | | " + " | ".join(f"**{sums[card] + bus[card]:.1f}**" for card in CARDS) + " |")
    host = a.launches * a.launch_us / 1e3 + 1e3 * sent / a.copy
    print(f"\nThe host: {a.launches:.0f} launches of {a.launch_us:.0f} µs and {sent / 1e6:.0f} MB copied: {host:.1f} ms.")


if __name__ == "__main__":
    main()
