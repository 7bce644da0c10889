"""The real command line, to parse with: nothing is executed, and every value is looked at."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from hil.assembly.node_table import service_nodes
from hil.assembly.rig import load_rig
from hil.check.checklist import load_checklist
from hil.cli.main import app
from hil.contract.topics import TOPICS
from hil.live.options import check_endpoint
from policies.evaluation.contenders import NAMES
from policies.flying.shipped import FLYABLE
from scenarios.spec import load


def leaves(command: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every command by its words, but for groups."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield name, command
    else:
        yield from itertools.chain.from_iterable(leaves(one, f"{name} {word}".strip()) for word, one in inner.items())


def options() -> set[str]:
    """Every option of every command."""
    commands = [get_command(app), *(command for _, command in leaves(get_command(app)))]
    return {"--help"} | {name for command in commands for option in command.params for name in option.opts}


def knows(words: list[str]) -> bool:
    """True if `words` begin with a command or group."""
    at = get_command(app)
    for word in words:
        at = getattr(at, "commands", {}).get(word)
        if at is None:
            return False
    return True


def parse(words: list[str]) -> dict[str, Any]:
    """What the command would get, and its name as `command`. Raises what the real command line raises on a mistake."""
    tree, got = get_command(app), {}

    def record(name: str) -> Callable[..., None]:
        return lambda **values: got.update(values, command=name)

    for name, command in leaves(tree):
        command.callback = record(name)
    tree.main(words, "perch-hil", standalone_mode=False)
    return got


def look_at_values(got: dict[str, Any]) -> None:
    """Raise for a value that the command would refuse, or a file that is not below the working directory."""
    command, rig, keys = got.get("command", ""), got.get("rig"), got.get("keys")
    listing = command in ("runs list",)
    for scenario in [got["scenario"]] if got.get("scenario") else got.get("scenarios") or ():
        load(scenario)
    if rig and not listing:
        load_rig(rig)
    known = NAMES if command.endswith("evaluate") else FLYABLE
    for policy in [got["policy"]] if isinstance(got.get("policy"), str) else got.get("policy") or ():
        assert policy in known or Path(policy).is_file(), f"no policy {policy}"
    if got.get("recipe"):
        from policies.training.recipe import load_recipe

        load_recipe(got["recipe"])
    for service in [*(got.get("remote") or ()), *([got["service"]] if got.get("service") else ())]:
        assert service in service_nodes(load_rig(rig or "sim")), f"no service {service}"
    if got.get("endpoint"):
        check_endpoint(got["endpoint"], Path(keys) if keys else None)
    for ignored in got.get("ignore") or ():
        assert ignored.split(".")[0] in TOPICS, f"no topic {ignored}"
    if got.get("what"):
        load_checklist(got["what"])
    paths = [got.get(name) for name in ("run", "run_a", "run_b", "compare", "parent")]
    paths += got.get("runs") or ()
    for path in filter(None, paths):
        assert Path(path).exists(), f"{path} is neither in the project nor made by an earlier command"
