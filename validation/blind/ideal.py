"""The yardstick: a linear score test that knows the noise law and the generator's sensitivities.

    r = project(w(y_read - y_nominal)),  S_j = |P_j r|² ~ χ²_k under the null,  t_j = √S_j

Named: the best candidate, if significant after Holm and (t_j - t_k)/√(2(1-ρ_jk)) > Φ⁻¹(1 - α/m) for all
m rivals, and if nothing significant (and above 5 % of S_j: the test is linear) is left beside it.
It answers in the command's JSON, with linear 90 % intervals and no gains: about what a tool can reach
with small effects, short of refits and of tests of the remainder. Effects outside the library that look
like one cause at 97 % and more (bending friction as internal damping) it does name.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2, norm

from validation.blind import oracle
from validation.blind.cases import Case, readings
from validation.blind.families import FAMILIES


def diagnose(case: Case, y: np.ndarray, y_dot: np.ndarray) -> dict:
    """Verdict on one case, in the JSON of `pliant diagnose --json`."""
    known = oracle.sensitivity(FAMILIES[case.family])
    judge = oracle.Oracle(known, case.noise.phi, case.noise.sigma, case.noise.quantum)
    read = np.stack([reading for reading, _ in readings(case, y, y_dot)])
    r = judge.project(judge.whitened(read - known.y))
    table = oracle.causes(judge.family)
    score = {name: float(np.sum((b.T @ r) ** 2)) for name, b in judge.basis.items()}
    p_value = {name: float(chi2.sf(score[name], judge.basis[name].shape[1])) for name in score}
    if not _significant(p_value):
        return _answer("adequate")
    best = min(p_value, key=lambda name: (p_value[name], -score[name] / judge.basis[name].shape[1]))
    imitation = judge.basis[best] @ (judge.basis[best].T @ r)
    rho = {k: c for k, c in judge.cosines(imitation).items() if k != best}
    gate = norm.ppf(1.0 - oracle.ALPHA / len(rho))
    lead = {k: np.sqrt(score[best]) - np.sqrt(score[k]) for k in rho}
    close = [k for k, c in rho.items() if lead[k] <= gate * np.sqrt(2.0 * max(1.0 - c, 1e-12))]
    left = r - imitation
    rest = {}
    for name, basis in judge.basis.items():
        other = oracle.orthonormal(list((basis - judge.basis[best] @ (judge.basis[best].T @ basis)).T))
        value = float(np.sum((other.T @ left) ** 2))
        small = value < 0.05 * score[best]
        rest[name] = 1.0 if small else float(chi2.sf(value, other.shape[1]))
    if _significant(rest) or chi2.sf(left @ left, left.size) < 1.0e-4:
        return _answer("not_in_library")
    if close:
        return _answer("ambiguous", alternatives=[[table[best][0]], *[[table[k][0]] for k in close]])
    return _answer("named", causes=[_cause(judge, best, table[best], r, score[best])])


def _significant(p_value: dict[str, float]) -> bool:
    """Holm's first step: the smallest p below α/m."""
    return min(p_value.values()) < oracle.ALPHA / len(p_value)


def _cause(judge: oracle.Oracle, key: str, entry: tuple[str, list[str]], r: np.ndarray, score: float) -> dict:
    """Size and 90 % interval of a cause by linear least squares."""
    u = np.stack([judge.u[k] for k in entry[1]], axis=1)
    size, *_ = np.linalg.lstsq(u, r, rcond=None)
    error = norm.ppf(0.95) * np.sqrt(np.diag(np.linalg.pinv(u.T @ u)))
    parameters = []
    for k, x, e in zip(entry[1], size, error, strict=True):
        nominal = 1.0 if k == "scale" else judge.family.nominal.get(k, 0.0)
        ends = [x - e, x, x + e]
        value = [1.0 / max(1.0 / nominal + s, 1e-6) if k == "EA" else nominal + s for s in ends]
        interval = [min(value), max(value)]
        parameters.append({"path": oracle.path_of(k), "estimate": value[1], "unit": "", "interval": interval})
    return {"name": entry[0], "object": key.partition(":")[2] or None, "parameters": parameters, "statistic": score, "rivals": []}


def _answer(verdict: str, causes: list | None = None, alternatives: list | None = None) -> dict:
    return {
        "schema_version": 1, "verdict": verdict, "causes": causes or [], "alternatives": alternatives or [],
        "candidates": [], "gain": [], "remainder": {"significant": verdict == "not_in_library"},
    }  # fmt: skip
