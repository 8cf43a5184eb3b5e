"""What could be known of a hidden effect: its size against the noise, its rivals, and whether the naming rule allows a name.

    s_k = Δy/Δθ_k            differences of the generator, each record's beginning included
    u_k = M w(s_k)           whitened by the true noise; M projects off the beginnings and the free parameters, which any tool refits
    u   = M w(y(θ) - y(0))   of a whole effect, beginnings and free parameters refitted by Gauss-Newton steps
    λ   = |u|²,    ρ_j = |P_j u|/|u|     P_j on the span of candidate j

All setups are judged by this; see `system.Setup`.
"""

from __future__ import annotations

import hashlib
import inspect

import numpy as np
from scipy.stats import chi2, norm

from validation.blind.noise import Noise, whiten
from validation.blind.system import Changes, Setup

ALPHA = 0.05
CLOSE = 0.9  # cosine from which an imitation is simulated at its size
IMITATIONS = 4  # steps to the best imitation, at most
HIDDEN = 0.03  # part of an effect that must remain beside what is refitted, for it to be tested at all


def orthonormal(columns: list[np.ndarray], least: float = 1e-6) -> np.ndarray:
    """Orthonormal basis of a span; columns below `least` of the largest singular value dropped."""
    left, values, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return left[:, values > least * max(values[0], 1e-300)]


class Judge:
    """Whitened, projected directions of a setup under one noise, on its fitted records."""

    def __init__(self, setup: Setup, noise: Noise) -> None:
        self.setup, self.phi, self.sigma = setup, noise.phi, noise.spread(setup.sigma)
        self.records = setup.fitted
        wanted: dict[str, Changes] = {"": {}}
        wanted |= {f"start:{k}": {f"start:{k}": step} for k, step in enumerate(setup.start_steps)}
        wanted |= {knob: {knob: setup.knobs[knob].step} for knob in setup.free}
        for cause in setup.causes.values():
            if cause.points:
                wanted |= {f"{cause.key}#{i}": point for i, point in enumerate(cause.points)}
            else:
                wanted |= {knob: {knob: setup.knobs[knob].step} for knob in cause.knobs}
        keys = list(wanted)
        read = self.cached(keys, list(wanted.values()))
        self.zero = read[0]
        slope = {key: [a - b for a, b in zip(y, self.zero, strict=True)] for key, y in zip(keys, read, strict=True)}
        self.start = []  # of every record: basis of its beginning, and what gives its coefficients
        for i in range(len(self.records)):
            columns = [self.white(slope[f"start:{k}"][i]) / setup.start_steps[k] for k in range(setup.starts)]
            self.start.append(np.linalg.qr(np.stack(columns, axis=1)) if columns else None)
        self.free = [self.off_start(slope[k]) / setup.knobs[k].step for k in setup.free]
        self.shared = np.linalg.qr(np.stack(self.free, axis=1)) if self.free else None
        alone = [knob for c in setup.causes.values() if not c.points for knob in c.knobs if all(np.isfinite(x).all() for x in slope[knob])]
        self.u = {knob: self.project(slope[knob]) / setup.knobs[knob].step for knob in alone}
        self.basis: dict[str, list[np.ndarray]] = {}
        for cause in setup.causes.values():
            groups = [[f"{cause.key}#{i}"] for i in range(len(cause.points))] or [list(cause.knobs)]
            seen = [own for own in (self.spanned([slope[k] for k in group]) for group in groups) if own is not None]
            if seen:
                self.basis[cause.key] = seen
        self.look_at_scene()

    def look_at_scene(self) -> None:
        """What a fitter's step and interpolation make of the true laws."""
        read = self.setup.readings([(r, {}) for r in self.records], "scene")
        self.mismatch = self.project([a - b for a, b in zip(read, self.zero, strict=True)])

    def cached(self, keys: list[str], changes: list[Changes]) -> list[list[np.ndarray]]:
        """Readings of all fitted records under each change, kept where the setup is the same for all seeds."""
        setup, n = self.setup, len(self.records)
        path = None
        if setup.cache is not None:
            source = repr((setup.system, changes, setup.sigma if not setup.sources else getattr(setup, "family", ""))) + "".join(inspect.getsource(m) for m in setup.sources)
            path = setup.cache / f"{setup.system}-{hashlib.sha256(source.encode()).hexdigest()[:12]}.npz"
            if path.exists():
                data = np.load(path)
                return [[data[f"{i}_{r}"] for r in range(n)] for i in range(len(keys))]
        read = setup.readings([(r, change) for change in changes for r in self.records])
        out = [read[i * n : (i + 1) * n] for i in range(len(keys))]
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(path, **{f"{i}_{r}": out[i][r] for i in range(len(keys)) for r in range(n)})
        return out

    def white(self, x: np.ndarray) -> np.ndarray:
        return whiten(x, self.phi, self.sigma)

    def off_start(self, change: list[np.ndarray]) -> np.ndarray:
        """Whitened readings of all records in a row, with their beginnings projected out."""
        parts = []
        for own, x in zip(self.start, change, strict=True):
            w = self.white(x)
            parts.append(w if own is None else w - own[0] @ (own[0].T @ w))
        return np.concatenate(parts)

    def project(self, change: list[np.ndarray]) -> np.ndarray:
        w = self.off_start(change)
        return w if self.shared is None else w - self.shared[0] @ (self.shared[0].T @ w)

    def spanned(self, slopes: list[list[np.ndarray]]) -> np.ndarray | None:
        """Basis of what remains of a candidate's directions; None where all but nothing does, and where the motion runs away."""
        if not all(np.isfinite(x).all() for s in slopes for x in s):
            return None
        raw = max(np.linalg.norm(np.concatenate([self.white(x) for x in s])) for s in slopes)
        columns = [self.project(s) for s in slopes]
        if raw == 0.0 or max(map(np.linalg.norm, columns)) < 1e-3 * raw:
            return None
        return orthonormal(columns, 1e-3)

    def change(self, by_record: list[Changes]) -> np.ndarray:
        """u of an effect, one dict of changes for every fitted record."""
        setup = self.setup
        read = setup.readings(list(zip(self.records, by_record, strict=True)))
        base, moved = self.zero, [dict[str, float]() for _ in self.records]
        for again in range(3):
            left = [a - b for a, b in zip(read, base, strict=True)]
            u = self.project(left)
            if again == 2 or float(u @ u) < 100.0 or not (setup.starts or setup.free):
                return u
            size = np.zeros(len(setup.free))
            if self.shared is not None:
                size = np.linalg.solve(self.shared[1], self.shared[0].T @ self.off_start(left))
            lag = 0
            for i, x in enumerate(left):
                w = self.white(x)
                part = slice(lag, lag + len(w))
                lag += len(w)
                for k, knob in enumerate(setup.free):
                    moved[i][knob] = moved[i].get(knob, 0.0) + float(size[k])
                if self.start[i] is not None:
                    rest = w - self.raw_free[part] @ size if self.free else w
                    step = np.linalg.solve(self.start[i][1], self.start[i][0].T @ rest)
                    for k, x0 in enumerate(step):
                        moved[i][f"start:{k}"] = moved[i].get(f"start:{k}", 0.0) + float(x0)
            nearer = setup.readings(list(zip(self.records, moved, strict=True)))
            if not self.size(read, nearer) <= self.size(read, base):
                return u  # the step went too far, or nowhere
            base = nearer
        return u

    def size(self, a: list[np.ndarray], b: list[np.ndarray]) -> float:
        u = self.project([x - y for x, y in zip(a, b, strict=True)])
        return float(u @ u)

    @property
    def raw_free(self) -> np.ndarray:
        """Whitened slopes by the free parameters, beginnings not projected out (rows, parameters)."""
        if not hasattr(self, "_raw"):
            steps = [self.setup.knobs[k].step for k in self.setup.free]
            out = []
            for k, step in zip(self.setup.free, steps, strict=True):
                read = self.setup.readings([(r, {k: step}) for r in self.records])
                out.append(np.concatenate([self.white(a - b) for a, b in zip(read, self.zero, strict=True)]) / step)
            self._raw = np.stack(out, axis=1)
        return self._raw

    def cosines(self, u: np.ndarray) -> dict[str, float]:
        """ρ of a change with every candidate, the best of its points where it has several; 0 where it would take a change that does not exist."""
        size = max(float(np.linalg.norm(u)), 1e-300)
        rho = {key: float(max(np.linalg.norm(b.T @ u) for b in own) / size) for key, own in self.basis.items()}
        return {key: 0.0 if self.other_way(key, u) else c for key, c in rho.items()}

    def other_way(self, key: str, u: np.ndarray) -> bool:
        """Whether a cause of a single number that can only grow would have to shrink for a change: a lighter cart has no smaller armature."""
        knobs = self.setup.causes[key].knobs
        one_sided = len(knobs) == 1 and knobs[0] in self.u and self.setup.knobs[knobs[0]].one_sided
        return one_sided and float(self.u[knobs[0]] @ u) < 0.0

    def matched(self, u: np.ndarray, own: str, by_record: bool = False) -> dict[str, float]:
        """Cosines where the best imitations are simulated at their size: derivatives miss the likeness of large changes.

        `by_record`: with a size of their own in every record.
        """
        judge = self.apart() if by_record else self
        rho = judge.cosines(u)
        for key, c in sorted(rho.items(), key=lambda kv: -kv[1])[:8]:
            knobs = self.setup.causes[key].knobs
            if c < CLOSE or key == own or any(knob not in self.u for knob in knobs):
                continue
            rho[key] = max(c, self.imitated(u, knobs, self.parts if by_record else [slice(None)] * len(self.records), c))
        return rho

    def imitated(self, u: np.ndarray, knobs: tuple[str, ...], parts: list[slice], foretold: float) -> float:
        """Cosine with the best imitation by these knobs, by steps of Gauss-Newton as long as a step takes half of what was left.

        `foretold`: the cosine to first order; `parts`: the readings that each record's sizes are told from.
        """
        lam = float(u @ u)
        total: list[Changes] = [dict.fromkeys(knobs, 0.0) for _ in parts]
        rest, best, left = u, 0.0, (1.0 - foretold**2) * lam
        for _ in range(IMITATIONS):
            total = [self.sizes(knobs, rest, part, size) for part, size in zip(parts, total, strict=True)]
            imitation = self.change(total)
            size = float(np.linalg.norm(imitation)) * np.sqrt(lam)
            best = max(best, abs(float(imitation @ u)) / max(size, 1e-300))
            rest, before, left = u - imitation, left, (1.0 - best**2) * lam
            if left > 0.5 * before:
                break
        return best

    def sizes(self, knobs: tuple[str, ...], u: np.ndarray, part: slice, before: Changes) -> Changes:
        """Changes of knobs that imitate u best beside those `before`, to first order; those of one sign kept to it."""
        columns = np.stack([self.u[knob][part] for knob in knobs], axis=1)
        size, *_ = np.linalg.lstsq(columns, u[part], rcond=1e-3)
        out = {}
        for knob, x in zip(knobs, size, strict=True):
            own = self.setup.knobs[knob]
            out[knob] = float(np.clip(before[knob] + x, own.least, own.largest))
        return out

    @property
    def parts(self) -> list[slice]:
        """Where each fitted record lies in whitened readings."""
        ends = np.cumsum([x.size for x in self.zero])
        return [slice(end - x.size, end) for end, x in zip(ends, self.zero, strict=True)]

    def mismatch_t2(self) -> float:
        """The largest |P_j m|² of the fitter's step and interpolation; a null needs it below 1."""
        return max(float(np.sum((b.T @ self.mismatch) ** 2)) for own in self.basis.values() for b in own)

    def beside(self, key: str) -> Judge:
        """A judge who refits candidate `key` too."""
        other = object.__new__(Judge)
        other.__dict__ |= self.__dict__
        known = self.basis[key][0]
        off = lambda x: x - known @ (known.T @ x)
        other.basis = {}
        for name, own in self.basis.items():
            rest = [off(b) for b in own]
            kept = [orthonormal(list(b.T), 1e-3) for b in rest if np.linalg.norm(b) > HIDDEN]
            if kept and name != key:
                other.basis[name] = kept
        return other

    def apart(self) -> Judge:
        """A judge whose candidates have a size of their own in every record."""
        other = object.__new__(Judge)
        other.__dict__ |= self.__dict__
        parts = self.parts

        def split(b: np.ndarray) -> np.ndarray:
            out = []
            for part in parts:
                own = np.zeros_like(b)
                own[part] = b[part]
                if np.linalg.norm(own) > 1e-6:
                    out += list(orthonormal(list(own.T), 1e-3).T)
            return np.stack(out, axis=1)

        other.basis = {key: [split(b) for b in own] for key, own in self.basis.items()}
        return other

    def allows_name(self, u: np.ndarray, own: str, rho: dict[str, float] | None = None) -> tuple[bool, float, list[str]]:
        """The naming rule in expectation: (allowed, margin of the worst rival [σ], rivals not beaten).

        Significant: λ above the χ²_k threshold at α/(number of candidates). Beats rival k if √(λ (1-ρ)/2) > Φ⁻¹(1 - α/m).
        """
        lam = float(u @ u)
        rho = {k: c for k, c in (rho or self.cosines(u)).items() if k != own}
        gate = norm.ppf(1.0 - ALPHA / max(len(rho), 1))
        margins = {k: float(np.sqrt(0.5 * lam * max(1.0 - c, 0.0)) - gate) for k, c in rho.items()}
        dimensions = len(self.setup.causes[own].knobs) if own in self.setup.causes else 1
        significant = lam > chi2.ppf(1.0 - ALPHA / (len(rho) + 1), dimensions)
        lost = sorted((k for k, m in margins.items() if m <= 0.0), key=lambda k: margins[k])
        return bool(significant and not lost), float(min(margins.values(), default=0.0)), lost
