"""Topics with clocks of their own as one table, whose rows are the times of one of them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from .messages import Flattener, Unusable, joint_names, stamp
from .names import Field, final
from .table import Options, Table, check_clock, finish, mistake, short

# Measurements are interpolated over gaps of at most this many of their median periods.
LONGEST_GAP = 3.0
# Stamps that differ from the time of recording by more are those of another clock, such as a simulation's [s].
SAME_CLOCK = 1.0
# Columns of a pose, which are named after their topic in any case.
POSE = frozenset(("x", "y", "z", "qx", "qy", "qz", "qw"))


@dataclass
class Stream:
    """The messages of a topic, or those of them that name the same joints."""

    topic: str
    names: tuple[str, ...]
    flattener: Flattener
    log: list[int] = field(default_factory=list)
    stamps: list[int | None] = field(default_factory=list)
    rows: list[dict[Field, float]] = field(default_factory=list)
    columns: dict[Field, np.ndarray] = field(default_factory=dict)
    times: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def label(self) -> str:
        """The topic, for messages."""
        return f"{self.topic} ({short(self.names, 4)})" if self.names else self.topic

    @property
    def stamped(self) -> bool:
        """Whether every message says its time."""
        return all(s is not None for s in self.stamps)

    @property
    def behind(self) -> float:
        """Median time from stamps to the time of recording [s]."""
        return float(np.median([(log - s) * 1e-9 for log, s in zip(self.log, self.stamps, strict=True) if s is not None]))

    @property
    def has_positions(self) -> bool:
        """Whether it has measured positions of joints."""
        return any(f.joint and f.name.endswith("_pos") for f in self.columns)


def table_of(name: str, where: str, messages: Iterable[tuple[str, int, Any]], options: Options, notes: list[str]) -> Table:
    """The table of messages: (topic, time of recording [ns], message as dictionaries, lists and numbers)."""
    streams, faults = _collect(messages, options)
    clock = _clock(where, streams, faults, options, notes)
    notes = notes + [f"{topic}: left out, {fault}" for topic, fault in faults.items()]
    streams = _on_one_clock(streams, clock, options, notes)
    fix = "choose another topic by --clock" if options.log_time else "choose another topic by --clock, or count by --log-time"
    check_clock(clock.times, f"{where}: topic {clock.label}: its clock [ns]", fix)
    time = (clock.times - clock.times[0]) / 1e9
    by = "header stamps" if clock.stamped and not options.log_time else "the time of recording"
    rate = 1.0 / float(np.median(np.diff(time)))
    notes.insert(0, f"{clock.label} gives the rows: {len(time)} at {rate:.4g} Hz, by {by}")
    columns: dict[Field, np.ndarray] = {}
    borrowed = []
    for stream in [clock] + [s for s in streams if s is not clock]:
        values = stream.columns if stream is clock else _at(stream, clock.times, notes)
        prefix = stream.topic.strip("/").replace("/", "_")
        for f, column in values.items():
            # the clock's fields and joints have their own names: pliant finds joints by them
            bare = (f.joint or stream is clock) and f.name not in POSE
            own = f.name == prefix or f.name.startswith(f"{prefix}_")
            taken = {other.name for other in columns}
            new = f if (bare or own) and f.name not in taken else Field(f"{prefix}_{f.name}", held=f.held)
            for k in count(2):
                if new.name not in taken:
                    break
                new = Field(f"{prefix}_{f.name}_{k}", held=f.held)
            if new.joint and stream is not clock:
                borrowed.append(new)
            columns[new] = column
    time, columns = _trim(time, columns, borrowed, notes)
    named, more = final(columns, options.degrees)
    return finish(name, where, time, named, notes + more)


def _collect(messages: Iterable[tuple[str, int, Any]], options: Options) -> tuple[list[Stream], dict[str, str]]:
    """The streams that have numbers, and why the other topics have none."""
    streams: dict[tuple[str, tuple[str, ...]], Stream] = {}
    faults: dict[str, str] = {}
    for topic, log, message in messages:
        if topic in faults:
            continue
        names = joint_names(message)
        key = (topic, tuple(sorted(names)))
        stream = streams.get(key) or streams.setdefault(key, Stream(topic, names, Flattener(topic, options.joints)))
        points = message.get("points") if isinstance(message, dict) else None
        if names and isinstance(points, list) and len(points) > 1:
            faults[topic] = f"its trajectories are plans (of {len(points)} points), no commands of one time"
            continue
        if len(set(names)) < len(names):
            faults[topic] = f"it names a joint twice: {short(names)}"
            continue
        try:
            stream.rows.append(stream.flattener.numbers(message, len(stream.rows)))
        except Unusable as error:
            faults[topic] = f"it {error}"
            continue
        stream.log.append(log)
        stream.stamps.append(stamp(message))
    kept = [stream for stream in streams.values() if stream.topic not in faults]
    for stream in kept:
        fields = dict.fromkeys(f for row in stream.rows for f in row)
        nan = float("nan")
        lists = stream.flattener.varying
        columns = {f: np.array([row.get(f, nan) for row in stream.rows]) for f in fields}
        stream.columns = {f: c for f, c in columns.items() if not any(f.name.startswith(f"{path}_") for path in lists)}
    for stream in [stream for stream in kept if not stream.columns]:
        kept.remove(stream)
        what = [f"{path or 'its list'}: {fault}" for path, fault in stream.flattener.varying.items()]
        faults[stream.topic] = what[0] if what else "no numbers"
    return kept, {topic: fault for topic, fault in faults.items() if not any(s.topic == topic for s in kept)}


def _clock(where: str, streams: list[Stream], faults: dict[str, str], options: Options, notes: list[str]) -> Stream:
    """The stream whose times are the rows: the one that was asked for, else of those with positions of joints the longest."""
    if options.clock is None:
        if streams:
            return max(streams, key=lambda s: (s.has_positions, len(s.rows)))
        if not faults and not notes:
            raise mistake(where, "has no messages", "nothing was published while it was recorded", "give another recording")
        cause = "; ".join([f"{topic}: {fault}" for topic, fault in faults.items()] + notes)
        raise mistake(where, "has no topic with numbers", cause, "record joint states, or another topic with numbers")
    found = [s for s in streams if s.topic == options.clock]
    if found:
        return max(found, key=lambda s: len(s.rows))
    there = short([f"{s.topic} ({len(s.rows)} messages)" for s in streams]) or "none"
    if options.clock in faults:
        fix = f"repair the log, or name another topic by --clock: {there}"
        raise mistake(f"{where}: topic {options.clock}", f"cannot be the clock: {faults[options.clock]}", "the publisher", fix)
    cause = f"a slip in the name, or an empty topic; those with numbers are {there}"
    raise mistake(where, f"has no topic {options.clock} with numbers", cause, "name one of them by --clock")


def _on_one_clock(streams: list[Stream], clock: Stream, options: Options, notes: list[str]) -> list[Stream]:
    """Gives every stream its times, and leaves out those that are not on the clock's."""
    by_stamps = clock.stamped and not options.log_time
    kept = []
    for stream in streams:
        if by_stamps and not stream.stamped and abs(clock.behind) > SAME_CLOCK:
            text = f"the stamps of {clock.topic} are {clock.behind:.4g} s from it; --log-time counts all by it"
            notes.append(f"{stream.label}: left out, it has only the time of recording, and {text}")
            continue
        stream.times = np.array(stream.stamps if by_stamps and stream.stamped else stream.log, dtype=np.int64)
        if by_stamps and not stream.stamped:
            notes.append(f"{stream.label}: by the time of recording, for it has no header stamps")
        kept.append(stream)
        for path, fault in stream.flattener.varying.items():
            notes.append(f"{stream.label}: {path}: left out, {fault}")
        for path in sorted(stream.flattener.long):
            notes.append(f"{stream.label}: {path}: left out, {stream.flattener.sizes[path]} numbers per message")
    return kept


def _at(stream: Stream, at: np.ndarray, notes: list[str]) -> dict[Field, np.ndarray]:
    """A stream's columns at the times [ns] of the rows, NaN where unknown: measurements interpolated, commands as `_in_force` says."""
    # one message per time, the last; in the order of time
    times, last = np.unique(stream.times[::-1], return_index=True)
    rows = len(stream.times) - 1 - last
    if len(times) < len(stream.times):
        notes.append(f"{stream.label}: of messages with one time the last counts ({len(stream.times) - len(times)} others)")
    start = at[0]
    t, own = (at - start) / 1e9, (times - start) / 1e9
    before = np.searchsorted(times, at, side="right") - 1
    known = before >= 0
    exact = known & (times[before] == at)
    period = float(np.median(np.diff(own))) if len(own) > 1 else 0.0
    after = np.minimum(before + 1, len(times) - 1)
    inside = exact | (known & (after > before) & (own[after] - own[before] <= LONGEST_GAP * period))
    columns = {f: column[rows] for f, column in stream.columns.items()}
    held = [f for f in columns if f.held]
    out = {}
    for f, values in _turned(columns).items():
        if f.held:
            out[f] = _in_force(times, values, at)
        else:
            out[f] = np.where(exact, values[before], np.where(inside, np.interp(t, own, values), np.nan))
    how = ["held from one to the next, a row has the mean over its period"] if held else []
    how += [f"interpolated, never over more than {LONGEST_GAP:g} periods of {period:.4g} s"] if len(held) < len(columns) else []
    empty = int(np.sum(~(known if len(held) == len(columns) else inside)))
    text = f"; {empty} of {len(at)} rows are empty" if empty else ""
    notes.append(f"{stream.label}: {len(times)} messages, {'; '.join(how)}{text}")
    return out


def _in_force(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The mean of a command over the period of each row, which ends halfway to its neighbours; NaN before the first command.

    A command is in force from its time [ns] until the next one. pliant reads inputs between rows as straight lines: with the value in
    force at the row's time they would come up to half a period early or late, and a diagnosis would find a delay.
    """
    halfway = at[:-1] + np.diff(at) // 2
    lower = np.maximum(np.concatenate([[2 * at[0] - halfway[0]], halfway]), times[0])
    upper = np.concatenate([halfway, [2 * at[-1] - halfway[-1]]])
    first = np.searchsorted(times, lower, side="right") - 1
    last = np.maximum(np.searchsorted(times, upper, side="left") - 1, first)
    numbers = np.nan_to_num(values)
    integral = np.concatenate([[0.0], np.cumsum(numbers[:-1] * np.diff(times))])
    whole = integral[last] - integral[first] + numbers[last] * (upper - times[last]) - numbers[first] * (lower - times[first])
    missing = np.concatenate([[0], np.cumsum(np.isnan(values))])
    known = (at >= times[0]) & (missing[last + 1] == missing[first])
    # one command for the whole period: exactly it
    mean = np.where(first == last, numbers[last], whole / np.maximum(upper - lower, 1))
    return np.where(known, mean, np.nan)


def _turned(columns: dict[Field, np.ndarray]) -> dict[Field, np.ndarray]:
    """The columns with quaternions whose sign does not jump: q and -q are one orientation, but not halfway between."""
    out = dict(columns)
    by_name = {f.name: f for f in columns}
    for f in columns:
        if not f.name.endswith("w"):
            continue
        stem = f.name[:-1]
        fields = [by_name.get(f"{stem}{axis}") for axis in "xyzw"]
        if stem.endswith(("q", "orientation.", "rotation.")) and all(fields):
            q = np.stack([columns[part] for part in fields if part is not None])
            dots = np.sum(q[:, 1:] * q[:, :-1], axis=0)
            signs = np.cumprod(np.concatenate([[1.0], np.where(dots < 0.0, -1.0, 1.0)]))
            out.update({part: values * signs for part, values in zip(fields, q, strict=True) if part is not None})
    return out


def _trim(
    time: np.ndarray, columns: dict[Field, np.ndarray], borrowed: list[Field], notes: list[str]
) -> tuple[np.ndarray, dict[Field, np.ndarray]]:
    """Cuts rows at both ends where joints of other topics have no numbers, which pliant needs in every row."""
    if not borrowed:
        return time, columns
    full = np.flatnonzero(np.all([np.isfinite(columns[f]) for f in borrowed], axis=0))
    if len(full) < 2:
        notes.append("no two rows have all joints: the topics do not overlap")
        return time, columns
    first, end = int(full[0]), int(full[-1]) + 1
    if (first, end) != (0, len(time)):
        notes.append(f"{first} rows at the start and {len(time) - end} at the end are cut: joints of other topics have no numbers there")
    return time[first:end] - time[first], {f: values[first:end] for f, values in columns.items()}
