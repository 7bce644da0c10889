"""What `perch-hil check` does, from the names on the command line to the exit code."""

from __future__ import annotations

import fcntl
import getpass
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from hil.assembly.rig import load_rig
from hil.bench.devices import Context, subject
from hil.check import records
from hil.check.catalogue import checks
from hil.check.checklist import Checklist, load_checklist
from hil.check.junit import write_junit
from hil.check.records import ABORTED, GO, INCOMPLETE, NO_GO, Record, RecordError, iso, passed
from hil.check.screen import Screen
from hil.check.session import Session, list_subject, new_record
from hil.check.terminal import Keyboard
from policies.flying.registry import policy_factory
from policies.flying.shipped import policy_file
from scenarios.spec import load
from vehicle.quadrotor.airframe import load_airframe

GO_ON = timedelta(hours=12)  # an open record older than this is of another day


@dataclass(frozen=True)
class Wish:
    """The command line."""

    list_name: str
    rig: str
    policy: str | None
    scenario: str
    record: Path | None
    folder: Path
    operator: str | None
    sign: bool
    fresh: bool
    run: Path | None
    out: Path
    as_json: bool
    junit_file: Path | None
    endpoint: str = ""
    keys: Path | None = None


def run_checklist(wish: Wish) -> int:
    """Load, walk through, sign, write, print; returns the exit code.

    Raises ValueError (ConfigError, RecordError) for a list, rig, policy or record that cannot be used, ProvenanceError
    for a checkout that git cannot describe, KeyboardInterrupt or EOFError if it is left before the first item.
    """
    checklist = load_checklist(wish.list_name)
    context, about = _context(wish)
    path, record = _begin(wish, checklist, list_subject(checklist, about))
    screen = Screen(Console(stderr=wish.as_json), Keyboard(), wish.operator or "")
    operator = wish.operator or (screen.operator(_login()) if screen.interactive else "")
    with _alone(path), closing_devices(context):
        return _walk(wish, Session(checklist, context, record, path, screen, operator), record, path, screen, operator)


def _walk(wish: Wish, session: Session, record: Record, path: Path, screen: Screen, operator: str) -> int:
    aborted = False
    try:
        session.run()
        code = record.exit_code()
        willing = wish.sign and code == GO
        if not willing and screen.interactive and code != INCOMPLETE:
            screen.summary(record, _verdict(code, record), str(path))
            willing = screen.sign(record)
        if willing:
            record.sign(operator, datetime.now(UTC))
            records.write(path, record)
    except (KeyboardInterrupt, EOFError):
        aborted = True
    code = ABORTED if aborted else record.exit_code()
    if code == GO and record.sign_off is None:
        code = INCOMPLETE
    _outputs(wish, record)
    screen.summary(record, _verdict(code, record), str(path))
    return code


def _verdict(code: int, record: Record) -> str:
    sign = record.sign_off
    signed = f", signed by {sign['operator']} at {sign['utc']}" if sign else ""
    if code == GO:
        return f"GO{signed}"
    if code == NO_GO:
        return f"NO-GO{signed}"
    if code == ABORTED:
        return "ABORTED: the same command goes on from here"
    unsigned = record.exit_code() == GO
    return "INCOMPLETE: not signed off" if unsigned else "INCOMPLETE: not everything is known"


def _context(wish: Wish) -> tuple[Context, dict[str, Any]]:
    rig, scenario = load_rig(wish.rig), load(wish.scenario)
    airframe = load_airframe(rig.vehicle.airframe)
    policy = wish.policy or rig.policy.kind
    file = policy_file(policy)
    if file is None or file.suffix != ".onnx":  # what is wrong with a file is an item of the list
        policy_factory(policy, airframe)
    context = Context(Path(wish.rig).stem, rig, policy, scenario, wish.out, wish.run, wish.endpoint, wish.keys)
    return context, subject(wish.rig, rig, policy, scenario)


def _begin(wish: Wish, checklist: Checklist, about: dict[str, Any]) -> tuple[Path, Record]:
    """The record to work on: the named one, an open one of today, or a new one."""
    now = datetime.now(UTC)
    if wish.record is not None and wish.record.exists():
        record = records.read(wish.record)
        if record.sign_off is not None:
            raise RecordError(f"{wish.record}: is signed already; name another file for a new record")
        if record.subject != about:
            other = ", ".join(k for k in about if record.subject.get(k) != about[k])
            raise RecordError(f"{wish.record}: is for another {other}; name another file for a new record")
        _say_resuming(wish.record, record)
        return wish.record, record
    if wish.record is None and not wish.fresh and wish.folder.is_dir():
        since = iso(now - GO_ON)
        found = records.find(
            wish.folder, lambda r: r.sign_off is None and r.subject == about and r.started_utc >= since
        )
        if found:
            _say_resuming(*found[0])
            return found[0]
    record = new_record(checklist, about)
    name = f"{now:%Y%m%dT%H%M%SZ}_{about['kind']}_{about['rig']}_{about['scenario']}"
    path = wish.record or wish.folder / f"{name}.json"
    number = 1
    while wish.record is None and path.exists():
        number += 1
        path = wish.folder / f"{name}-{number}.json"
    records.write(path, record)
    return path, record


def _say_resuming(path: Path, record: Record) -> None:
    kept = sum(entry.kind == "manual" and entry.utc != "" and passed(entry) for entry in record.entries)
    print(f"going on with {path}: {kept} answers kept, automatic items are checked again", file=sys.stderr)


def _outputs(wish: Wish, record: Record) -> None:
    if wish.as_json:
        print(json.dumps(record.as_dict(), allow_nan=False), flush=True)
    if wish.junit_file is not None:
        try:
            write_junit(wish.junit_file, record)
        except OSError as error:
            raise RecordError(f"{wish.junit_file}: cannot be written: {error.strerror}") from None


@contextmanager
def closing_devices(context: Context) -> Iterator[None]:
    """Wires are given back however the walk ends."""
    try:
        yield
    finally:
        context.forget()


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Two operators must not work on one record. The lock ends with the process, however that ends."""
    lock = path.with_name(f".{path.name}.lock")
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RecordError(f"{path}: another terminal is working on this record") from None
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def _login() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def print_names(as_json: bool) -> None:
    """The automatic checks: name, unit, arguments, what they read."""
    if as_json:
        rows = [
            {"name": c.name, "unit": c.unit, "arguments": [*c.arguments], "about": c.about} for c in checks().values()
        ]
        print(json.dumps(rows))
        return
    table = Table(box=box.SIMPLE_HEAD)
    for column in ("check", "unit", "arguments", "reads"):
        table.add_column(column, overflow="fold")
    for check in checks().values():
        table.add_row(check.name, check.unit, ", ".join(check.arguments), check.about)
    Console().print(table)
