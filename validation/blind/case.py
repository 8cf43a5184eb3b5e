"""What every blind case has, whatever the effect is hidden in."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field


@dataclass(kw_only=True)
class BlindCase:
    """One blind case and what the oracle knows of it."""

    index: int
    family: str
    kind: str
    cause: str = ""  # the oracle's key ("gripper_offset:left"), or the effect outside
    name: str = ""  # pliant's name of the cause
    object: str = ""  # pliant's name of the gripper, joint, link or motor it is at; empty where it is at none
    lam: float = 0.0  # λ by the oracle (for `outside`: what remains after the best single imitation)
    theta: float = 0.0
    truth: dict[str, float]  # pliant's parameter path -> true value
    allowed: bool = False
    margin: float = 0.0
    rivals: list[str] = field(default_factory=list)
    cosines: dict[str, float] = field(default_factory=dict)
    mismatch_t2: float = 0.0  # largest over the candidates; a null with 1 or more is void
    data_seed: list[int]

    def as_json(self) -> dict:
        return asdict(self)
