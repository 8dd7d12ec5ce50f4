#!/usr/bin/env python3
"""Clocks of a caliscope session's cameras, from the corners of its calibration board.

  board_clocks.py SESSION -o CORRECTED            then: ivv prepare CORRECTED -o CAPTURE

caliscope takes frames that arrived together for simultaneous and calibrates by that. A camera that hands its frames over
late is off by its delay, which timestamps.csv, the times of arrival, does not tell, and the calibrated poses have bent to
it. This fits to the corners that caliscope found (xy_*.csv) the board's pose in every frame, the poses of all cameras but
the first, and a time offset for each camera, in frames, with the mean of 0: robust least squares (Huber, 2 pixels), the
board moving along the parabola through its places in three frames; frames that are not among three in a row are left out.
Lenses stay as they are.

CORRECTED is a session of the cameras that see the board: camera_array.toml with the fitted poses, timestamps.csv with the
fitted times, and links to the videos. Printed are the offsets with their standard errors, how far the poses were off, and the error of the corners with and
without offsets.
"""

import argparse
import csv
import json
import os
import sys
import tomllib
from pathlib import Path

try:
    import cv2
    import numpy as np
except ImportError as error:
    sys.exit(f"{error}: install OpenCV for Python (tools/setup.sh prepare)")

HUBER = 2.0
CALIBRATED = ("matrix", "distortions", "rotation", "translation")


def rotations(vectors):
    """Rotation matrices, (n, 3, 3), of rotation vectors, (n, 3), radians."""
    return np.array([cv2.Rodrigues(vector)[0] for vector in vectors])


class Session:
    """What caliscope wrote: cameras, corners by frame and camera, times of arrival."""

    def __init__(self, folder, first, last):
        self.array = tomllib.loads((folder / "camera_array.toml").read_text()).get("cameras", {})
        found = sorted(folder.glob("**/xy_*.csv"))
        if len(found) != 1:
            sys.exit(f"{folder}: holds {len(found)} files xy_*.csv, and must hold one, that of its board")
        self.videos = next((at for at in found[0].parents if (at / "timestamps.csv").is_file()), None)
        if self.videos is None:
            sys.exit(f"{found[0]}: has no timestamps.csv in a folder around it")
        with open(self.videos / "timestamps.csv") as file:
            rows = [(int(row["sync_index"]), int(row["cam_id"]), row["frame_time"]) for row in csv.DictReader(file)]
        self.times = [(frame, camera, float(time) if time else None) for frame, camera, time in rows]
        if len({frame for frame, _, time in self.times if time is not None}) < 2:
            sys.exit(f"{self.videos / 'timestamps.csv'}: has the times of fewer than two frames")
        with open(found[0]) as file:
            rows = [row for row in csv.DictReader(file) if first <= int(row["sync_index"]) <= last]
        # The middle of the three frames that tell how the board moves in a frame: itself or a neighbour.
        there = {int(row["sync_index"]) for row in rows}
        middles = {frame + step: frame for step in (1, -1, 0) for frame in there if {frame - 1, frame + 1} <= there}
        rows = [row for row in rows if int(row["sync_index"]) in middles]
        if not rows:
            sys.exit(f"{found[0]}: holds no corners of three frames in a row among those chosen")
        pick = lambda kind, *names: np.array([[kind(row[name]) for name in names] for row in rows])
        frames, ids = (pick(int, name)[:, 0] for name in ("sync_index", "cam_id"))
        self.frames, self.frame = np.unique(frames, return_inverse=True)
        self.middle = np.searchsorted(self.frames, [middles[frame] for frame in self.frames])
        self.ids, self.camera = np.unique(ids, return_inverse=True)
        self.corner = pick(float, "obj_loc_x", "obj_loc_y", "obj_loc_z")
        pixel = pick(float, "img_loc_x", "img_loc_y")
        self.at = np.empty_like(pixel)  # on the plane at depth 1, without distortion
        self.focal = np.empty(len(rows))
        self.rotation, self.translation = [], []
        for index, camera in enumerate(self.ids):
            matrix, distortions, rotation, translation = self.calibration(camera)
            own = self.camera == index
            self.at[own] = cv2.undistortPoints(pixel[own][:, None], matrix, distortions)[:, 0]
            self.focal[own] = matrix[0, 0]
            self.rotation.append(rotation if rotation.ndim == 2 else cv2.Rodrigues(rotation)[0])
            self.translation.append(translation)
        self.rotation, self.translation = np.array(self.rotation), np.array(self.translation)

    def calibration(self, camera):
        """Matrix, distortions, rotation (matrix or vector) and translation of a camera."""
        table = self.array.get(str(camera), {})
        missing = [name for name in CALIBRATED if name not in table]
        if missing:
            sys.exit(f"camera_array.toml: camera {camera} has no {missing[0]}: calibrate it with caliscope")
        if table.get("fisheye"):
            sys.exit(f"camera_array.toml: camera {camera} is a fisheye, which is not read: remove its corners from xy_*.csv")
        return (np.array(table[name], float) for name in CALIBRATED)


class Fit:
    """Least squares. Parameters: 6 per frame (board), 6 per camera but the first, offsets but the last if `with_clocks`."""

    def __init__(self, session, with_clocks):
        self.s, self.n, self.k = session, len(session.frames), len(session.ids)
        self.with_clocks = with_clocks
        self.p = np.zeros(6 * (self.n + self.k - 1) + (self.k - 1) * with_clocks)
        self.board = self.first_poses()
        self.run()

    def first_poses(self):
        """The board's pose in each frame by the camera that sees most of it."""
        s, poses = self.s, []
        for frame in range(self.n):
            best = max(range(self.k), key=lambda camera: np.sum((s.frame == frame) & (s.camera == camera)))
            own = (s.frame == frame) & (s.camera == best)
            if own.sum() < 4:
                sys.exit(f"frame {s.frames[frame]}: no camera sees four corners; choose others with --first and --last")
            _, rotation, translation = cv2.solvePnP(s.corner[own], s.at[own][:, None], np.eye(3), None)
            back = s.rotation[best].T
            poses.append((back @ cv2.Rodrigues(rotation)[0], back @ (translation.ravel() - s.translation[best])))
        return tuple(np.array(parts) for parts in zip(*poses))

    def cameras(self, p):
        change = np.vstack([np.zeros(6), p[6 * self.n:6 * (self.n + self.k - 1)].reshape(-1, 6)])
        return rotations(change[:, :3]) @ self.s.rotation, self.s.translation + change[:, 3:]

    def offsets(self, p):
        free = p[6 * (self.n + self.k - 1):] if self.with_clocks else np.zeros(self.k - 1)
        return np.append(free, -free.sum())

    def residual(self, p):
        """Pixels that the corners are off, (corners, 2)."""
        s, change = self.s, p[:6 * self.n].reshape(-1, 6)
        rotation, translation = self.board[0] @ rotations(change[:, :3]), self.board[1] + change[:, 3:]
        place = lambda frame: np.einsum("nij,nj->ni", rotation[frame], s.corner) + translation[frame]
        middle = s.middle[s.frame]
        before, now, after = place(middle - 1), place(middle), place(middle + 1)
        time = (self.offsets(p)[s.camera] + s.frame - middle)[:, None]
        moved = now + time * (after - before) / 2 + time * time / 2 * (after - 2 * now + before)
        to_camera, origin = self.cameras(p)
        seen = np.einsum("nij,nj->ni", to_camera[s.camera], moved) + origin[s.camera]
        return (seen[:, :2] / seen[:, 2:] - s.at) * s.focal[:, None]

    def cost(self, p):
        error = np.linalg.norm(self.residual(p), axis=1)
        return np.where(error < HUBER, error**2, HUBER * (2 * error - HUBER)).sum()

    def jacobian(self, p, now):
        """By differences. A corner depends on three frames in a row: every third frame is moved at once."""
        step, rows = 1e-6, np.arange(len(now))
        result = np.zeros((len(now), 2, len(p)))
        for part in range(3):
            moved = np.arange(self.n) % 3 == part
            near = self.s.middle[self.s.frame][:, None] + [-1, 0, 1]
            owner = near[moved[near]]
            for axis in range(6):
                q = p.copy()
                q[:6 * self.n].reshape(-1, 6)[moved, axis] += step
                result[rows, :, 6 * owner + axis] = (self.residual(q) - now) / step
        for index in range(6 * self.n, len(p)):
            q = p.copy()
            q[index] += step
            result[:, :, index] = (self.residual(q) - now) / step
        return result.reshape(-1, len(p))

    def run(self):
        """Levenberg and Marquardt, with weights that make the cost Huber's."""
        damping, cost, quiet = 1e-3, self.cost(self.p), 0
        while quiet < 3 and damping < 1e8:
            now = self.residual(self.p)
            error = np.linalg.norm(now, axis=1)
            weight = np.repeat(HUBER / np.maximum(error, HUBER), 2)
            jacobian = self.jacobian(self.p, now)
            normal, slope = jacobian.T @ (weight[:, None] * jacobian), jacobian.T @ (weight * now.ravel())
            normal += 1e-6 * np.eye(len(self.p))
            while damping < 1e8:
                step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -slope)
                new = self.cost(self.p + step)
                if new < cost:
                    quiet = quiet + 1 if cost - new < 1e-5 * cost else 0
                    self.p, cost, damping = self.p + step, new, max(damping / 5, 1e-9)
                    break
                damping *= 4
        self.error = np.linalg.norm(self.residual(self.p), axis=1)
        self.final_cost = cost
        # The median of a Rayleigh distribution is 1.18 of its sigma.
        free = np.linalg.inv(normal)[6 * (self.n + self.k - 1):, 6 * (self.n + self.k - 1):]
        spread = np.append(np.diag(free), free.sum()) if self.with_clocks else np.zeros(self.k)
        self.standard_error = np.sqrt(spread) * np.median(self.error) / 1.1774


def write(session, fit, output):
    """The session with fitted poses and times, into a folder that is new; it has its name when it is whole."""
    partial = output.with_name(f".{output.name}.{os.getpid()}.tmp")
    partial.mkdir(parents=True)
    (rotation, translation), offsets = fit.cameras(fit.p), fit.offsets(fit.p)
    lines = []
    for index, camera in enumerate(session.ids):
        fitted = {"rotation": rotation[index].tolist(), "translation": translation[index].tolist()}
        lines.append(f"[cameras.{camera}]")
        # Numbers, lists and truth values are the same in JSON and TOML.
        lines += [f"{name} = {json.dumps(value)}" for name, value in {**session.array[str(camera)], **fitted}.items()]
    (partial / "camera_array.toml").write_text("\n".join(lines) + "\n")
    by_frame = {}
    for frame, _, time in session.times:
        if time is not None:
            by_frame.setdefault(frame, []).append(time)
    mean = {frame: np.mean(times) for frame, times in by_frame.items()}
    frames = sorted(mean)
    seconds = (mean[frames[-1]] - mean[frames[0]]) / (frames[-1] - frames[0])
    lines = ["sync_index,cam_id,frame_time"]
    for frame, camera, time in session.times:
        if camera in session.ids:
            own = "" if time is None else f"{mean[frame] + seconds * offsets[list(session.ids).index(camera)]:.6f}"
            lines.append(f"{frame},{camera},{own}")
    (partial / "timestamps.csv").write_text("\n".join(lines) + "\n")
    for camera in session.ids:
        video = session.videos / f"cam_{camera}.mp4"
        (partial / video.name).symlink_to(os.path.abspath(video))
    os.rename(partial, output)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("session", type=Path, help="folder of camera_array.toml")
    parser.add_argument("-o", "--output", type=Path, help="folder to make; nothing is written without it")
    parser.add_argument("--first", type=int, default=0, help="first sync_index whose corners are taken")
    parser.add_argument("--last", type=int, default=sys.maxsize, help="last one")
    arguments = parser.parse_args()
    if arguments.output and arguments.output.exists():
        sys.exit(f"{arguments.output}: is there already; choose another or remove it")
    try:
        session = Session(arguments.session, arguments.first, arguments.last)
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"{arguments.session}: is no session that caliscope calibrated: {error!r}")
    if len(session.ids) < 2:
        sys.exit(f"{arguments.session}: only one camera sees the board")
    still, fit = Fit(session, False), Fit(session, True)
    rotation, translation = fit.cameras(fit.p)
    for index, camera in enumerate(session.ids):
        old, new = session.rotation[index], rotation[index]
        moved = np.linalg.norm(new.T @ translation[index] - old.T @ session.translation[index])
        turned = np.degrees(np.linalg.norm(cv2.Rodrigues(new @ old.T)[0]))
        offset, error = fit.offsets(fit.p)[index], fit.standard_error[index]
        print(f"cam_{camera} {offset:8.3f} +- {error:.3f} frames; its pose was off by {1e3 * moved:.1f} mm, {turned:.2f} degrees")
    print(f"{len(session.corner)} corners in {fit.n} frames: median error {np.median(fit.error):.2f} px, Huber's cost "
          f"{fit.final_cost:.0f}; poses fitted without offsets {np.median(still.error):.2f} px, {still.final_cost:.0f}")
    if arguments.output:
        write(session, fit, arguments.output)


if __name__ == "__main__":
    main()
