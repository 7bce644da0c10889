"""TOML read into a pydantic model, with one clear line for whoever made the typo.

Used for everything a user edits (scenarios, rigs, airframes): the message names the file, the key, the nearest allowed
key and what is allowed there.
"""

from __future__ import annotations

import difflib
import tomllib
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

Model = TypeVar("Model", bound=BaseModel)


class ConfigError(ValueError):
    """A file the user can mend: the message says which, where and how."""


def load_toml(path: Path, model: type[Model]) -> Model:
    """Read `path` as TOML into `model`. Raises ConfigError for a missing or malformed file and for every bad key."""
    return validate(read_toml(path), model, str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of the TOML file `path`. Raises ConfigError if it cannot be read or is no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file in UTF-8") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None


def validate(data: dict[str, Any], model: type[Model], where: str) -> Model:
    """`data` as `model`; ConfigError lists every fault, one a line, each starting with `where`."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = [f"{where}: {_explain(fault, model)}" for fault in error.errors(include_url=False)]
        raise ConfigError("\n".join(faults)) from None


def nearest(word: str, allowed: Sequence[str]) -> str:
    """`; did you mean "x"?` for the allowed word closest to `word`, or nothing if none is close."""
    match = difflib.get_close_matches(word.lower(), list(allowed), n=1, cutoff=0.6)
    return f'; did you mean "{match[0]}"?' if match else ""


def _explain(fault: Any, model: type[BaseModel]) -> str:
    table, keys = _walk(model, fault["loc"])
    key = ".".join(keys) or "the file"
    kind, context = fault["type"], fault.get("ctx", {})
    if kind == "extra_forbidden":
        allowed = sorted(table.model_fields) if table else []
        where = ".".join(keys[:-1]) or "the top level"
        return f'unknown key "{key}"{nearest(keys[-1], allowed)} Allowed in {where}: {", ".join(allowed)}'
    if kind == "missing":
        return f'key "{key}" is missing'
    if kind == "union_tag_not_found":
        return f'key "{key}.kind" is missing: allowed are {_plain(context)}'
    if kind == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        return f'key "{key}.kind" is "{context["tag"]}"{nearest(context["tag"], tags)} Allowed: {", ".join(tags)}'
    if kind == "value_error":
        return f'key "{key}": {context["error"]}'
    message = fault["msg"].replace("Input should be", "must be")
    return f'key "{key}": {message}, but it is {fault["input"]!r}'


def _plain(context: dict[str, Any]) -> str:
    return str(context.get("expected_tags") or context.get("discriminator", ""))


def _walk(model: type[BaseModel], location: tuple[Any, ...]) -> tuple[type[BaseModel] | None, list[str]]:
    """The model that holds the last key of a pydantic error location, and the keys as the file spells them.

    In a union of tables pydantic puts the tag (the value of `kind`) into the location; it is no key of the file.
    """
    holder: type[BaseModel] | None = model
    keys: list[str] = []
    choices: list[Any] = [model]
    for part in location:
        tagged = [m for m in choices if len(choices) > 1 and part in _kinds(m)]
        if tagged:
            holder = tagged[0]
            choices = [holder]
            continue
        keys.append(str(part))
        models = [m for m in choices if isinstance(m, type) and issubclass(m, BaseModel)]
        if not models:
            continue
        holder = models[0]
        field = holder.model_fields.get(str(part))
        choices = _models(field.annotation) if field else []
    return holder, keys


def _kinds(model: Any) -> tuple[Any, ...]:
    field = getattr(model, "model_fields", {}).get("kind")
    return typing.get_args(field.annotation) if field else ()


def _models(annotation: Any) -> list[Any]:
    if typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [m for m in typing.get_args(annotation) if m is not type(None)]
    if typing.get_origin(annotation) in (list, tuple, dict):
        return [m for m in typing.get_args(annotation) if isinstance(m, type)]
    return [annotation]
