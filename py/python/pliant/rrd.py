"""Runs as recordings of Rerun (https://rerun.io), files that end in .rrd.

    import pliant.rrd

    pliant.rrd.save(roll, "drape.rrd")     # then: rerun drape.rrd

What is drawn is what a page of `roll.view` draws, and of the same states: a page holds all of it in a documented form
(docs/viewer.md), which is read here. Rerun is not among pliant's dependencies, and imported only when something is saved.

Entities: `scene/rope/NAME` and its `held` nodes, `scene/cloth/NAME`, `scene/body/K` (a frame) with the shapes it carries,
`scene/fixed/NAME`, `scene/gripper/K`, `energy` [J]; positions in m under `scene`, whose own place is the middle of the run. Time is the
timeline `time` [s]. Surfaces of planes are squares as wide as the run.
"""

import base64
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ._pliant import InputError, Rollout

__all__ = ["save"]

GREY, PAINT, RED, LINE = (150, 150, 150), (196, 118, 60), (205, 40, 40), 0.002


def save(roll: Rollout, path: str | os.PathLike[str], *, title: str | None = None) -> str | None:
    """Writes a run as a recording of Rerun to `path`, which ends in .rrd.

    title: name of the recording; the file's name if left out. Long runs are thinned as pages are: what is returned says so, None if
    all states are in it. ImportError if Rerun is not installed; OSError if the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".rrd":
        raise InputError(f"{path} does not end in .rrd, which a recording of Rerun is")
    rerun = _rerun()
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {path.parent} to write {path.name} to")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / f"{path.stem}.html"
        note = roll.view(page, title=title)
        header, numbers = _data(page.read_text(encoding="utf-8"))
    # complete or absent: the file gets its name when it is whole
    whole = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        recording = rerun.RecordingStream(title or path.stem)
        recording.set_log_time_enabled(False)
        recording.save(whole)
        _Writer(rerun, recording, header, numbers).write()
        recording.flush()
        recording.disconnect()
        os.replace(whole, path)
    finally:
        whole.unlink(missing_ok=True)
    return note


def _rerun() -> Any:
    try:
        import rerun
    except ImportError as error:
        text = "recordings are written by Rerun, which is not installed; install it by `pip install rerun-sdk`, or write a page"
        raise ImportError(f"{text} by `roll.view`", name="rerun") from error
    if not hasattr(rerun, "RecordingStream"):
        text = "the installed package `rerun` is another one than Rerun's; install that by `pip install rerun-sdk`"
        raise ImportError(text, name="rerun")
    return rerun


def _data(page: str) -> tuple[dict[str, Any], np.ndarray]:
    """Header and numbers of a page."""
    element = lambda name: re.search(rf'id="{name}">(.*?)</script>', page, re.DOTALL)[1]
    return json.loads(element("header")), np.frombuffer(base64.b64decode(element("numbers")), "<f4")


class _Writer:
    """Logs a page's data, what stands still once and the rest frame by frame."""

    def __init__(self, rerun: Any, recording: Any, header: dict[str, Any], numbers: np.ndarray):
        self.rr, self.to, self.header, self.numbers = rerun, recording, header, numbers
        self.time = self.array(header["time"])
        self.poses = self.array(header["poses"]).reshape(len(self.time), -1, 7)

    def array(self, piece: dict[str, int]) -> np.ndarray:
        return self.numbers[piece["offset"] : piece["offset"] + piece["length"]]

    def points(self, piece: dict[str, int]) -> np.ndarray:
        """(frames, nodes, 3)."""
        return self.array(piece).reshape(len(self.time), -1, 3)

    def write(self) -> None:
        rr, header = self.rr, self.header
        self.to.log("scene", rr.Transform3D(translation=header["center"]), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for solid in header["solids"]:
            self.solid(solid)
        self.bones()
        energy = self.array(header["energy"])
        ropes = [(rope, self.points(rope["positions"])) for rope in header["ropes"]]
        meshes = [(mesh, self.points(mesh["positions"])) for mesh in header["meshes"]]
        grippers = [self.points(piece) for piece in header["points"]]
        for k, time in enumerate(self.time):
            self.to.set_time("time", duration=float(f"{time:.7g}"))  # single precision has so many digits
            self.to.log("energy", rr.Scalars(float(energy[k])))
            for rope, at in ropes:
                self.rope(rope, at[k])
            for mesh, at in meshes:
                self.mesh(mesh, at[k])
            for b, pose in enumerate(self.poses[k]):
                self.to.log(f"scene/body/{b}", rr.Transform3D(translation=pose[:3], quaternion=_xyzw(pose[3:])))
            for g, at in enumerate(grippers):
                self.to.log(f"scene/gripper/{g}", rr.Points3D(at[k], radii=2.0 * LINE, colors=RED))

    def rope(self, rope: dict[str, Any], at: np.ndarray) -> None:
        rr, radius = self.rr, rope["radius"] or LINE
        self.to.log(["scene", "rope", rope["name"]], rr.LineStrips3D([at], radii=radius, colors=PAINT))
        if rope["held"]:
            self.to.log(["scene", "rope", rope["name"], "held"], rr.Points3D(at[rope["held"]], radii=1.5 * radius, colors=RED))

    def mesh(self, mesh: dict[str, Any], at: np.ndarray) -> None:
        rr, triangles = self.rr, np.array(mesh["triangles"], dtype=np.uint32).reshape(-1, 3)
        surface = rr.Mesh3D(vertex_positions=at, triangle_indices=triangles, vertex_normals=_normals(at, triangles), albedo_factor=PAINT)
        self.to.log(["scene", "cloth", mesh["name"]], surface)
        if mesh["held"]:
            self.to.log(["scene", "cloth", mesh["name"], "held"], rr.Points3D(at[mesh["held"]], radii=2.0 * LINE, colors=RED))

    def solid(self, solid: dict[str, Any]) -> None:
        """A shape: in the frame of the body that carries it, or fixed."""
        rr, body, sizes = self.rr, solid["body"], solid["sizes"]
        place = {"quaternions": [_xyzw(solid["quaternion"])], "colors": GREY if body is None else PAINT}
        position = np.array(solid["position"])
        match solid["form"]:
            case "ball":
                shape = rr.Ellipsoids3D(half_sizes=[[sizes[0]] * 3], centers=[position], **place)
            case "capsule":  # Rerun's begin at the centre of one cap
                begin = position - sizes[1] * _axis(solid["quaternion"])
                shape = rr.Capsules3D(radii=[sizes[0]], lengths=[2.0 * sizes[1]], translations=[begin], **place)
            case "cylinder":
                shape = rr.Cylinders3D(radii=[sizes[0]], lengths=[2.0 * sizes[1]], centers=[position], **place)
            case "block":
                shape = rr.Boxes3D(half_sizes=[sizes], centers=[position], **place)
            case "hull":
                at = np.array(solid["hull"]["corners"]) @ _axes(solid["quaternion"]).T + position
                at, flat = _facets(at, np.array(solid["hull"]["triangles"]))
                colour = place["colors"]
                shape = rr.Mesh3D(vertex_positions=at, triangle_indices=flat, vertex_normals=_normals(at, flat), albedo_factor=colour)
            case _:
                reach = self.reach()
                # the plane's own origin may be far from what moves
                normal = _axis(solid["quaternion"])
                shape = rr.Boxes3D(half_sizes=[[reach, reach, 0.0]], centers=[normal * (normal @ position)], **place)
        parent = ["fixed"] if body is None else ["body", body]
        self.to.log(["scene", *parent, solid["name"]], shape, static=True)

    def bones(self) -> None:
        """Lines of bodies without shapes."""
        for b in range(self.poses.shape[1]):
            lines = [[[0.0, 0.0, 0.0], bone["to"]] for bone in self.header["bones"] if bone["body"] == b]
            if lines:
                self.to.log(f"scene/body/{b}/lines", self.rr.LineStrips3D(lines, radii=LINE, colors=PAINT), static=True)

    def reach(self) -> float:
        """Half the width of a plane [m]: what moves stays within."""
        pieces = [self.poses[:, :, :3].reshape(-1, 3)]
        pieces += [self.points(item["positions"]).reshape(-1, 3) for key in ("ropes", "meshes") for item in self.header[key]]
        return 1.2 * float(np.abs(np.concatenate(pieces)).max(initial=0.1))


def _xyzw(quaternion: Any) -> list[float]:
    """Rerun's order of (w, x, y, z)."""
    w, x, y, z = map(float, quaternion)
    return [x, y, z, w]


def _axes(quaternion: Any) -> np.ndarray:
    """The axes of a frame, as columns."""
    w, x, y, z = map(float, quaternion)
    rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows)


def _axis(quaternion: Any) -> np.ndarray:
    """The z axis of a frame."""
    return _axes(quaternion)[:, 2]


def _facets(at: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles with corners of their own, so that their sides look flat."""
    return at[triangles.ravel()], np.arange(triangles.size, dtype=np.uint32).reshape(-1, 3)


def _normals(at: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals of nodes, of the triangles around them by area."""
    a, b, c = (at[triangles[:, k]] for k in range(3))
    out = np.zeros_like(at)
    np.add.at(out, triangles, np.cross(b - a, c - a)[:, None])
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-30)
