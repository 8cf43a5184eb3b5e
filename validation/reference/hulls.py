"""Corners, edges and faces of the convex hull of points, in the frame of its shape  [m]. NumPy; they are constants of a scene."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

FLAT = 1e-6  # part of the extent by which triangles may be out of a plane that they share


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron."""

    corners: np.ndarray  # (n, 3)
    edges: list  # (ends (2, 3), conormals (2, 3)): of both faces the unit normal within the face, out of it
    normals: np.ndarray  # (faces, 3)
    heights: np.ndarray  # (faces,) of their planes over the origin
    sides: list  # of each face (conormals (m, 3), heights (m,))

    @property
    def extent(self):
        """Largest distance of a corner from the origin."""
        return np.linalg.norm(self.corners, axis=1).max()

    @property
    def half_width(self):
        """Half its least width."""
        return 0.5 * np.min(self.heights - (self.corners @ self.normals.T).min(axis=0))

    def over(self, y):
        """The face whose plane is highest under a point, its height over it, and how far the point is beside the face."""
        height = self.normals @ y - self.heights
        face = len(height) - 1 - int(np.argmax(height[::-1]))
        across, at = self.sides[face]
        return face, height[face], np.max(across @ y - at)


def hull(points):
    """The hull of points (n, 3) that are not in a plane."""
    points = np.asarray(points, dtype=float)
    found = ConvexHull(points)
    size = np.linalg.norm(points, axis=1).max()
    faces = []  # [normal, height, corners]
    for plane, triangle in zip(found.equations, found.simplices, strict=True):
        for face in faces:
            if np.all(np.abs(points[triangle] @ face[0] - face[1]) < FLAT * size) and plane[:3] @ face[0] > 0.9:
                face[2] |= set(triangle)
                break
        else:
            faces.append([plane[:3], -plane[3], set(triangle)])
    edges, sides = [], [[] for _ in faces]
    for i, (n, _, own) in enumerate(faces):
        for j in range(i):
            shared = sorted(own & faces[j][2])
            if len(shared) < 2:
                continue
            ends = points[shared[:2]]
            direction = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            conormals = [np.cross(m, direction) for m in (n, faces[j][0])]
            conormals = [c if c @ other > 0.0 else -c for c, other in zip(conormals, (faces[j][0], n), strict=True)]
            edges.append((ends, np.array(conormals)))
            for k, c in zip((i, j), conormals, strict=True):
                sides[k].append((c, c @ ends[0]))
    normals, heights = np.array([f[0] for f in faces]), np.array([f[1] for f in faces])
    sides = [(np.array([c for c, _ in s]), np.array([h for _, h in s])) for s in sides]
    return Hull(points[sorted(set().union(*(f[2] for f in faces)))], edges, normals, heights, sides)
