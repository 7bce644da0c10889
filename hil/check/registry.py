"""Registers automatic checks by name, with their arguments and unit."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hil.check.judge import Reading
from kernel.toml_errors import nearest


@dataclass(frozen=True)
class Check:
    """A registered check. `arguments`: name -> type, of those a checklist may give; `needed`: those it must give."""

    name: str
    unit: str
    about: str
    function: Callable[..., Reading]
    arguments: dict[str, type]
    needed: tuple[str, ...]


REGISTERED: dict[str, Check] = {}


def check(name: str, unit: str = "") -> Callable[[Callable[..., Reading]], Callable[..., Reading]]:
    """Register `function(context, *, argument=...) -> Reading`; its first docstring line explains the check.

    Arguments are annotated with float, int, str or bool. The function raises Unavailable or NotApplicable.
    """

    def register(function: Callable[..., Reading]) -> Callable[..., Reading]:
        if name in REGISTERED:
            raise ValueError(f"check {name!r} is registered twice")
        parameters = list(inspect.signature(function, eval_str=True).parameters.values())[1:]
        arguments = {p.name: p.annotation for p in parameters}
        needed = tuple(p.name for p in parameters if p.default is inspect.Parameter.empty)
        about = (inspect.getdoc(function) or "").split("\n", 1)[0]
        REGISTERED[name] = Check(name, unit, about, function, arguments, needed)
        return function

    return register


def argument_fault(check: Check, given: dict[str, Any]) -> str:
    """What is wrong with a checklist's `args` for a check; empty if nothing is."""
    allowed = ", ".join(check.arguments) or "none"
    for name, value in given.items():
        if name not in check.arguments:
            hint = nearest(name, list(check.arguments))
            return f'unknown argument "{name}" of {check.name}{hint} Allowed: {allowed}'
        wanted = check.arguments[name]
        fits = isinstance(value, int | float) if wanted is float else isinstance(value, wanted)
        if not fits or (isinstance(value, bool) and wanted is not bool):
            return f'argument "{name}" of {check.name} must be {wanted.__name__}, but it is {value!r}'
    missing = [name for name in check.needed if name not in given]
    return f"{check.name} needs the argument {', '.join(missing)}" if missing else ""
