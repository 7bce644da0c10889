"""Exit codes, error output and options that several commands share."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from policies.flying.shipped import FLYABLE

if TYPE_CHECKING:
    from hil.bus.leaf import Credentials

OK, DIFFERENT, USAGE, COULD_NOT_RUN, UNDECIDED, INTERRUPTED = 0, 1, 2, 3, 4, 130
PERCHED, NOT_PERCHED = OK, DIFFERENT

ENDPOINT = "tcp/127.0.0.1:7447"

Json = Annotated[bool, typer.Option("--json", help="print JSON on stdout, and nothing else there")]
Out = Annotated[Path, typer.Option(help="folder of the run folders")]
Records = Annotated[Path, typer.Option(help="folder of the signed checklist records")]
Rig = Annotated[str, typer.Option(help="a rig's name (see `perch-hil rig list`) or a path to a .toml")]
ScenarioRig = Annotated[
    str | None,
    typer.Option(help="a rig's name (see `perch-hil rig list`) or a path to a .toml [default: the scenario's]"),
]
Keys = Annotated[
    Path | None, typer.Option(help="folder made by `perch-hil bus keys`: the bus is closed, its endpoint is tls/")
]
Endpoint = Annotated[str | None, typer.Option(help=f"address of the hub, tcp/HOST:PORT [default: {ENDPOINT}]")]
Cluster = Annotated[
    str | None,
    typer.Option(help="fly on a Ray cluster: ray://HOST:10001, auto, or HOST:6379 [default: on this machine]"),
]
Camera = Annotated[
    Literal["pictures", "model"] | None,
    typer.Option(help="pictures: rendered and searched for tags; model: the paper's visibility test and noise"),
]
POLICIES = ", ".join(FLYABLE)  # every policy that flies by name, for help texts
Policy = Annotated[str | None, typer.Option(help=f"{POLICIES} or PATH.onnx [default: the rig's]")]


def complain(text: str) -> None:
    """Print one line on stderr."""
    print(f"perch-hil: {text}", file=sys.stderr)


def fail(text: str, code: int = USAGE) -> typer.Exit:
    """Print one line on stderr and return the exit to raise."""
    complain(text)
    return typer.Exit(code)


def hub_endpoint(endpoint: str | None, keys: Path | None) -> str:
    """The hub's address: as given, or this host's default (tls/ on a closed bus). ConfigError if it is malformed."""
    from hil.live.options import check_endpoint

    found = endpoint or (ENDPOINT if keys is None else ENDPOINT.replace("tcp/", "tls/"))
    check_endpoint(found, keys)
    return found


def credentials(keys: Path | None, identities: Sequence[str]) -> Credentials | None:
    """The first identity's files in the folder `keys`; None for an open bus. KeysError if one of `identities` lacks."""
    from hil.bus.leaf import credentials_in
    from hil.live.options import check_identities

    check_identities(keys, identities)
    return None if keys is None else credentials_in(keys, identities[0])


def parse_seeds(seed: int | None, seeds: str | None) -> range:
    """The seeds asked for by --seed N or --seeds A..B (inclusive); ValueError states what is wrong."""
    if seed is not None and seeds is not None:
        raise ValueError("give --seed or --seeds, not both")
    if seeds is None:
        first = last = 0 if seed is None else seed
    else:
        head, dots, tail = seeds.partition("..")
        if not (dots and head.isdecimal() and tail.isdecimal()):
            raise ValueError(f"--seeds {seeds!r}: write A..B with whole numbers, such as 0..19 (both ends included)")
        first, last = int(head), int(tail)
    if not 0 <= first <= last < 2**32:
        raise ValueError(f"seeds {first}..{last}: they run upwards within 0..{2**32 - 1}")
    return range(first, last + 1)
