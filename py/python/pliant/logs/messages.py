"""A message of a topic as named numbers: joints by the names in the message, other fields as `field.sub`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from .names import Field, is_command, of_array, of_joint, quantity
from .table import MOST_ELEMENTS

# Keys that hold the names of a message's joints, and those of its time.
NAMES = ("joint_names", "names", "name")
SECONDS, NANOSECONDS = ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos")
# Fields of poses in the messages of ROS, and what they are called here.
POSES = (
    (re.compile(r"^(?:pose\.)*position\.(?=[xyz]$)"), ""),
    (re.compile(r"^(?:pose\.)*orientation\.(?=[xyzw]$)"), "q"),
    (re.compile(r"^transform\.translation\.(?=[xyz]$)"), ""),
    (re.compile(r"^transform\.rotation\.(?=[xyzw]$)"), "q"),
)


class Unusable(ValueError):
    """A message whose parts do not fit together: `what`, as the end of a sentence."""


def plain(value: Any) -> Any:
    """A message as dictionaries, lists, numbers and strings; bytes are left out (None)."""
    if isinstance(value, (str, int, float)) or value is None:
        return value
    if isinstance(value, np.ndarray):
        return None if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value):  # ROS; rosbags adds the name of the type
        return {field.name: plain(getattr(value, field.name)) for field in fields(value) if field.name != "__msgtype__"}
    if hasattr(value, "DESCRIPTOR"):  # protobuf; a part that is not set has no numbers
        parts = value.DESCRIPTOR.fields
        return {f.name: plain(getattr(value, f.name)) for f in parts if not f.has_presence or value.HasField(f.name)}
    if isinstance(value, Mapping) or hasattr(value, "items"):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, bytes):
        return None
    return [plain(part) for part in value]


def stamp(message: Any) -> int | None:
    """The time that a message says of itself [ns]: `header.stamp`, `stamp` or `timestamp` in seconds and nanoseconds; None without."""
    if not isinstance(message, dict):
        return None
    header = message.get("header")
    for found in (header.get("stamp") if isinstance(header, dict) else None, message.get("stamp"), message.get("timestamp")):
        if isinstance(found, dict):
            seconds = next((found[key] for key in SECONDS if key in found), None)
            rest = next((found[key] for key in NANOSECONDS if key in found), 0)
            if isinstance(seconds, int) and isinstance(rest, int) and (seconds or rest):
                return 1_000_000_000 * seconds + rest
    return None


def joint_names(message: Any) -> tuple[str, ...]:
    """The names of joints in a message."""
    if not isinstance(message, dict):
        return ()
    named = (message.get(key) for key in NAMES)
    return next((tuple(n) for n in named if isinstance(n, list) and n and all(isinstance(name, str) for name in n)), ())


class Flattener:
    """Makes named numbers of a topic's messages.

    topic: its name, which may say that joints are commanded. joints: names for arrays without any. sizes: length of each list in the
    first message; varying: what was said of lists whose length differs; long: names of lists that are too long.
    """

    def __init__(self, topic: str, joints: Sequence[str]):
        self.topic, self.joints, self.commanded = topic, tuple(joints), is_command(topic)
        self.sizes: dict[str, int] = {}
        self.varying: dict[str, str] = {}
        self.long: set[str] = set()

    def numbers(self, message: Any, index: int) -> dict[Field, float]:
        """The numbers of message number `index`; Unusable if its arrays have another length than its names."""
        out: dict[Field, float] = {}
        message = message if isinstance(message, dict) else {"data": message}
        if message.keys() <= {"layout", "data"}:  # std_msgs: the topic is the array's name
            self._walk(message.get("data"), self.topic.strip("/").replace("/", "_"), (), index, out)
        else:
            self._walk(message, "", (), index, out)
        return out

    def _walk(self, value: Any, path: str, names: tuple[str, ...], index: int, out: dict[Field, float]) -> None:
        if isinstance(value, (bool, int, float)):
            out[_scalar(path, isinstance(value, bool), self.commanded)] = float(value)
        elif value is None and path:
            pass
        elif isinstance(value, dict):
            own = joint_names(value)
            for key, part in value.items():
                time = key in ("header", "stamp", "timestamp", "time_from_start") and isinstance(part, dict)
                if not time and not (own and key in NAMES):
                    self._walk(part, f"{path}.{key}" if path else key, own or names, index, out)
        elif isinstance(value, list):
            self._list(value, path, names, index, out)

    def _list(self, value: list, path: str, names: tuple[str, ...], index: int, out: dict[Field, float]) -> None:
        size = len(value)
        numeric = all(isinstance(part, (int, float)) or part is None for part in value)
        if names and numeric:
            if size not in (0, len(names)) and quantity(path) is not None:
                raise Unusable(f"has {size} numbers in {path}, but {len(names)} names in message {index} (counted from 0)")
            if size == len(names):
                for name, field, part in zip(names, _named(path, names, self.commanded), value, strict=True):
                    if field in out:  # two parts of a message with the same meaning: the first has the short name
                        field = Field(f"{name}.{path}", held=field.held)
                    out[field] = float("nan") if part is None else float(part)
            return
        if names and path == "points" and size == 1 and isinstance(value[0], dict):  # a trajectory of one point is a command
            self._walk(value[0], "goal", names, index, out)
            return
        if self.sizes.setdefault(path, size) != size:
            at = f"{self.sizes[path]} in message 0, {size} in message {index}"
            self.varying.setdefault(path, f"its length differs: {at}")
        elif size > MOST_ELEMENTS:
            self.long.add(path)
        elif numeric:
            for field, part in zip(of_array(path, size, self.joints), value, strict=True):
                out[field._replace(held=field.held or self.commanded)] = float("nan") if part is None else float(part)
        elif all(isinstance(part, dict) for part in value):
            for k, part in enumerate(value):
                self._walk(_unnamed(part), f"{path}.{part['name']}" if isinstance(part.get("name"), str) else f"{path}_{k}", (), index, out)


def _unnamed(part: dict) -> dict:
    return {key: value for key, value in part.items() if key != "name"}


@lru_cache(maxsize=4096)
def _named(path: str, names: tuple[str, ...], commanded: bool) -> list[Field]:
    found = quantity(path)
    if found is None:
        return [Field(f"{name}.{path}", held=commanded) for name in names]
    return [of_joint(name, found[0], found[1] or commanded) for name in names]


@lru_cache(maxsize=4096)
def _scalar(path: str, flag: bool, commanded: bool) -> Field:
    for pattern, short in POSES:
        path = pattern.sub(short, path)
    return Field(path, held=flag or commanded or is_command(path))
