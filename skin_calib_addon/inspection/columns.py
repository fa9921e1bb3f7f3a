"""Find which columns of a table are the time and the channels of a skin, by their names and their number."""

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from ..common.errors import counted, listed
from ..common.findings import show

SECONDS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0} | {
    name: size
    for size, names in (
        (1e-3, ("ms", "msec", "millis", "milliseconds")),
        (1e-6, ("us", "µs", "usec", "micros", "microseconds")),
        (1e-9, ("ns", "nsec", "nanos", "nanoseconds")),
    )
    for name in names
}
TIME = {"time", "timestamp", "stamp", "clock"}  # words in the name of a time
# Words in the names of columns that are no channels. More: more tables without numbers in their names are accepted.
OTHER = frozenset((
    "frame", "frames", "counter", "count", "index", "idx", "seq", "sequence", "sample", "cycle", "step", "total", "sum",
    "temperature", "temp", "battery", "voltage", "label", "checksum", "crc",
))  # fmt: skip


class ColumnsError(ValueError):
    """The columns of a table do not match a skin."""


@dataclass(frozen=True)
class Columns:
    """Columns of a table that a skin needs."""

    time: int
    seconds: float  # unit of the time [s]
    channels: dict[int, int]  # column of each channel, sorted by the channel
    text: str  # which columns are which channels, and which are not used


def match_columns(header: Sequence[str], ids: Sequence[str], channels: Sequence[int]) -> Columns:
    """Return the columns of the time and of the channels of the taxels with these ids and channels.

    The channels are the columns with the ids of all taxels, or else those whose names have the numbers of the channels,
    from 0 or from 1. Without such names the number of columns must be that of the channels, and their order counts.
    """
    names = [name.strip().lower() for name in header]
    time, seconds = _time(names)
    others = [k for k, name in enumerate(names) if _seconds(name) is None]
    repeated = [name for name, count in Counter(names[k] for k in others).items() if name and count > 1]
    if repeated:
        raise ColumnsError(f"names {repeated[0]} twice. Give each column its own name")
    found, how = (
        _by_id(names, others, ids, channels)
        or _by_number(names, others, channels)
        or _by_order(names, others, channels)
    )
    used = {channel: found[channel] for channel in range(max(channels) + 1) if channel in found}
    first, last = (names[used[channel]] for channel in (min(channels), max(channels)))
    text = f"{first} to {last} are channels {min(channels)} to {max(channels)}{how}"
    if names[time] != "time":
        text = f"{names[time]} is the time [{seconds:g} s]; {text}"
    needed = {time, *(used[channel] for channel in channels)}
    unused = [name or "a column without a name" for k, name in enumerate(names) if k not in needed]
    return Columns(time, seconds, used, f"{text}; not used: {listed(unused)}" if unused else text)


def _time(names: Sequence[str]) -> tuple[int, float]:
    """Return the column of the time, and its unit [s]."""
    found = {k: seconds for k, name in enumerate(names) if (seconds := _seconds(name)) is not None}
    exact = [k for k in found if names[k] == "time"]
    if not found:
        raise ColumnsError(
            f"has no time; it has {listed([show(name) for name in names]) or 'none'}. Name a column 'time'"
        )
    if len(exact) != 1 and len(found) > 1:
        raise ColumnsError(f"has {len(found)} times: {listed([names[k] for k in found])}. Name one of them 'time'")
    time = (exact or list(found))[0]
    return time, found[time]


def _seconds(name: str) -> float | None:
    """Return the unit [s] of a column if it is a time, as ``t``, ``timestamp_ms``, ``Time [s]``; None for others."""
    words = re.findall(r"[a-zµ]+|\d+", name)
    if not words or any(word.isdigit() for word in words):
        return None
    if len(words) == 1 and len(words[0]) > 1 and words[0] in SECONDS:
        return SECONDS[words[0]]
    named = words[:-1] if words[-1] in SECONDS else words
    return SECONDS.get(words[-1], 1.0) if named == ["t"] or TIME.intersection(named) else None


def _by_id(
    names: Sequence[str], others: Sequence[int], ids: Sequence[str], channels: Sequence[int]
) -> tuple[dict[int, int], str] | None:
    """Return the column of each channel by the ids of the taxels; None if no column has one."""
    column = {names[k]: k for k in others}
    known = [name.lower() for name in ids]
    if column.keys().isdisjoint(known) or len(set(known)) < len(known):
        return None
    missing = [name for name, key in zip(ids, known) if key not in column]
    if missing:
        raise ColumnsError(f"has no column for {counted(len(missing), 'taxel')}: {listed(missing)}")
    return {channel: column[key] for channel, key in zip(channels, known)}, ", by the ids of the taxels"


def _by_number(
    names: Sequence[str], others: Sequence[int], channels: Sequence[int]
) -> tuple[dict[int, int], str] | None:
    """Return the column of each channel by the numbers in names that differ by one number; None without such names."""
    fits: dict[str, tuple[dict[int, int], str]] = {}
    for stem, members in _families(names, others).items():
        varying = [i for i, values in enumerate(zip(*members)) if len(set(values)) > 1]
        if len(varying) > 1:
            continue
        place = varying[0] if varying else -1
        column = {numbers[place]: k for numbers, k in members.items()}
        if column.keys() >= set(channels):
            fits[stem] = column, ""
        elif min(column) == 1 and max(column) == max(channels) + 1 == len(column):
            fits[stem] = {number - 1: k for number, k in column.items()}, ", counted from 1"
    if len(fits) > 1:
        fits = {stem: fit for stem, fit in fits.items() if not _is_other(stem)}
    if "channel_#" in fits:
        return fits["channel_#"]
    if len(fits) > 1:
        stems = listed([show(stem) for stem in fits])
        raise ColumnsError(
            f"has {len(fits)} sets of columns that fit the channels: {stems}. Name those of the channels channel_0, ..."
        )
    return next(iter(fits.values()), None)


def _by_order(names: Sequence[str], others: Sequence[int], channels: Sequence[int]) -> tuple[dict[int, int], str]:
    """Return the column of each channel by the order of the columns, if their number fits."""
    chosen, need = [k for k in others if names[k] and not _is_other(names[k])], max(channels) + 1
    families = _families(names, chosen)
    numbered = {k for members in families.values() for k in members.values()}
    odd = [names[k] for k in chosen if k not in numbered]
    advice = f"Name the columns of the channels channel_0 to channel_{need - 1}"
    if len(chosen) != need:
        which = listed(odd if families and odd else [names[k] for k in chosen]) or "none"
        raise ColumnsError(f"has {len(chosen)} columns for the {need} channels of the skin: {which}. {advice}")
    if families and odd:
        raise ColumnsError(
            f"has {counted(len(odd), 'column')} without a number among numbered ones: {listed(odd)}. {advice}"
        )
    for stem, members in families.items():
        numbers = list(members)
        if numbers != sorted(numbers):
            raise ColumnsError(f"has columns {show(stem)} that are not in the order of their numbers. {advice}")
        ends = [values for values in zip(*numbers) if len(set(values)) > 1]
        if len(ends) == 1 and max(ends[0]) - min(ends[0]) >= len(numbers):
            have = set(ends[0])
            gap = next(number for number in range(min(have), max(have)) if number not in have)
            raise ColumnsError(f"has columns {show(stem)} without the number {gap}. {advice}")
    return dict(enumerate(chosen)), ", in their order"


def _families(names: Sequence[str], columns: Sequence[int]) -> dict[str, dict[tuple[int, ...], int]]:
    """Return the columns of names that differ in their numbers only, by their numbers, in the order of the table."""
    families: dict[str, dict[tuple[int, ...], int]] = defaultdict(dict)
    for k in columns:
        numbers = tuple(int(digits[:18]) for digits in re.findall(r"[0-9]+", names[k]))
        if numbers:
            family = families[re.sub(r"[0-9]+", "#", names[k])]
            if numbers in family:
                raise ColumnsError(f"has {names[family[numbers]]} and {names[k]}, which have the same number")
            family[numbers] = k
    return families


def _is_other(name: str) -> bool:
    """Return whether a name is that of a counter, a total, a temperature and the like."""
    return not OTHER.isdisjoint(re.findall(r"[a-z]+", name))
