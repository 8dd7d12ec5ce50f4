"""Makes assets/golden: a small scene with its true pictures and gradients, all in double precision.

    python3 tools/golden.py [FOLDER]    default: assets/golden/room; a minute, with Python 3 and NumPy

This is a second implementation of the formulas that the engine computes, written from the formulas alone: every pixel asks
every Gaussian, without tiles, lists or bounds. Gradients are by complex steps: where x is replaced by x + i h with h = 1e-30,
the imaginary part of the result is h times the derivative, to the last bits of a double, as nothing is subtracted. Choices
(what is drawn, what is clamped) look at real parts alone, so a clamp has no derivative outside its range.
"""

import json
import pathlib
import random
import struct
import sys

import numpy as np

ALPHA_MIN, ALPHA_MAX, T_MIN, BLUR, NEAR = 1.0 / 255.0, 0.99, 1e-4, 0.3, 0.01
STEP = 1e-30
DEGREE = 2
N_SH = (DEGREE + 1) ** 2
STATIC = ["position", "rotation", "scale", "opacity", "sh"]
MOTION = ["velocity", "t_center", "t_scale"]
CHANNELS = {"color": (3,), "alpha": (), "depth": (), "inverse_depth": (), "flow": (2,)}


def spherical_harmonics(d):
    """The real functions of degrees 0 to 2 with the order and signs of 3DGS, for directions [N, 3]: [N, 9]."""
    x, y, z = d.T
    a, b = 0.5 * np.sqrt(3 / np.pi), 0.5 * np.sqrt(15 / np.pi)
    return np.stack(
        [
            np.full_like(x, 0.5 / np.sqrt(np.pi)),
            -a * y,
            a * z,
            -a * x,
            b * x * y,
            -b * y * z,
            0.25 * np.sqrt(5 / np.pi) * (2 * z * z - x * x - y * y),
            -b * x * z,
            0.5 * b * (x * x - y * y),
        ],
        axis=1,
    )


def rotation_matrices(q):
    """Of quaternions (w, x, y, z) [N, 4] of any length: [N, 3, 3]."""
    w, x, y, z = (q / np.sqrt((q * q).sum(axis=1, keepdims=True))).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)


def jacobian(fx, fy, z, u, v):
    """Of the projection, at a depth and ratios x / z and y / z, each [N]: [N, 2, 3]."""
    zero = np.zeros_like(z)
    return np.stack(
        [np.stack([fx / z, zero, -fx * u / z], axis=1), np.stack([zero, fy / z, -fy * v / z], axis=1)], axis=1
    )


def clamped(x, low, high):
    """x where it is within the bounds and the bound, which has no derivative, where it is not."""
    return np.where(x.real < low, low, np.where(x.real > high, high, x))


def at_time(p, view):
    """Centres, opacities and velocities at the time that the camera saw: [N, 3], [N], [N, 3]. The dynamic come last."""
    n_static = len(p["position"]) - len(p["t_center"])
    t = view["time"] + p["time_offset"][0] * view["flow_dt"]
    age = t - p["t_center"]
    still = np.zeros((n_static, 3), dtype=p["velocity"].dtype)
    velocity = np.concatenate([still, p["velocity"]])
    moved = np.concatenate([still, p["velocity"] * age[:, None]])
    fade = np.concatenate([np.ones(n_static), np.exp(-((age / np.exp(p["t_scale"])) ** 2))])
    return p["position"] + moved, fade / (1 + np.exp(-p["opacity"])), velocity


def project(p, view):
    """What each Gaussian is in the picture, a dictionary of arrays over Gaussians."""
    camera = np.array(view["world_to_camera"])
    rotation, translation = camera[:3, :3], camera[:3, 3]
    fx, fy = view["fx"], view["fy"]
    position, opacity, velocity = at_time(p, view)
    x_c = position @ rotation.T + translation
    x, y, z = x_c.T
    u, v = x / z, y / z
    bounds = []
    for f, c, size in [(fx, view["cx"], view["width"]), (fy, view["cy"], view["height"])]:
        margin = 0.3 * size / (2 * f)
        bounds.append((-(c / f + margin), (size - c) / f + margin))
    shape = jacobian(fx, fy, z, clamped(u, *bounds[0]), clamped(v, *bounds[1])) @ rotation
    shape = shape @ (rotation_matrices(p["rotation"]) * np.exp(p["scale"])[:, None, :])
    covariance = shape @ shape.transpose(0, 2, 1) + BLUR * np.eye(2)
    direction = position - (-rotation.T @ translation)
    direction = direction / np.sqrt((direction * direction).sum(axis=1, keepdims=True))
    color = (spherical_harmonics(direction)[:, :, None] * p["sh"]).sum(axis=1) + 0.5
    flow = view["flow_dt"] * (jacobian(fx, fy, z, u, v) @ (velocity @ rotation.T)[:, :, None])[:, :, 0]
    return {
        "centre": np.stack([fx * u + view["cx"], fy * v + view["cy"]], axis=1),
        "covariance": covariance,
        "opacity": opacity,
        "z": z,
        "color": np.where(color.real > 0, color, 0),
        "flow": flow,
    }


def render(p, view):
    """The outputs, [H, W] and [H, W, channels]; and how many Gaussians add to each pixel."""
    g = project(p, view)
    kind = g["z"].dtype
    height, width = view["height"], view["width"]
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    out = {name: np.zeros((height, width) + channels, dtype=kind) for name, channels in CHANNELS.items()}
    passed = np.ones((height, width), dtype=kind)
    finished = np.zeros((height, width), dtype=bool)
    count = np.zeros((height, width), dtype=int)
    # A stable sort: of equal depths the lower index comes first.
    for i in np.argsort(g["z"].real, kind="stable"):
        if g["z"][i].real <= NEAR:
            continue
        (a, b), (_, c) = g["covariance"][i]
        dx, dy = columns - g["centre"][i, 0], rows - g["centre"][i, 1]
        power = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / (2 * (a * c - b * b))
        alpha = g["opacity"][i] * np.exp(-power)
        alpha = np.where(alpha.real > ALPHA_MAX, ALPHA_MAX, alpha)
        adds = ~finished & (alpha.real >= ALPHA_MIN)
        left = passed * (1 - alpha)
        ends = adds & (left.real < T_MIN)
        finished |= ends
        adds &= ~ends
        weight = np.where(adds, alpha * passed, 0)
        passed = np.where(adds, left, passed)
        count += adds
        out["color"] += weight[:, :, None] * g["color"][i]
        out["depth"] += weight * g["z"][i]
        out["inverse_depth"] += weight / g["z"][i]
        out["flow"] += weight[:, :, None] * g["flow"][i]
    out["alpha"] = 1 - passed
    out["color"] += passed[:, :, None] * np.array(view["background"])
    return out, count


def gradients(p, view, cotangents):
    """Of the sum of cotangents times outputs, for every number of every group."""
    found = {}
    for name in p:
        complex_p = {key: value.astype(complex) for key, value in p.items()}
        numbers = complex_p[name].reshape(-1)
        derivative = np.zeros(numbers.size)
        for i in range(numbers.size):
            numbers[i] += 1j * STEP
            out, _ = render(complex_p, view)
            derivative[i] = sum((cotangents[key] * out[key].imag).sum() for key in CHANNELS) / STEP
            numbers[i] = numbers[i].real
        found[name] = derivative.reshape(p[name].shape)
        print(f"gradient of {name}: {np.linalg.norm(derivative):.3e}", file=sys.stderr)
    return found


def scene(rng):
    """A wall and a floor that stay, things before them that stay or move, and Gaussians at the borders of every rule."""
    still, moving = [], []

    def gaussian(position, sizes, opacity, base):
        sh = [[(c - 0.5) / 0.2820947917738781 for c in base]]
        sh += [[rng.uniform(-0.12, 0.12) for _ in range(3)] for _ in range(N_SH - 1)]
        return {
            "position": position,
            "rotation": [rng.gauss(0, 1) for _ in range(4)],
            "scale": [np.log(s) for s in sizes],
            "opacity": opacity,
            "sh": sh,
        }

    def color():
        return [rng.uniform(0.1, 0.9) for _ in range(3)]

    def size(low, high):
        return [rng.uniform(low, high) for _ in range(3)]

    for i in range(12):
        place = [-1.5 + 1.0 * (i % 4), -1.1 + 1.0 * (i // 4), 1.6 + rng.uniform(-0.1, 0.1)]
        still.append(gaussian(place, size(0.25, 0.45), rng.uniform(-0.5, 2.0), color()))
    for i in range(6):
        place = [-1.2 + 0.9 * (i % 3), 1.0, -0.2 + 0.9 * (i // 3)]
        still.append(gaussian(place, [0.4, 0.05, 0.4], rng.uniform(0.0, 2.5), color()))
    for _ in range(8):
        place = [rng.uniform(-0.9, 0.9), rng.uniform(-0.7, 0.7), rng.uniform(-0.4, 0.8)]
        still.append(gaussian(place, size(0.06, 0.25), rng.uniform(-1.0, 2.0), color()))
    # Opaque ones behind each other: alpha is limited, and pixels finish.
    for z in [-0.9, -0.75, -0.6]:
        still.append(gaussian([0.45, -0.3, z], size(0.2, 0.25), 8.0, color()))
    still.append(gaussian([-0.5, 0.3, -0.2], [0.6, 0.008, 0.01], 2.0, color()))  # a needle
    still.append(gaussian([2.1, 0.1, -0.6], size(0.5, 0.6), 1.0, color()))  # beyond the clamp of the Jacobian
    still.append(gaussian([0.0, 0.0, -3.4], size(0.1, 0.2), 3.0, color()))  # behind the camera
    still.append(gaussian([-0.2, -0.5, 0.1], size(0.1, 0.2), -5.8, color()))  # too faint to draw
    still.append(gaussian([0.1, 0.5, 0.3], size(0.15, 0.25), 1.5, [-0.4, 0.5, 1.2]))  # a colour below 0
    for i in range(18):
        place = [rng.uniform(-0.8, 0.8), rng.uniform(-0.6, 0.6), rng.uniform(-0.7, 0.6)]
        g = gaussian(place, size(0.06, 0.22), rng.uniform(-0.5, 2.5), color())
        g["velocity"] = [rng.uniform(-1.5, 1.5) for _ in range(3)]
        g["t_center"] = rng.uniform(0.25, 0.65)
        # The last has faded by the time of the picture.
        g["t_scale"] = np.log(0.02 if i == 17 else rng.uniform(0.1, 0.6))
        moving.append(g)
    p = {name: np.array([g[name] for g in still + moving]) for name in STATIC}
    p |= {name: np.array([g[name] for g in moving]) for name in MOTION}
    p = {name: value.astype(np.float32).astype(np.float64) for name, value in p.items()}
    return p


def camera():
    """A view from before the things, a little from the left and above, with a shifted clock."""
    eye, target, down = np.array([-0.5, -0.35, -2.6]), np.array([0.05, 0.0, 0.3]), np.array([0.0, 1.0, 0.0])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(down, forward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    rows = np.eye(4)
    rows[:3, :3], rows[:3, 3] = rotation, -rotation @ eye
    view = {"name": "room", "width": 36, "height": 28, "fx": 36.5, "fy": 38.0, "cx": 16.8, "cy": 14.6}
    view |= {"world_to_camera": rows.tolist(), "time": 0.4, "flow_dt": 0.04, "time_offset": 0.45}
    return view | {"background": [0.1, 0.25, 0.4]}


def write_ply(file, p):
    """The scene as 3DGS's PLY with velocity, t_center and t_scale; what never fades has a t_scale of infinity."""
    n, n_moving = len(p["position"]), len(p["t_center"])
    still = n - n_moving
    rest = p["sh"][:, 1:, :].transpose(0, 2, 1).reshape(n, -1)
    columns = [p["position"], np.zeros((n, 3)), p["sh"][:, 0, :], rest, p["opacity"][:, None], p["scale"], p["rotation"]]
    columns.append(np.concatenate([np.zeros((still, 3)), p["velocity"]]))
    columns.append(np.concatenate([np.zeros(still), p["t_center"]])[:, None])
    columns.append(np.concatenate([np.full(still, np.inf), p["t_scale"]])[:, None])
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{i}" for i in range(rest.shape[1])] + ["opacity"]
    names += [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)]
    names += [f"velocity_{i}" for i in range(3)] + MOTION[1:]
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {n}\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    file.write_bytes(header.encode() + np.concatenate(columns, axis=1).astype("<f4").tobytes())


def write_tensors(file, tensors, kind):
    """A safetensors file of `<f4` or `<f8`."""
    header, data = {}, b""
    for name in sorted(tensors):
        piece = np.ascontiguousarray(tensors[name]).astype(kind).tobytes()
        span = [len(data), len(data) + len(piece)]
        header[name] = {"dtype": {"<f4": "F32", "<f8": "F64"}[kind], "shape": list(tensors[name].shape), "data_offsets": span}
        data += piece
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    file.write_bytes(struct.pack("<Q", len(text)) + text + data)


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent / "assets/golden/room")
    folder.mkdir(parents=True, exist_ok=True)
    rng = random.Random(5)
    p, view = scene(rng), camera()
    p["time_offset"] = np.array([view["time_offset"]])
    out, count = render(p, view)
    drawn = f"{(count > 0).mean():.0%} of the pixels are covered, by up to {count.max()} Gaussians"
    print(f"{drawn}; the least that passes is {1 - out['alpha'].max():.1e}", file=sys.stderr)
    cotangents = {
        name: np.array([rng.uniform(-1, 1) for _ in range(value.size)]).astype(np.float32).astype(np.float64).reshape(value.shape)
        for name, value in out.items()
    }
    write_ply(folder / "scene.ply", p)
    (folder / "camera.json").write_text(json.dumps({"views": [view]}, indent=1) + "\n")
    write_tensors(folder / "outputs.safetensors", out, "<f8")
    write_tensors(folder / "cotangents.safetensors", cotangents, "<f4")
    write_tensors(folder / "gradients.safetensors", gradients(p, view, cotangents), "<f8")


if __name__ == "__main__":
    main()
