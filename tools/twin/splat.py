"""Splatting with frozen geometry: a view is a sparse matrix from the colours of Gaussians to pixels.

The formulas are those of the engine's `splat/project` and `splat/composite`, in single precision, for whole arrays at a time.
"""

from dataclasses import dataclass

import torch

from .harmonics import basis
from .trace import Camera, Trace

NEAR, LOW_PASS, PIXEL, TILE = 0.2, 0.3, 1 / 12, 16
ALPHA_MIN, ALPHA_MAX, LIGHT_MIN = 1 / 255, 0.99, 1e-4


class Scene:
    """What no view changes."""

    def __init__(self, trace: Trace) -> None:
        of = {name: trace.tensors[f"scene.{name}"] for name in ("positions", "rotations", "opacities", "harmonics")}
        self.positions, self.opacities, self.harmonics = of["positions"], of["opacities"], of["harmonics"]
        scales = trace.tensors["scene.log_scales"].clamp(-30, 30).exp()
        self.axes = _rotations(of["rotations"]) * scales[:, None, :]


@dataclass
class View:
    """A view, ready to be drawn with any colours."""

    camera: Camera
    rows: torch.Tensor  # of the Gaussians that are seen
    basis: torch.Tensor  # [seen, coefficients] in their directions
    weights: torch.Tensor  # [pixels, seen], sparse by rows
    transposed: torch.Tensor  # [seen, pixels], sparse by rows
    light: torch.Tensor  # [pixels, 1]: what is left for the background


def _rotations(quaternions: torch.Tensor) -> torch.Tensor:
    norm = quaternions.norm(dim=1, keepdim=True)
    unit = torch.tensor([1.0, 0.0, 0.0, 0.0])
    w, x, y, z = torch.where(norm > 0, quaternions / norm, unit).unbind(1)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return torch.stack(entries, 1).view(-1, 3, 3)


def _project(scene: Scene, camera: Camera) -> tuple[torch.Tensor, ...]:
    """Rows that can be seen, front to back, with their ellipses and the pixels that these may touch."""
    at = scene.positions @ camera.rotation.T + camera.translation
    rows = (at[:, 2] > NEAR).nonzero()[:, 0]
    at = at[rows]
    depth = at[:, 2:]
    size = torch.tensor([camera.width, camera.height])
    limit = 1.3 * size / (2 * camera.focal)
    slope = torch.minimum(torch.maximum(at[:, :2] / depth, -limit), limit)
    along, across = (camera.focal / depth)[:, :, None], -(camera.focal * slope / depth)[:, :, None]
    to_picture = along * camera.rotation[:2] + across * camera.rotation[2]
    m = to_picture @ scene.axes[rows]
    fine = LOW_PASS / camera.times**2
    low_pass = fine + PIXEL * (1 - 1 / camera.times**2)
    plain = (m * m).sum(2)
    xy = (m[:, 0] * m[:, 1]).sum(1)
    minors = torch.linalg.cross(m[:, 0], m[:, 1]).square().sum(1)

    def determinant(widened: float) -> torch.Tensor:
        return widened * widened + widened * plain.sum(1) + minors

    det = determinant(low_pass)
    variance = plain + low_pass
    opacity = scene.opacities[rows]
    if camera.times > 1:
        opacity = opacity * (determinant(fine) / det).sqrt()
    half = 0.5 * (variance[:, 0] - variance[:, 1])
    largest = 0.5 * variance.sum(1) + (half * half + xy * xy).clamp(min=0.1).sqrt()
    radius = (3 * largest.sqrt()).ceil()[:, None]
    mean = camera.focal * at[:, :2] / (depth + 1e-7) + camera.principal - 0.5
    reach = 2 * (255 * opacity).log()
    extent = (reach[:, None].clamp(min=0) * variance).sqrt() + 1e-2
    # The tiles of the reference end a splat; inside of them what it can reach does.
    tiles = (size + TILE - 1) // TILE
    first = TILE * torch.minimum(((mean - radius) / TILE).clamp(min=0).floor(), tiles)
    behind = TILE * torch.minimum(((mean + radius + TILE - 1) / TILE).clamp(min=0).floor(), tiles)
    first = torch.maximum(first, (mean - extent).ceil()).int()
    behind = torch.minimum(torch.minimum(behind, (mean + extent).floor() + 1), size).int()
    seen = (reach >= 0) & (first < behind).all(1)
    order = seen.nonzero()[:, 0]
    order = order[at[order, 2].argsort(stable=True)]
    yy = variance[:, 1]
    shape = torch.stack([(yy / det).sqrt(), xy / yy, yy.rsqrt(), opacity], 1)
    return rows[order], mean[order], shape[order], first[order], behind[order]


def _contributions(mean, shape, first, behind, width: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Pixels, splats and opacities of all pairs that show, pixel by pixel and front to back."""
    spans = behind - first
    counts = spans[:, 0] * spans[:, 1]
    splat = torch.repeat_interleave(torch.arange(len(counts), dtype=torch.int32), counts)
    within = torch.arange(len(splat), dtype=torch.int32) - (counts.cumsum(0) - counts).int()[splat]
    row = within // spans[splat, 0]
    x = first[splat, 0] + within - row * spans[splat, 0]
    y = first[splat, 1] + row
    inverse_x, slope, inverse_y, opacity = shape[splat].unbind(1)
    away_x, away_y = x - mean[splat, 0], y - mean[splat, 1]
    u, v = (away_x - slope * away_y) * inverse_x, away_y * inverse_y
    alpha = (opacity * (-0.5 * (u * u + v * v)).exp()).clamp(max=ALPHA_MAX)
    shown = (alpha >= ALPHA_MIN).nonzero()[:, 0]
    pixel, order = (y * width + x)[shown].sort(stable=True)
    shown = shown[order]
    return pixel, splat[shown], alpha[shown]


def _by_rows(rows: torch.Tensor, columns: torch.Tensor, values: torch.Tensor, size: tuple[int, int]) -> torch.Tensor:
    """A sparse matrix; entries come row by row."""
    ends = torch.bincount(rows, minlength=size[0]).cumsum(0)
    starts = torch.cat([torch.zeros(1, dtype=torch.int32), ends.int()])
    return torch.sparse_csr_tensor(starts, columns.int(), values, size, check_invariants=False)


@torch.no_grad()
def prepare(scene: Scene, camera: Camera) -> View:
    """What is fixed of a view while colours are learned."""
    rows, mean, shape, first, behind = _project(scene, camera)
    pixels = camera.width * camera.height
    pixel, splat, alpha = _contributions(mean, shape, first, behind, camera.width)
    # Light before each splat: the product of what those before it in its pixel leave.
    logarithm = torch.log1p(-alpha.double())
    sums = logarithm.cumsum(0)
    counts = torch.bincount(pixel, minlength=pixels)
    start = counts.cumsum(0) - counts
    before_pixel = torch.cat([torch.zeros(1, dtype=torch.float64), sums])[start]
    before = (sums - logarithm - before_pixel[pixel]).exp().float()
    after = before * (1 - alpha)
    kept = (after >= LIGHT_MIN).nonzero()[:, 0]
    pixel, splat, weight = pixel[kept], splat[kept], (alpha * before)[kept]
    light = torch.ones(pixels).scatter_reduce_(0, pixel.long(), after[kept], "amin")
    # Splats without a weight are left out.
    used = torch.zeros(len(rows), dtype=torch.bool)
    used[splat] = True
    splat = (used.cumsum(0) - 1)[splat]
    rows = rows[used]
    by_splat = splat.argsort(stable=True)
    size = (pixels, len(rows))
    centre = -camera.rotation.T @ camera.translation
    directions = torch.nn.functional.normalize(scene.positions[rows] - centre)
    return View(
        camera,
        rows,
        basis(camera.degree, directions),
        _by_rows(pixel, splat, weight, size),
        _by_rows(splat[by_splat], pixel[by_splat], weight[by_splat], size[::-1]),
        light[:, None],
    )


class Draw(torch.autograd.Function):
    """Pixels `[pixels, 3]` of colours `[seen, 3]`."""

    @staticmethod
    def forward(context, colours: torch.Tensor, view: View) -> torch.Tensor:
        context.view = view
        return view.weights @ colours + view.light * view.camera.background

    @staticmethod
    def backward(context, gradient: torch.Tensor):
        return context.view.transposed @ gradient, None


def colours(view: View, scene: Scene, offsets: torch.Tensor | None, slots: torch.Tensor) -> torch.Tensor:
    """Colours `[seen, 3]`; `offsets` are `[slots + 1, coefficients, 3]`, the last for what is not learned."""
    known = view.basis.shape[1]
    coefficients = scene.harmonics[view.rows, :known]
    if offsets is not None:
        changed = offsets[slots[view.rows]][:, :known]
        coefficients = torch.cat(
            [coefficients[:, : changed.shape[1]] + changed, coefficients[:, changed.shape[1] :]], 1
        )
    return (0.5 + (view.basis[:, :, None] * coefficients).sum(1)).clamp(min=0)


def draw(view: View, scene: Scene, offsets: torch.Tensor | None, slots: torch.Tensor) -> torch.Tensor:
    """The picture `[3, height, width]`."""
    pixels = Draw.apply(colours(view, scene, offsets, slots), view)
    return pixels.T.reshape(3, view.camera.height, view.camera.width)
