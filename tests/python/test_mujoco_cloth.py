"""pliant's sheets against MuJoCo 4.0's two-dimensional flex on the same nodes and triangles (`validation.mujoco_cloth`).

* stretched by its own weight a strip takes the same shape: the same membrane, to where MuJoCo's relaxation is stopped;
* bent like a cylinder it sags alike, both with an error of second order against the elastica;
* left to itself a narrow strip of cells that are all cut alike sags more in MuJoCo: a hinge per edge couples bending with twist.
  Of curvatures p, q, r (xx, xy, yy) its density is ½ D (p² + r² + 6 q² + 2 q (p + r)) for D (p² + r² + 2 q²)/2 of a plate
  (the table in docs/cloth.md), of which twisting and curling freely leaves 4/5: compliance 1.25, approached as the first order of the
  mesh, since hinges at the held end and at the free edges are not those of the inside;
* motion: the gap is MuJoCo's error of first order in the step.
"""

import numpy as np
import pytest

pytest.importorskip("mujoco", minversion="4.0")
from validation import mujoco_cloth
from validation.mujoco_cloth import Flex, Sheet

pliant = pytest.importorskip("pliant")

G = 9.81  # m/s²
# the solve in M + h²K stops at the digits that so stiff a membrane leaves; the relaxation goes on until nothing moves
pytestmark = [
    pytest.mark.filterwarnings("ignore:Flex stiffness is too ill-conditioned"),
    pytest.mark.filterwarnings("ignore:Inertia matrix is too close to singular"),
]


def at_rest(sheet):
    """pliant's equilibrium, nodes (n, 3)."""
    model = pliant.loads(mujoco_cloth.scene(sheet))
    return np.asarray(model.equilibrium(model.controls(1)[0]).q).reshape(-1, 3)


def longer(sheet, count=2000):
    """Elongation [m] by its own weight of a strip that does not contract (ν = 0): λ (λ² − 1)/2 = ρ g (L − s)/(Y t)."""
    length = sheet.size[0]
    s = (np.arange(count) + 0.5) / count * length
    load = sheet.area_density * G * (length - s) / (sheet.youngs_modulus * sheet.thickness)
    stretch = np.ones(count)
    for _ in range(20):
        stretch -= (stretch * (stretch**2 - 1.0) / 2.0 - load) / ((3.0 * stretch**2 - 1.0) / 2.0)
    return (stretch - 1.0).mean() * length


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_a_hanging_strip_stretches_alike(nu):
    for rows in (6, 11):
        sheet = Sheet(nodes=(rows, 3), u_axis=(0.0, 0.0, -1.0), poisson_ratio=nu, held=(0, 1, 2))
        ours = at_rest(sheet)
        theirs = Flex(sheet, 5e-3, drag=2.0 * np.sqrt(G / sheet.size[0])).settle(1e-10)
        # 7 mm of stretch
        np.testing.assert_allclose(theirs, ours, atol=1e-6)
        # lumped masses make the linear part exact at the nodes; with ν the held row cannot contract, and the strip is stiffer
        elongation = -ours[-3:, 2].mean() - sheet.size[0]
        assert elongation == pytest.approx(longer(sheet), rel=1e-4) if nu == 0.0 else elongation < longer(sheet)


def cantilever(rows, k, cells, bound, nu=0.0):
    """(pliant's, MuJoCo's) sag/L of a strip held by two rows, the clamp in their middle, and w L³/D = k."""
    length, density, t = 0.3, 0.2, 1e-3
    edge = length / (rows + 0.5)
    young = 12.0 * (1.0 - nu**2) * density * G * length**3 / (k * t**3)
    across = cells + 1
    sheet = Sheet(
        nodes=(rows + 2, across), size=(length + edge / 2, cells * edge), origin=(-edge / 2, 0.0, 0.0),
        poisson_ratio=nu, youngs_modulus=young, held=tuple(range(2 * across)),
    )  # fmt: skip
    theirs = Flex(sheet, 2e-3, drag=3.0 * np.sqrt(G / length), rows=bound, tolerance=1e-10).settle(1e-8)
    return [-x[-across:, 2].mean() / length for x in (at_rest(sheet), theirs)]


@pytest.mark.parametrize(("k", "exact"), [(1.0, 0.12347), (4.0, 0.42516)])
def test_bent_like_a_cylinder_both_sag_as_the_elastica(k, exact):
    coarse, fine = (np.array(cantilever(rows, k, 2, bound=True)) / exact - 1.0 for rows in (8, 16))
    assert np.all(np.abs(coarse) < 0.014) and np.all(np.abs(fine) < 0.004)
    # second order; the exact values have five digits
    assert np.all(coarse / fine > 3.0)
    assert abs(fine[0] - fine[1]) < 0.35 * abs(coarse[0] - coarse[1])


def test_hinges_let_a_narrow_strip_sag_by_a_quarter_more():
    ratios = [theirs / ours for ours, theirs in (cantilever(rows, 0.1, 2, bound=False) for rows in (8, 16, 32))]
    gaps = 1.25 - np.array(ratios)
    assert np.all(gaps > 0.0) and gaps[2] < 0.022
    assert gaps[0] / gaps[1] == pytest.approx(1.8, abs=0.15) and gaps[1] / gaps[2] == pytest.approx(1.9, abs=0.15)
    assert 2.0 * ratios[2] - ratios[1] == pytest.approx(1.25, rel=0.005)


def test_a_square_that_falls_from_two_corners_differs_by_mujocos_step():
    sheet = Sheet(nodes=(7, 7), size=(0.3, 0.3), youngs_modulus=2e3, poisson_ratio=0.2, held=(0, 6))
    model = pliant.loads(mujoco_cloth.scene(sheet, step=5e-4))
    ours = model.rollout(model.initial_state(), model.controls(400), record=False).x[-1][: 3 * 49].reshape(-1, 3)
    gaps = []
    for step in (1e-3, 5e-4, 2.5e-4):
        flex = Flex(sheet, step)
        flex.advance(round(0.2 / step))
        gaps.append(np.abs(flex.positions() - ours).max())
    assert ours[-1, 2] < -0.15 and gaps[0] < 2e-3, gaps
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.15) and gaps[1] / gaps[2] == pytest.approx(2.0, rel=0.15), gaps
