"""Checklists as TOML: groups of automatic and manual items; a group opens when the one before it has passed."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hil.assembly.rig import Rig
from hil.check.catalogue import checks
from hil.check.judge import Limits
from hil.check.registry import Check, argument_fault
from kernel.toml_errors import ConfigError, nearest, place, read_toml, validate

FOLDER = Path(__file__).parent / "lists"
When = Literal["any", "simulated", "real"]
Slot = Literal["", "vehicle", "groundcar", "camera", "mocap"]
_SLOT_OF: dict[str, Slot] = {
    "vehicle": "vehicle",
    "car": "groundcar",
    "camera": "camera",
    "board": "camera",
    "mocap": "mocap",
}


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Item(_Table):
    """One line of a list: either `check` (automatic) or `ask` (manual).

    A manual item with a unit or limits asks for a number. `when`: skipped unless the device in `slot` (by default the
    one that the check reads, else the whole rig) is of that kind. `must`: the operator cannot skip it. `optional`:
    UNKNOWN does not block the next group. `help`: what to do if it does not pass.
    """

    check: str = ""
    ask: str = ""
    title: str = ""
    args: dict[str, Any] = Field(default_factory=dict)
    min: float | None = None
    max: float | None = None
    marginal_min: float | None = None
    marginal_max: float | None = None
    equals: bool | int | float | str | None = None
    unit: str = ""
    when: When = "any"
    slot: Slot = ""
    must: bool = False
    optional: bool = False
    help: str = ""

    @model_validator(mode="after")
    def _consistent(self) -> Item:
        if bool(self.check) == bool(self.ask):
            raise ValueError('an item has either "check" (automatic) or "ask" (manual)')
        if self.ask and self.args:
            raise ValueError('"args" belong to automatic items')
        _ = self.limits
        return self

    @property
    def limits(self) -> Limits:
        """Its limits."""
        return Limits(
            min=self.min,
            max=self.max,
            marginal_min=self.marginal_min,
            marginal_max=self.marginal_max,
            equals=self.equals,
        )

    @property
    def device(self) -> str:
        """The rig's slot that `when` refers to; empty for the whole rig."""
        return self.slot or _SLOT_OF.get(self.check.partition(".")[0], "")

    def applies(self, rig: Rig) -> bool:
        """False if it is for the other kind of rig."""
        slot: Any = getattr(rig, self.device) if self.device else rig
        simulated = getattr(slot, "simulated", None)  # of a slot that has other simulated kinds than sim
        if simulated is None:
            simulated = slot.kind == "sim"
        return self.when == "any" or simulated is (self.when == "simulated")

    @property
    def asks_number(self) -> bool:
        """True for a manual item that is answered with a number."""
        return bool(self.ask) and (bool(self.unit) or self.limits.declared)


class Group(_Table):
    """Items that belong together."""

    title: str
    item: tuple[Item, ...] = Field(min_length=1)


class Checklist(_Table):
    """One file. `kind`: only a `preflight` list can clear a rig to arm."""

    title: str
    kind: Literal["preflight", "postflight", "other"] = "other"
    group: tuple[Group, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _distinct(self) -> Checklist:
        titles = [group.title for group in self.group]
        twice = sorted({title for title in titles if titles.count(title) > 1})
        if twice:
            raise ValueError(f"two groups are called {', '.join(twice)}: give each a title of its own")
        return self

    def sha256(self) -> str:
        """Identity of its content."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()

    def places(self) -> list[tuple[int, int, str]]:
        """(group, item, key) of every item; keys are unique and constant for one list."""
        found: list[tuple[int, int, str]] = []
        seen: dict[str, int] = {}
        for g, group in enumerate(self.group):
            for i, item in enumerate(group.item):
                base = item.check or "manual." + "-".join(_words(item.title or item.ask)[:6])
                seen[base] = seen.get(base, 0) + 1
                found.append((g, i, base if seen[base] == 1 else f"{base}#{seen[base]}"))
        return found


def list_checklists() -> list[str]:
    """Names of the project's lists."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_checklist(name: str) -> Checklist:
    """The list of that name, or the TOML file at that path. Raises ConfigError naming file, key and what is allowed."""
    path = Path(name)
    if path.suffix != ".toml":
        path = FOLDER / f"{name}.toml"
        if not path.exists():
            known = list_checklists()
            raise ConfigError(
                f'there is no checklist "{name}"{nearest(name, known)} Known: {", ".join(known)}; '
                "a file of your own is given by its path, ending in .toml"
            )
    tables = read_toml(path)
    checklist = validate(tables, Checklist, str(path))
    known, faults = checks(), []
    for g, i, _ in checklist.places():
        fault = _check_fault(checklist.group[g].item[i], known)
        faults += [f"{path}: {place(tables, ('group', g, 'item', i))}: {fault}"] if fault else []
    if faults:
        raise ConfigError("\n".join(faults))
    return checklist


def _check_fault(item: Item, known: dict[str, Check]) -> str:
    if not item.check:
        return ""
    if item.check not in known:
        hint = nearest(item.check, list(known))
        return f'key "check": there is no check "{item.check}"{hint} Allowed: {", ".join(known)}'
    fault = argument_fault(known[item.check], item.args)
    if fault:
        return f'key "args": {fault}'
    if item.unit and item.unit != known[item.check].unit:
        return f'key "unit": {item.check} is measured in {known[item.check].unit or "no unit"}'
    return ""


def _words(text: str) -> list[str]:
    return "".join(c if c.isalnum() else " " for c in text.lower()).split()
