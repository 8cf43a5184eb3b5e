"""Names of columns: joints and quantities, in the words that `pliant init` matches (docs/from-csv.md)."""

import re
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

T = TypeVar("T")


def words(name: str) -> list[str]:
    """The words of a name in lower case: what stands between signs that are neither letters nor digits."""
    return [word for word in re.split(r"[\W_]+", name.lower()) if word]


# The first word of each is what a column's name ends in.
KINDS = {
    "pos": "pos position positions qpos q angle angles theta",
    "vel": "vel velocity velocities qvel qdot qd dq speed speeds",
    "effort": "effort efforts torque torques tau force forces",
}
KIND_OF = {word: kind for kind, text in KINDS.items() for word in words(text)}
COMMANDS = frozenset(words("cmd command commands commanded action actions ctrl control target desired reference goal setpoint u"))
# Words that may stand beside a quantity of joints. Any other word says that an array is something else: `eef_pos`, `gripper_qpos`.
FILLERS = frozenset(
    words("joint joints state observation observations obs measured actual feedback data robot arm follower group controller forward")
)
CLOCKS = frozenset(("t", "time", "timestamp", "stamp"))
# Words for quantities and units that `pliant init` knows.
QUANTITIES = frozenset(words("q pos position angle theta qd dq qdot vel velocity effort tau torque force u cmd command ctrl"))
UNITS = frozenset(("rad", "deg", "mm", "cm", "m", "s", "ms", "us", "ns", "nm"))


class Field(NamedTuple):
    """A column: its name, whether it is a joint's quantity, and whether a value stays until the next one (commands, flags)."""

    name: str
    joint: bool = False
    held: bool = False


def is_clock(name: str) -> bool:
    """Whether `pliant init` takes a column of this name for the time: it leaves out a unit at the end, and one quantity."""
    parts = words(name)
    if len(parts) > 1 and parts[-1] in UNITS:
        parts.pop()
    if len(parts) > 1 and parts[-1] in QUANTITIES:
        parts.pop()
    elif len(parts) > 1 and parts[0] in QUANTITIES:
        parts.pop(0)
    return "".join(parts) in CLOCKS


def is_command(name: str) -> bool:
    """Whether a name has a word for commands."""
    return not COMMANDS.isdisjoint(words(name))


def quantity(name: str) -> tuple[str, bool] | None:
    """The kind of the joints' quantity that a name stands for, and whether it is commanded; None if the name is of something else."""
    parts = [word.rstrip("0123456789") or word for word in words(name)]
    kinds = {KIND_OF[word] for word in parts if word in KIND_OF}
    commanded = is_command(name)
    known = all(word in KIND_OF or word in COMMANDS or word in FILLERS for word in parts)
    if not known or len(kinds) > 1 or not (kinds or commanded or "state" in parts):
        return None
    return (kinds.pop() if kinds else "pos"), commanded


def of_joint(joint: str, kind: str, commanded: bool) -> Field:
    """The column of a joint's quantity."""
    ending = kind if not commanded else "cmd" if kind == "pos" else f"{kind}_cmd"
    return Field(f"{joint}_{ending}", joint=True, held=commanded)


def of_element(array: str, element: str) -> Field:
    """The column of a named element of an array, such as `shoulder_pan.pos` of `action`."""
    found = quantity(array)
    if found is None:
        return Field(f"{array}.{element}", held=is_command(array))
    kind, commanded = found
    base, _, last = re.sub(r"[\W_]+", " ", element).strip().rpartition(" ")
    if base and last.lower() in KIND_OF:  # the element itself says its quantity
        return of_joint(element[: len(element) - len(last)].rstrip("._/ "), KIND_OF[last.lower()], commanded)
    return of_joint(element, kind, commanded)


def of_array(array: str, size: int, joints: Sequence[str], given: Sequence[str] = ()) -> list[Field]:
    """The columns of an array of `size` numbers per sample: named by the log (`given`), by the joints' names, or counted."""
    if len(given) == size and size > 0:
        return [of_element(array, element) for element in given]
    found = (quantity(array) or quantity(array.rpartition(".")[2])) if len(joints) == size else None
    if found is not None:
        return [of_joint(joint, *found) for joint in joints]
    return counted(array, size)


def counted(array: str, size: int) -> list[Field]:
    """The columns of an array without names of its elements."""
    names = [array] if size == 1 else [f"{array}_{k}" for k in range(size)]
    return [Field(name, held=is_command(array)) for name in names]


def final(columns: dict[Field, T], degrees: bool) -> tuple[dict[str, T], list[str]]:
    """The columns by their names in the table, and notes.

    Commanded efforts of joints without measured ones are their efforts, which drive the model. `_deg` stands behind positions, velocities
    and their commands if they are in degrees.
    """
    known = {column.name for column in columns}
    out: dict[str, T] = {}
    notes = []
    for column, values in columns.items():
        name = column.name
        effort = name.removesuffix("_cmd")
        if column.joint and name.endswith("_effort_cmd") and effort not in known:
            notes.append(f"{name} -> {effort}: no torque of this joint was measured, so the commanded one drives it")
            name = effort
        if degrees and column.joint and not name.endswith(("_effort", "_effort_cmd")):
            name += "_deg"
        out[name] = values
    return out, notes
