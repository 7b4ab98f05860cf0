"""Real spherical harmonics, in the order and with the signs of the 3DGS reference."""

import torch


def basis(degree: int, directions: torch.Tensor) -> torch.Tensor:
    """Values `[n, (degree + 1)^2]` for unit vectors `[n, 3]`, up to degree 3."""
    x, y, z = directions.unbind(1)
    xx, yy, zz = x * x, y * y, z * z
    bands = [
        [torch.full_like(x, 0.28209479)],
        [-0.48860251 * y, 0.48860251 * z, -0.48860251 * x],
        [
            1.09254843 * x * y,
            -1.09254843 * y * z,
            0.31539157 * (2 * zz - xx - yy),
            -1.09254843 * x * z,
            0.54627422 * (xx - yy),
        ],
        [
            -0.59004359 * y * (3 * xx - yy),
            2.89061144 * x * y * z,
            -0.45704580 * y * (4 * zz - xx - yy),
            0.37317633 * z * (2 * zz - 3 * xx - 3 * yy),
            -0.45704580 * x * (4 * zz - xx - yy),
            1.44530572 * z * (xx - yy),
            -0.59004359 * x * (xx - 3 * yy),
        ],
    ]
    return torch.stack([value for band in bands[: degree + 1] for value in band], 1)
