"""Single taxels of a skin that differ from the others: disabled ones, and those with a channel of their own."""

from collections.abc import Collection, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from ..calibration.model import Patch, TaxelArray
from ..common.arrays import BoolArray
from ..common.errors import InvalidPlan
from ..common.findings import did_you_mean


class SingleTaxel(NamedTuple):
    """What is different about one taxel."""

    taxel: str  # its id, without the name of the skin
    enabled: bool = True
    channel: int | None = None  # None: by its position in the skin


Parted = tuple[tuple[Patch, ...], tuple[Patch | None, ...]]


def with_single_taxels(patches: tuple[Patch, ...], singles: Sequence[tuple[SingleTaxel, ...]]) -> Parted:
    """Give single taxels their own channels, and leave out those that are disabled."""
    if not any(singles):
        return patches, (None,) * len(patches)
    both = [_of_patch(patch, own) for patch, own in zip(patches, singles)]
    removed = {id for patch, off in both for id, is_off in zip(patch.taxels.ids, off) if is_off}
    enabled = tuple(replace(patch, taxels=chosen_taxels(patch.taxels, ~off, removed)) for patch, off in both)
    disabled = tuple(
        replace(patch, taxels=chosen_taxels(patch.taxels, off, set())) if off.any() else None for patch, off in both
    )
    _check_channels(enabled)
    return enabled, disabled


def _of_patch(patch: Patch, singles: tuple[SingleTaxel, ...]) -> tuple[Patch, BoolArray]:
    """Return a patch with the channels of its single taxels, and which of its taxels are disabled."""
    ids, channels = patch.taxels.ids, patch.taxels.channels.copy()
    rows, off = {short_id(patch, id): row for row, id in enumerate(ids)}, np.zeros(len(ids), bool)
    for single in singles:
        row = rows.get(single.taxel)
        if row is None and patch.kind == "imported":
            near = did_you_mean(single.taxel, rows)
            raise InvalidPlan(
                f"Skin {patch.name!r} has no taxel {single.taxel!r}{near or '.'} Remove it from the single taxels.",
                skin=patch.name,
            )
        if row is not None:  # a trimmed sheet leaves cells out
            off[row] = not single.enabled
            channels[row] = channels[row] if single.channel is None else single.channel
    if off.all():
        raise InvalidPlan(
            f"All taxels of skin {patch.name!r} are disabled. Enable one, or remove the skin.", skin=patch.name
        )
    return replace(patch, taxels=replace(patch.taxels, channels=channels)), off


def short_id(patch: Patch, id: str) -> str:
    """Return the id of a taxel of a patch without the name of the patch."""
    return id.removeprefix(f"{patch.name}.")


def chosen_taxels(taxels: TaxelArray, rows: BoolArray, removed: Collection[str] = ()) -> TaxelArray:
    """Return some of the taxels; their neighbours and ports do not have the removed ids."""
    chosen = np.flatnonzero(rows).tolist()
    arrays: dict[str, Any] = {field.name: getattr(taxels, field.name) for field in fields(taxels)}
    arrays = {name: v[rows] for name, v in arrays.items() if isinstance(v, np.ndarray) and len(v)}
    return replace(
        taxels,
        **arrays,
        ids=tuple(taxels.ids[k] for k in chosen),
        neighbours=tuple(tuple(id for id in taxels.neighbours[k] if id not in removed) for k in chosen),
        ports=tuple(tuple(None if id in removed else id for id in taxels.ports[k]) for k in chosen)
        if taxels.ports
        else (),
        quality={name: values[rows] for name, values in taxels.quality.items()},
    )


def _check_channels(patches: tuple[Patch, ...]) -> None:
    """Refuse two taxels with the same channel."""
    known: dict[int, str] = {}
    for patch in patches:
        for id, channel in zip(patch.taxels.ids, patch.taxels.channels.tolist()):
            if known.setdefault(channel, id) != id:
                raise InvalidPlan(
                    f"Taxels {known[channel]} and {id} both have channel {channel}. Set another channel for one of "
                    "them, or disable it.",
                    skin=patch.name,
                )
