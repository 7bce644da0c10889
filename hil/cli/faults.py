"""`perch-hil faults`: the kinds of faults that a scenario or a campaign may name, with their parameters."""

from __future__ import annotations

from typing import Any

import typer

from hil.cli.options import Json


def faults(as_json: Json = False) -> None:
    """List the kinds of faults with their parameters."""
    from rich import box
    from rich.table import Table

    from hil.cli.screen import print_json, say, screen
    from scenarios.faults import QUANTITIES

    kinds = _kinds()
    if as_json:
        print_json({"kinds": kinds, "conditions": QUANTITIES})
        return
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("kind", "what happens", "parameters"):
        table.add_column(column, overflow="fold")
    for kind in kinds:
        parameters = ", ".join(f"{name} = {value['default']}" for name, value in kind["parameters"].items())
        table.add_row(kind["kind"], kind["text"], parameters)
    screen().print(table)
    say("Every table also takes at (s of the attempt, or a condition), for (s), name and seed. Conditions compare:")
    say("\n".join(f"  {name}: {text}" for name, text in QUANTITIES.items()))


def _kinds() -> list[dict[str, Any]]:
    from hil.faults.kinds import KINDS

    rows = []
    for name, kind in KINDS.items():
        schema = kind.Parameters.model_json_schema()["properties"] if kind.Parameters.model_fields else {}
        limits = ("default", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "enum")
        parameters = {key: {k: v for k, v in value.items() if k in limits} for key, value in schema.items()}
        text = " ".join((kind.__doc__ or "").split())
        where = [*(["with pictures only"] if kind.pictures else []), *(["live only"] if kind.live_only else [])]
        where += [f"simulated {kind.device} only"] if kind.device else []
        rows.append({"kind": name, "text": text, "where": where, "parameters": parameters})
    return rows


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(faults)
