"""Groups of commands; each command is also available under a flat name of one word."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperGroup

DEFAULT = "list"


class DefaultGroup(TyperGroup):
    """A group that is its command `default` where none is named: `perch-hil runs FOLDER` is `perch-hil runs list
    FOLDER`."""

    default = DEFAULT

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the default command in front of what names no command of this group."""
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = [self.default, *args]
        return super().parse_args(ctx, args)


def add_group(
    app: typer.Typer,
    name: str,
    text: str,
    commands: dict[str, Callable[..., None]],
    *,
    flat: bool = True,
    lists: bool = False,
) -> typer.Typer:
    """Add the group `name` with its commands, and return it.

    `flat`: each command is also a hidden one of `app`, under its own name. `lists`: the group is its command `list`
    where none is named, so that `list` itself has no flat name.
    """
    group = typer.Typer(no_args_is_help=not lists, cls=DefaultGroup if lists else TyperGroup, help=text)
    for word, command in commands.items():
        group.command(word)(command)
        if flat and word != DEFAULT:
            app.command(word, hidden=True)(command)
    app.add_typer(group, name=name)
    return group
