"""TOML read into a pydantic model, with one clear line for each fault.

Used for everything a user edits (scenarios, rigs, airframes): the message names the file, the key, the nearest allowed
key and what is allowed there.
"""

from __future__ import annotations

import difflib
import json
import tomllib
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

Model = TypeVar("Model", bound=BaseModel)
_LARGEST = 1 << 20  # bytes of a file; the longest of the project has some ten thousand
_DEEPEST = 64  # tables and arrays in each other; pydantic's own limit is 200


class ConfigError(ValueError):
    """A faulty file of the user: the message names the file, the key and the remedy."""


def load_toml(path: Path, model: type[Model]) -> Model:
    """Read `path` as TOML into `model`. Raises ConfigError for a missing or malformed file and for every bad key."""
    return validate(read_toml(path), model, str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of the TOML file `path`. Raises ConfigError if it cannot be read or is no TOML."""
    try:
        with path.open("rb") as file:
            text = file.read(_LARGEST + 1)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:  # a null character
        raise ConfigError(f"{str(path)!r} is no path of a file") from None
    if len(text) > _LARGEST:
        raise ConfigError(f"{path}: is larger than {_LARGEST >> 20} MB: is it the right file?")
    try:
        tables = tomllib.loads(text.decode("utf-8"))
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file in UTF-8") from None
    except ValueError as error:  # also a whole number of thousands of digits
        raise ConfigError(f"{path}: not valid TOML: {str(error).splitlines()[0]}") from None
    except RecursionError:
        raise ConfigError(f"{path}: {_TOO_DEEP}") from None
    if _deeper(tables, _DEEPEST):
        raise ConfigError(f"{path}: {_TOO_DEEP}")
    return tables


_TOO_DEEP = f"tables or arrays are nested more than {_DEEPEST} deep"


def _deeper(value: Any, levels: int) -> bool:
    """Whether more than `levels` tables and arrays lie in each other."""
    if not isinstance(value, dict | list):
        return False
    inner = value.values() if isinstance(value, dict) else value
    return levels == 0 or any(_deeper(one, levels - 1) for one in inner)


def validate(data: dict[str, Any], model: type[Model], where: str) -> Model:
    """`data` as `model`; ConfigError lists every fault, one a line, each starting with `where`.

    Nothing is converted: a number in quotes is no number, and 1 is no true. In an array of tables the fault's place
    follows, counted from 1: `group 1 "one", item 2`.
    """
    try:
        # As JSON: only there does pydantic's strict mode take an array for a tuple, and a text for a path
        text = json.dumps(data)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where}: holds a value that no key takes: {error}") from None
    try:
        return model.model_validate_json(text, strict=True)
    except ValidationError as error:
        found = [fault for fault in error.errors(include_url=False) if not _follows(fault)]
        faults = [f"{where}: {_explain(fault, model, data)}" for fault in found]
        raise ConfigError("\n".join(faults)) from None


def place(data: Any, location: Sequence[str | int]) -> str:
    """The table in arrays of tables at `location` (keys, and indices from 0): `group 1 "its title", item 2`."""
    said: list[str] = []
    key: str | int = ""
    for part in location:
        try:
            data = data[part]
        except (LookupError, TypeError):
            data = None
        if isinstance(part, int):
            title = (data.get("title") or data.get("name")) if isinstance(data, dict) else None
            said.append(f"{key} {part + 1}" + (f' "{title}"' if isinstance(title, str) else ""))
        key = part
    return ", ".join(said)


def nearest(word: str, allowed: Sequence[str]) -> str:
    """`; did you mean "x"?` for the allowed word closest to `word`, or a full stop if none is close."""
    match = difflib.get_close_matches(word.lower(), list(allowed), n=1, cutoff=0.6)
    return f'; did you mean "{match[0]}"?' if match else "."


def _follows(fault: Any) -> bool:
    """True if an array is too short only because its faulty elements, each reported by itself, were left out."""
    short = fault["type"] == "too_short" and isinstance(fault["input"], list)
    return short and len(fault["input"]) >= fault["ctx"]["min_length"]


def _explain(fault: Any, model: type[BaseModel], data: dict[str, Any]) -> str:
    table, tables, keys = _walk(model, fault["loc"])
    at = f"{place(data, tables)}: " if tables else ""
    key = ".".join(keys) or "the file"
    kind, context = fault["type"], fault.get("ctx", {})
    if kind == "extra_forbidden":
        allowed = sorted(table.model_fields) if table else []
        inside = ".".join(keys[:-1]) or ("" if tables else "the top level")
        where = f" in {inside}" if inside else ""
        return f'{at}unknown key "{key}"{nearest(keys[-1], allowed)} Allowed{where}: {", ".join(allowed)}'
    if kind == "missing":
        return f'{at}key "{key}" is missing'
    if kind == "union_tag_not_found":
        return f'{at}key "{_kind_of(keys)}" is missing: allowed are {_plain(context)}'
    if kind == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        tag = context["tag"]
        return f'{at}key "{_kind_of(keys)}" is "{tag}"{nearest(tag, tags)} Allowed: {", ".join(tags)}'
    if kind == "value_error":
        return f"{at}{context['error']}" if tables and not keys else f'{at}key "{key}": {context["error"]}'
    message = fault["msg"].replace("Input should be", "must be")
    return f'{at}key "{key}": {message}, but it is {fault["input"]!r}'


def _kind_of(keys: list[str]) -> str:
    return ".".join([*keys, "kind"])


def _plain(context: dict[str, Any]) -> str:
    return str(context.get("expected_tags") or context.get("discriminator", ""))


def _walk(
    model: type[BaseModel], location: tuple[Any, ...]
) -> tuple[type[BaseModel] | None, tuple[str | int, ...], list[str]]:
    """The model that holds the last key of a pydantic error location; the location of the innermost table of an array
    of tables on the way (empty if there is none); and the keys from there on as the file spells them.

    In a union pydantic puts the member (the value of `kind`, or a type's name) into the location: no key of the file.
    """
    holder: type[BaseModel] | None = model
    here: Any = model
    path: list[str | int] = []
    inner, keys = 0, []
    for part in location:
        members = _members(here)
        if len(members) > 1:
            here = next((m for m in members if part in _kinds(m) or part == getattr(m, "__name__", "")), None)
            continue
        here = members[0] if members else None
        path.append(part)
        keys.append(str(part))
        if _is_model(here):
            holder = here
            field = here.model_fields.get(str(part))
            here = field.annotation if field else None
        elif typing.get_origin(here) is dict:
            here = typing.get_args(here)[1]
        elif typing.get_origin(here) in (list, tuple) and isinstance(part, int):
            elements = [m for m in typing.get_args(here) if m is not Ellipsis]
            here = elements[min(part, len(elements) - 1)]
            if any(map(_is_model, _members(here))):
                inner, keys = len(path), []
        else:
            here = None
    return holder, tuple(path[:inner]), keys


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _kinds(model: Any) -> tuple[Any, ...]:
    field = getattr(model, "model_fields", {}).get("kind")
    return typing.get_args(field.annotation) if field else ()


def _members(annotation: Any) -> list[Any]:
    """What a value may be: the members of a union, none of them None."""
    while typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [n for m in typing.get_args(annotation) if m is not type(None) for n in _members(m)]
    return [annotation]
