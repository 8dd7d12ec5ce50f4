#!/usr/bin/env python3
"""Turns coloured points with cameras (.npz) into a scene and its cameras.

The archive holds `means3d` float [N,3], `colors` uint8 [N,3], `viewmats` [V,4,4] (world to camera; x right, y down,
z forward), `Ks` [V,3,3], `width` and `height`. Each point becomes one isotropic static Gaussian of degree 0: its
standard deviation is --size times the mean distance to its 3 nearest neighbours, its opacity that of --opacity. Far
isolated points would cover the picture, so no deviation exceeds the --quantile of all.

Writes a 3DGS PLY (binary little-endian) and a cameras JSON. Needs nothing but Python 3.8 or newer.
"""

import argparse
import array
import ast
import json
import math
import os
import sys
import zipfile

SH_C0 = 0.28209479177387814
NEIGHBOURS = 3
PROPERTIES = (
    "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
)
TYPE_CODES = {"f4": "f", "f8": "d", "u1": "B", "i1": "b", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


class BadInput(Exception):
    """An input that cannot be converted; the message says where and why."""


def read_array(archive, name):
    """The array `name` of an .npz as (shape, flat array.array)."""
    try:
        data = archive.read(name + ".npy")
    except KeyError:
        raise BadInput(f"array `{name}` is missing") from None
    if data[:6] != b"\x93NUMPY":
        raise BadInput(f"array `{name}`: not in .npy format")
    wide = data[6] >= 2
    start = 12 if wide else 10
    end = start + int.from_bytes(data[8:start], "little")
    try:
        header = ast.literal_eval(data[start:end].decode("latin-1"))
        shape, kind, fortran = tuple(header["shape"]), header["descr"], header["fortran_order"]
    except (SyntaxError, ValueError, KeyError, TypeError) as cause:
        raise BadInput(f"array `{name}`: malformed header ({cause})") from None
    if kind[1:] not in TYPE_CODES or kind[0] not in "<>|":
        raise BadInput(f"array `{name}`: type {kind!r} is not supported")
    if fortran and len(shape) > 1:
        raise BadInput(f"array `{name}`: column-major order is not supported")
    values = array.array(TYPE_CODES[kind[1:]])
    expected = values.itemsize * math.prod(shape)
    if len(data) - end != expected:
        raise BadInput(f"array `{name}`: {len(data) - end} bytes of data, its shape {shape} needs {expected}")
    values.frombytes(data[end:])
    if kind[0] != "|" and (kind[0] == ">") != (sys.byteorder == "big"):
        values.byteswap()
    return shape, values


def require(name, shape, pattern):
    """Compares a shape with a pattern in which -1 stands for any length; returns the shape."""
    if len(shape) != len(pattern) or any(p not in (-1, s) for p, s in zip(pattern, shape)):
        raise BadInput(f"array `{name}`: shape {shape}, expected {pattern} (-1: any)")
    return shape


def neighbour_distances(points):
    """Mean distance of every point to its 3 nearest neighbours.

    Exact: points are binned into cubic cells; the 27 cells around a point hold every neighbour within one cell's
    side. Points whose third neighbour is farther than that wait for a grid of twice the side.
    """
    n = len(points)
    if n <= NEIGHBOURS:
        raise BadInput(f"array `means3d`: {n} points, at least {NEIGHBOURS + 1} are needed")
    low = [min(p[k] for p in points) for k in range(3)]
    high = [max(p[k] for p in points) for k in range(3)]
    extent = max(h - l for l, h in zip(low, high))
    if extent == 0.0:
        raise BadInput("array `means3d`: all points are the same")
    # Far points stretch the box, so the first cells are far smaller than n cells of equal share would be.
    side = extent / (16.0 * n ** (1.0 / 3.0))
    distances = [0.0] * n
    waiting = range(n)
    while waiting:
        waiting = search_cells(points, low, side, extent, waiting, distances)
        side *= 2.0
    return distances


def search_cells(points, low, side, extent, waiting, distances):
    """One grid of `neighbour_distances`; returns the points that a finer cell could not serve."""
    cells = {}
    keys = []
    for i, (x, y, z) in enumerate(points):
        key = (int((x - low[0]) / side), int((y - low[1]) / side), int((z - low[2]) / side))
        keys.append(key)
        cells.setdefault(key, []).append(i)
    around = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    last = side > extent
    still = []
    for i in waiting:
        x, y, z = points[i]
        a, b, c = keys[i]
        squares = []
        for da, db, dc in around:
            for j in cells.get((a + da, b + db, c + dc), ()):
                if j != i:
                    px, py, pz = points[j]
                    squares.append((px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2)
        squares.sort()
        nearest = squares[:NEIGHBOURS]
        if len(nearest) == NEIGHBOURS and (last or nearest[-1] <= side * side):
            distances[i] = sum(map(math.sqrt, nearest)) / NEIGHBOURS
        else:
            still.append(i)
    return still


def write_atomic(path, data):
    """Writes bytes so that `path` never holds half of them."""
    temporary = f"{path}.{os.getpid()}.tmp"
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.remove(temporary)
        raise


def scene(points, colors, opacity, size, quantile):
    """The bytes of the PLY."""
    distances = [size * distance for distance in neighbour_distances(points)]
    most = sorted(distances)[round(quantile * (len(distances) - 1))]
    # Points at the same place have no distance; the smallest positive one stands in.
    least = min((d for d in distances if d > 0.0), default=0.0)
    if least == 0.0:
        raise BadInput("array `means3d`: every point has 3 others at its place")
    logit = math.log(opacity / (1.0 - opacity))
    rows = array.array("f")
    for i, point in enumerate(points):
        dc = [(colors[3 * i + k] / 255.0 - 0.5) / SH_C0 for k in range(3)]
        scale = math.log(max(min(distances[i], most), least))
        rows.extend([*point, 0.0, 0.0, 0.0, *dc, logit, scale, scale, scale, 1.0, 0.0, 0.0, 0.0])
    if sys.byteorder == "big":
        rows.byteswap()
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {name}\n" for name in PROPERTIES) + "end_header\n"
    return header.encode() + rows.tobytes()


def cameras(viewmats, ks, width, height):
    """The cameras JSON as bytes."""
    views = []
    for i in range(len(viewmats) // 16):
        matrix = [float(v) for v in viewmats[16 * i : 16 * i + 16]]
        k = [float(v) for v in ks[9 * i : 9 * i + 9]]
        views.append({
            "name": f"view{i:02}",
            "width": width,
            "height": height,
            "fx": k[0],
            "fy": k[4],
            "cx": k[2],
            "cy": k[5],
            "world_to_camera": [matrix[r : r + 4] for r in range(0, 16, 4)],
        })
    return (json.dumps({"views": views}, indent=1, allow_nan=False) + "\n").encode()


def convert(source, opacity, size, quantile):
    """(PLY bytes, JSON bytes) of the archive `source`."""
    with zipfile.ZipFile(source) as archive:
        shape, means = read_array(archive, "means3d")
        n = require("means3d", shape, (-1, 3))[0]
        shape, colors = read_array(archive, "colors")
        require("colors", shape, (n, 3))
        if colors.typecode != "B":
            raise BadInput("array `colors`: expected uint8")
        shape, viewmats = read_array(archive, "viewmats")
        v = require("viewmats", shape, (-1, 4, 4))[0]
        shape, ks = read_array(archive, "Ks")
        require("Ks", shape, (v, 3, 3))
        width, height = (int(read_array(archive, name)[1][0]) for name in ("width", "height"))
    for i, value in enumerate(means):
        if not math.isfinite(value):
            raise BadInput(f"array `means3d`: row {i // 3} is not finite")
    points = [tuple(means[3 * i : 3 * i + 3]) for i in range(n)]
    return scene(points, colors, opacity, size, quantile), cameras(viewmats, ks, width, height)


def main(arguments=None):
    """The command line; returns the exit code (0 done, 2 usage, 3 bad data)."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("points", help="the .npz archive")
    parser.add_argument("scene", help="the PLY to write")
    parser.add_argument("cameras", help="the cameras JSON to write")
    parser.add_argument("--opacity", type=float, default=0.9, help="between 0 and 1 (default 0.9)")
    parser.add_argument("--size", type=float, default=0.6, help="deviation over neighbour distance (default 0.6)")
    parser.add_argument("--quantile", type=float, default=0.95, help="of the deviations (default 0.95; 1: no limit)")
    options = parser.parse_args(arguments)
    if not 0.0 < options.opacity < 1.0:
        parser.error("--opacity must lie between 0 and 1")
    if not 0.0 < options.size < math.inf:
        parser.error("--size must be positive")
    if not 0.0 <= options.quantile <= 1.0:
        parser.error("--quantile must lie in 0 to 1")
    try:
        ply, views = convert(options.points, options.opacity, options.size, options.quantile)
        write_atomic(options.scene, ply)
        write_atomic(options.cameras, views)
    except (BadInput, OSError, ValueError, zipfile.BadZipFile) as fault:
        print(f"points_to_ply: {options.points}: {fault}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
