"""Depth images and masks of ropes, sheets and what hides them, rendered by MuJoCo without a window.

A rope is drawn as capsules between its nodes, a sheet as a flat-shaded mesh of both sides; truth is what was drawn. MuJoCo draws with
OpenGL: `MUJOCO_GL` is set to EGL (Mesa's runs without a GPU) unless it is set already, and must be before MuJoCo is imported.
"""

import os
from dataclasses import dataclass, field
from functools import cache

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np

from pliant.perception import Camera

WIDTH, HEIGHT = 640, 480


@cache
def unavailable() -> str | None:
    """Why MuJoCo cannot render here; None if it can."""
    try:
        with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8):
            return None
    except Exception as error:  # noqa: BLE001  # it depends on the platform's OpenGL what is raised
        return f"{type(error).__name__}: {error}"


@dataclass
class Scene:
    """What is drawn. `rope` or `sheet` is what the mask shows; the rest hides it, or is the table."""

    rope: np.ndarray | None = None  # nodes (n, 3) [m]
    radius: float = 0.004
    sheet: tuple[np.ndarray, np.ndarray] | None = None  # nodes (n, 3) [m] and triangles (m, 3)
    table: float | None = 0.0  # height [m]
    boxes: list = field(default_factory=list)  # (centre, half sizes) [m]
    balls: list = field(default_factory=list)  # (centre, radius) [m]


def render(scene: Scene, camera: Camera, size=(WIDTH, HEIGHT)) -> tuple[np.ndarray, np.ndarray]:
    """Mask (height, width) and depth (height, width) [m] without noise."""
    width, height = size
    spec = mujoco.MjSpec.from_string(_mjcf(scene, camera, size))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera="eye")
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = 0
        renderer.enable_depth_rendering()
        depth = renderer.render().astype(float)
        renderer.disable_depth_rendering()
        renderer.enable_segmentation_rendering()
        ids = renderer.render()
    shown = [g for g in range(model.ngeom) if model.geom(g).name.startswith("shown")]
    mask = (ids[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)) & np.isin(ids[..., 0], shown)
    return mask, depth


def noisy(mask, depth, rng, depth_noise=1e-3, flips=0.25, missing=0.05):
    """The images as a camera gives them.

    Depths have normal noise [m], a part of them is missing (NaN). A part `flips` of the pixels on both sides of the mask's outline
    changes sides, and one pixel in 10⁴ anywhere; borders stay clear.
    """
    depth = depth + depth_noise * rng.normal(size=depth.shape)
    depth[rng.random(depth.shape) < missing] = np.nan
    near = np.zeros_like(mask)
    for axis in (0, 1):
        for step in (-1, 1):
            near |= np.roll(mask, step, axis) != mask
    out = mask ^ (near & (rng.random(mask.shape) < flips)) ^ (rng.random(mask.shape) < 1e-4)
    out[[0, -1]], out[:, [0, -1]] = False, False
    return out, depth


def _text(values) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _mjcf(scene: Scene, camera: Camera, size) -> str:
    geoms, assets = [], ""
    if scene.rope is not None:
        for k, (a, b) in enumerate(zip(scene.rope[:-1], scene.rope[1:], strict=True)):
            geoms.append(f'<geom name="shown{k}" type="capsule" size="{scene.radius}" fromto="{_text(a)} {_text(b)}"/>')
    if scene.sheet is not None:
        points, triangles = scene.sheet
        if np.linalg.matrix_rank(points - points[0], tol=1e-6) < 3:
            # MuJoCo refuses a mesh that is flat
            points = points.copy()
            points[-1, 2] += 1e-4
        faces = " ".join(str(int(i)) for i in np.ravel(triangles))
        assets = f'<mesh name="sheet" inertia="shell" vertex="{_text(points)}" face="{faces}"/>'
        geoms.append('<geom name="shown" type="mesh" mesh="sheet"/>')
    if scene.table is not None:
        geoms.append(f'<geom type="plane" size="3 3 1" pos="0 0 {scene.table!r}"/>')
    geoms += [f'<geom type="box" pos="{_text(c)}" size="{_text(h)}"/>' for c, h in scene.boxes]
    geoms += [f'<geom type="sphere" pos="{_text(c)}" size="{r!r}"/>' for c, r in scene.balls]
    right, down = camera.rotation[:, 0], camera.rotation[:, 1]
    # MuJoCo looks along −z with y upward
    eye = f'<camera name="eye" pos="{_text(camera.position)}" xyaxes="{_text(right)} {_text(-down)}" '
    eye += f'fovy="{float(np.degrees(2.0 * np.arctan(0.5 * size[1] / camera.fy)))!r}"/>'
    return f"""<mujoco><visual><map znear="0.01" zfar="10"/><quality offsamples="0" shadowsize="0" numslices="64" numstacks="64"/>
  <global offwidth="{size[0]}" offheight="{size[1]}"/></visual>
  <statistic extent="1" center="0 0 0"/><asset>{assets}</asset>
  <worldbody>{eye}{"".join(geoms)}</worldbody></mujoco>"""
