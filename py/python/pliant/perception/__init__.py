"""Nodes of ropes and cloth from a mask and a depth image.

    from pliant.perception import Camera, cloth, rope

    eye = Camera(fx, fy, cx, cy, rotation, position)
    found = rope(mask, depth, eye, nodes=21, radius=0.004, length=0.6, start=gripper)
    found.nodes, found.sigma, found.visible         # (21, 3) m, (21,) m, (21,)

Masks come from any segmentation, depths from any camera; nothing here is learned. Hidden stretches of a rope are the equilibrium of a
pliant rod between what is seen. Needs SciPy and scikit-image (`pip install pliant[perception]`), which are imported at the first call.

What is done is what CORD-SLS (arXiv:2606.14188) does before it plans: skeleton, ordered path, depth, spline, equally spaced nodes;
rows of a folded sheet, completed by its known length. Crossings, pieces, obstacles and errors are our own.
"""

from .camera import Camera
from .cloth import ClothEstimate, cloth
from .hidden import hidden_stretch
from .rope import RopeEstimate, rope

__all__ = ["Camera", "ClothEstimate", "RopeEstimate", "cloth", "hidden_stretch", "rope"]
