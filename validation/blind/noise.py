"""Noise of the readings, and what it takes from them: colour, quantization, a clock that shakes, outliers, gaps.

    n_k = φ n_{k-1} + σ √(1-φ²) w_k,   w_k ~ N(0, 1)      standard deviation σ, colour φ per sample
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter


@dataclass(frozen=True)
class Noise:
    """`phi` [-] of the colour; `quantum` of the readings over σ; `jitter` [s] of the clock; parts of the readings that are outliers of
    `far` σ, and that are missing."""

    kind: str
    phi: float = 0.0
    quantum: float = 0.1
    jitter: float = 0.0
    outliers: float = 0.0
    gaps: float = 0.0

    FAR = 30.0

    def spread(self, sigma: float) -> float:
        """Standard deviation of a reading."""
        return float(sigma * np.hypot(1.0, self.quantum / np.sqrt(12.0)))

    def draw(self, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
        """Stationary noise along axis 0, of unit size."""
        w = rng.standard_normal(shape)
        w[1:] *= np.sqrt(1.0 - self.phi**2)
        return lfilter([1.0], [1.0, -self.phi], w, axis=0)

    def read(self, y: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
        """Readings (samples, channels) with everything that is wrong with them; NaN where they are missing."""
        out = y + sigma * self.draw(y.shape, rng)
        far = rng.random(y.shape) < self.outliers
        out = out + far * sigma * self.FAR * rng.choice([-1.0, 1.0], y.shape)
        if self.quantum > 0.0:
            out = self.quantum * sigma * np.round(out / (self.quantum * sigma))
        out[self.missing(y.shape, rng)] = np.nan
        return out

    def missing(self, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
        """Two gaps in every channel, not at its ends."""
        out = np.zeros(shape, bool)
        length = round(0.5 * self.gaps * shape[0])
        for channel in range(shape[1] if length else 0):
            for half in range(2):
                first = rng.integers(shape[0] // 10, shape[0] // 2 - length) + half * (shape[0] // 2 - shape[0] // 10)
                out[first : first + length, channel] = True
        return out


KINDS = {
    noise.kind: noise
    for noise in (
        Noise("white"), Noise("ar_0.3", 0.3), Noise("ar_0.8", 0.8), Noise("ar_0.95", 0.95), Noise("quantized", quantum=2.0),
        Noise("jitter", jitter=5e-4), Noise("outliers", outliers=0.002), Noise("gaps", gaps=0.1),
    )
}  # fmt: skip


def whiten(x: np.ndarray, phi: float, sigma: float) -> np.ndarray:
    """Innovations of (samples, channels), flattened."""
    out = np.empty(x.shape)
    out[0] = x[0] / sigma
    out[1:] = (x[1:] - phi * x[:-1]) / (sigma * np.sqrt(1.0 - phi**2))
    return out.reshape(-1)
