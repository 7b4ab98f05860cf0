#!/usr/bin/env python3
"""Makes the altered scenes of docs/scenes-and-views.md, "Amid surroundings" and "How the kind is found", of PLY files.

    pip install numpy
    tools/scenes/alter.py surround IN OUT SEED      IN amid ground, leaves, a sky and floaters; cameras beside OUT, as .cameras.json
    tools/scenes/alter.py cut-out IN OUT RADIUS     what lies so near the origin
    tools/scenes/alter.py tilt IN OUT DEGREES       turned about x by so much, and about z by half; colours are not turned
    tools/scenes/alter.py floaters IN OUT SEED      with a twentieth as many grey Gaussians scattered about it
    tools/scenes/alter.py glass IN OUT              with opacities of at most 0.12

IN is a binary PLY of 3D Gaussian splatting, all of whose properties are floats; y points down in it.
"""
import json
import sys

import numpy

SH_C0 = 0.28209479177387814
AXES = "xyz"
TURN = 6.2832
FOCUS_IN_VIEW = 800.0


def read(path):
    """Columns by name."""
    with open(path, "rb") as file:
        header = b""
        while not header.endswith(b"end_header\n"):
            header += file.readline()
        lines = [line.split() for line in header.decode().splitlines()]
        names = [line[2] for line in lines if line[0] == "property"]
        assert all(line[1] == "float" for line in lines if line[0] == "property"), "only floats"
        rows = next(int(line[2]) for line in lines if line[0] == "element")
        values = numpy.frombuffer(file.read(4 * rows * len(names)), "<f4").reshape(rows, -1)
    return {name: values[:, i].copy() for i, name in enumerate(names)}


def write(path, scene):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(scene['x'])}\n"
    header += "".join(f"property float {name}\n" for name in scene) + "end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode() + numpy.stack(list(scene.values()), 1).astype("<f4").tobytes())


def joined(scenes):
    return {name: numpy.concatenate([scene[name] for scene in scenes]) for name in scenes[0]}


def chosen(scene, rows):
    return {name: values[rows].copy() for name, values in scene.items()}


def positions(scene):
    return numpy.stack([scene[axis] for axis in AXES], 1)


def coloured(scene, colours):
    """The same colour from all sides."""
    for name in scene:
        if name.startswith("f_rest"):
            scene[name] = scene[name] * 0.0
    for i in range(3):
        scene[f"f_dc_{i}"] = ((colours[:, i] - 0.5) / SH_C0).astype("f4")


def smooth(places, frequency, random):
    """Waves of several lengths in random directions, about -1 to 1."""
    total = 0
    for i in range(6):
        direction = random.normal(size=3)
        direction /= numpy.linalg.norm(direction)
        total = total + numpy.sin(places @ direction * frequency * 1.6**i + random.random() * 6.28) / 1.3**i
    return total / 4


class Surroundings:
    """Blobs around an object, as coarse as they are far."""

    def __init__(self, seed, names):
        self.random = numpy.random.default_rng(seed)
        self.waves = numpy.random.default_rng(seed + 100)
        self.names = names

    def texture(self, places, base, strength, frequency, fine=0.04):
        waves = numpy.stack([smooth(places, frequency, self.waves) for _ in range(2)], 1)
        tones = strength * waves[:, :1] * numpy.array([1, 1, 0.8])
        hues = strength * 0.4 * waves[:, 1:] * numpy.array([1, -0.5, -0.7])
        return numpy.array(base) + tones + hues + fine * self.random.normal(size=(len(places), 3))

    def blobs(self, places, sizes, colours, opacity=3.0, flat=None):
        scene = {name: numpy.zeros(len(places), "f4") for name in self.names}
        for i, axis in enumerate(AXES):
            scene[axis] = places[:, i].astype("f4")
        scales = numpy.log(sizes)[:, None] + self.random.normal(size=(len(places), 3)) * 0.3
        if flat is not None:
            scales[:, flat] -= 1.5
        for i in range(3):
            scene[f"scale_{i}"] = scales[:, i].astype("f4")
        scene["rot_0"][:] = 1
        scene["opacity"][:] = opacity + self.random.normal(size=len(places)) * 0.7
        coloured(scene, numpy.clip(colours, 0.01, 0.99))
        return scene

    def ground(self, height):
        random, count = self.random, 40000
        reach, turn = 12 * random.random(count), random.random(count) * TURN
        bumps = numpy.full(count, height) + 0.03 * random.normal(size=count) * (1 + reach)
        places = numpy.stack([reach * numpy.cos(turn), bumps, reach * numpy.sin(turn)], 1)
        return self.blobs(places, 0.02 + 0.035 * reach, self.texture(places, [0.38, 0.36, 0.25], 0.12, 1.2), flat=1)

    def leaves(self, height):
        random, count = self.random, 40000
        reach, turn = 10 + 12 * random.random(count) ** 2, random.random(count) * TURN
        above = 8 * random.random(count) ** 1.5
        places = numpy.stack([reach * numpy.cos(turn), height - above, reach * numpy.sin(turn)], 1)
        sizes = 0.12 + 0.012 * reach * (1 + random.random(count))
        return self.blobs(places, sizes, self.texture(places, [0.25, 0.36, 0.18], 0.15, 0.8, 0.07), opacity=2.0)

    def sky(self, height):
        random, count, radius = self.random, 6000, 60
        up, turn = random.random(count), random.random(count) * TURN
        level = radius * numpy.sqrt(1 - up * up)
        places = numpy.stack([level * numpy.cos(turn), height - radius * up, level * numpy.sin(turn)], 1)
        return self.blobs(
            places, numpy.full(count, 2.5), self.texture(places, [0.62, 0.72, 0.85], 0.08, 0.05, 0.01), opacity=1.0
        )

    def floaters(self, height):
        random, count = self.random, 4000
        places = random.normal(size=(count, 3)) * 4
        places[:, 1] = height - abs(places[:, 1]) - 0.3
        far = numpy.linalg.norm(places, axis=1) > 2.2
        sizes = numpy.full(count, 0.03)[far] * numpy.exp(random.normal(size=far.sum()) * 0.7)
        return self.blobs(places[far], sizes, self.texture(places[far], [0.4, 0.4, 0.35], 0.1, 1), opacity=-0.5)

    def cameras(self):
        """As captors go around it: three rounds, each higher than the one before."""
        cameras = []
        for i in range(120):
            turn = i / 120 * TURN * 3 + 0.1 * self.random.normal()
            elevation = [0.2, 0.45, 0.75][i * 3 // 120] + 0.05 * self.random.normal()
            distance = 2.6 + 0.3 * self.random.normal()
            level = numpy.cos(elevation)
            eye = distance * numpy.array([level * numpy.cos(turn), -numpy.sin(elevation), level * numpy.sin(turn)])
            forward = -eye / numpy.linalg.norm(eye)
            right = numpy.cross(numpy.array([0, 1, 0.0]), forward)
            right /= numpy.linalg.norm(right)
            rotation = numpy.stack([right, numpy.cross(forward, right), forward], 1)
            cameras.append({
                "id": i, "img_name": f"{i:05}", "width": 1000, "height": 700, "position": eye.tolist(),
                "rotation": rotation.tolist(), "fx": FOCUS_IN_VIEW, "fy": FOCUS_IN_VIEW,
            })
        return cameras


def surround(source, out, seed):
    scene = read(source)
    low, high = (numpy.quantile(positions(scene), share, 0) for share in (0.02, 0.98))
    centre, scale = (low + high) / 2, 2 / numpy.linalg.norm((high - low)[[0, 2]])
    for i, axis in enumerate(AXES):
        scene[axis] = ((scene[axis] - centre[i]) * scale).astype("f4")
    for i in range(3):
        scene[f"scale_{i}"] += numpy.log(scale).astype("f4")
    height = (high[1] - centre[1]) * scale
    around = Surroundings(int(seed), list(scene))
    parts = [around.ground(height), around.leaves(height), around.sky(height), around.floaters(height)]
    write(out, joined([scene, *parts]))
    with open(out.removesuffix(".ply") + ".cameras.json", "w") as file:
        json.dump(around.cameras(), file)


def cut_out(source, out, radius):
    scene = read(source)
    write(out, chosen(scene, numpy.linalg.norm(positions(scene), axis=1) < float(radius)))


def tilt(source, out, degrees):
    scene, angle = read(source), numpy.radians(float(degrees))
    places = positions(scene).astype(float)
    turns = numpy.stack([scene[f"rot_{i}"] for i in range(4)], 1).astype(float)
    for axis, angle in (("x", angle), ("z", angle / 2)):
        c, s = numpy.cos(angle), numpy.sin(angle)
        matrix = {"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]
        places = places @ numpy.array(matrix).T
        a, (b, c, d) = numpy.cos(angle / 2), [numpy.sin(angle / 2) * (axis == other) for other in AXES]
        w, x, y, z = turns.T
        turns = numpy.stack([
            a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
        ], 1)
    scene.update({axis: places[:, i] for i, axis in enumerate(AXES)})
    scene.update({f"rot_{i}": turns[:, i] for i in range(4)})
    write(out, scene)


def floaters(source, out, seed):
    scene, random = read(source), numpy.random.default_rng(int(seed))
    count = len(scene["x"]) // 20
    scattered = chosen(scene, random.integers(0, len(scene["x"]), count))
    reach = 6 * numpy.std(positions(scene), 0).max()
    for axis in AXES:
        scattered[axis] = (scene[axis].mean() + random.normal(size=count) * reach).astype("f4")
    for i in range(3):
        scattered[f"scale_{i}"] += 1
    coloured(scattered, numpy.full((count, 3), 0.5))
    write(out, joined([scene, scattered]))


def glass(source, out):
    scene = read(source)
    scene["opacity"] = numpy.minimum(scene["opacity"], -2)
    write(out, scene)


COMMANDS = {"surround": surround, "cut-out": cut_out, "tilt": tilt, "floaters": floaters, "glass": glass}

if __name__ == "__main__":
    if len(sys.argv) < 4 or sys.argv[1] not in COMMANDS:
        sys.exit(__doc__)
    COMMANDS[sys.argv[1]](*sys.argv[2:])
