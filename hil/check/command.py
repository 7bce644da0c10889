"""The command `perch-hil check`, from the names on the command line to the exit code."""

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

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from rich import box
from rich.console import Console
from rich.table import Table

from hil.assembly.rig import chosen_rig, load_rig
from hil.bench.devices import Context
from hil.check import records
from hil.check.catalogue import checks
from hil.check.checklist import Checklist, load_checklist
from hil.check.crew_key import load_crew_key
from hil.check.junit import write_junit
from hil.check.keyboard import Keyboard
from hil.check.moment import Moment
from hil.check.operator_terminal import OperatorTerminal
from hil.check.records import ABORTED, GO, INCOMPLETE, NO_GO, Record, RecordError, iso, passed
from hil.check.session import Session, new_record
from hil.check.subject import difference, list_subject, subject
from policies.flying.registry import policy_factory
from policies.flying.shipped import policy_file
from scenarios.spec import load
from vehicle.quadrotor.airframe import load_airframe

RESUME_WITHIN = timedelta(hours=12)  # an open record older than this is not resumed


@dataclass(frozen=True)
class CheckRequest:
    """The command line."""

    list_name: str
    rig: str | None  # None: the scenario's
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
    crew_key: Path | None = None  # signs the record


def run_checklist(request: CheckRequest) -> int:
    """Load the list, run it, sign, write and print the record; returns the exit code.

    Raises ValueError (ConfigError, RecordError) for a list, rig, policy, key or record that cannot be used,
    ProvenanceError for a checkout that git cannot describe, KeyboardInterrupt or EOFError if it is left before the
    first item.
    """
    key = load_crew_key(request.crew_key) if request.crew_key is not None else None
    checklist = load_checklist(request.list_name)
    context, about = _context(request)
    path, record = _open_record(request, checklist, list_subject(checklist, about))
    terminal = OperatorTerminal(Console(stderr=request.as_json), Keyboard(), request.operator or "")
    operator = request.operator or (terminal.operator(_login()) if terminal.interactive else "")
    session = Session(checklist, context, record, path, terminal, operator)
    with _locked(path), closing_devices(context):
        return _run_session(request, session, record, path, terminal, operator, key)


def _run_session(
    request: CheckRequest,
    session: Session,
    record: Record,
    path: Path,
    terminal: OperatorTerminal,
    operator: str,
    key: Ed25519PrivateKey | None,
) -> int:
    aborted, unbound = False, ""
    try:
        session.run()
        code = record.exit_code()
        unbound = session.bind() if code == GO else ""
        sign = request.sign and code == GO and not unbound
        if not sign and not unbound and terminal.interactive and code != INCOMPLETE:
            terminal.summary(record, _verdict(code, record), str(path))
            sign = terminal.sign(record)
        if sign:
            record.sign(operator, Moment.now(), key)
            records.write(path, record)
    except (KeyboardInterrupt, EOFError):
        aborted = True
    code = ABORTED if aborted else record.exit_code()
    if code == GO and record.sign_off is None:
        code = INCOMPLETE
    _outputs(request, record)
    terminal.summary(record, _verdict(code, record), str(path))
    if unbound:
        print(f"perch-hil: this go cannot be signed: {unbound}", file=sys.stderr)
    return code


def _verdict(code: int, record: Record) -> str:
    sign = record.sign_off
    how = "signed" if record.state == "signed" else "sealed"
    key = f" with key {sign['key']}" if sign and "key" in sign else ""
    signed = f", {how} by {sign['operator']}{key} at {sign['utc']}" if sign else ""
    if code == GO:
        return f"GO{signed}"
    if code == NO_GO:
        return f"NO-GO{signed}"
    if code == ABORTED:
        return "ABORTED: the same command resumes here"
    unsigned = record.exit_code() == GO
    return "INCOMPLETE: not signed off" if unsigned else "INCOMPLETE: not every item is known"


def _context(request: CheckRequest) -> tuple[Context, dict[str, Any]]:
    scenario = load(request.scenario)
    rig_name = chosen_rig(scenario, request.rig)
    rig = load_rig(rig_name)
    airframe = load_airframe(rig.vehicle.airframe)
    policy = request.policy or rig.policy.kind
    file = policy_file(policy)
    if file is None or file.suffix != ".onnx":  # faults of a file are found by an item of the list
        policy_factory(policy, airframe)
    context = Context(
        Path(rig_name).stem, rig, policy, scenario, request.out, request.run, request.endpoint, request.keys
    )
    return context, subject(rig_name, rig, policy, scenario)


def _open_record(request: CheckRequest, checklist: Checklist, about: dict[str, Any]) -> tuple[Path, Record]:
    """The record to use: the named one, a recent open one, or a new one."""
    now = datetime.now(UTC)
    if request.record is not None and request.record.exists():
        record = records.read(request.record)
        if record.sign_off is not None:
            raise RecordError(f"{request.record}: is already signed; name another file for a new record")
        if record.subject != about:
            names = ", ".join(k for k in about if record.subject.get(k) != about[k])
            other = difference(record.subject, about) or f"another {names}"
            raise RecordError(f"{request.record}: is for {other}; name another file for a new record")
        _print_resuming(request.record, record)
        return request.record, record
    if request.record is None and not request.fresh and request.folder.is_dir():
        since = iso(now - RESUME_WITHIN)
        found = records.find(
            request.folder, lambda r: r.sign_off is None and r.subject == about and r.started_utc >= since
        )
        if found:
            _print_resuming(*found[0])
            return found[0]
    record = new_record(checklist, about)
    name = f"{now:%Y%m%dT%H%M%SZ}_{about['kind']}_{about['rig']}_{about['scenario']}"
    path = request.record or request.folder / f"{name}.json"
    number = 1
    while request.record is None and path.exists():
        number += 1
        path = request.folder / f"{name}-{number}.json"
    records.write(path, record)
    return path, record


def _print_resuming(path: Path, record: Record) -> None:
    kept = sum(entry.kind == "manual" and entry.utc != "" and passed(entry) for entry in record.entries)
    print(f"resuming {path}: {kept} answers kept, automatic items are checked again", file=sys.stderr)


def _outputs(request: CheckRequest, record: Record) -> None:
    if request.as_json:
        print(json.dumps(record.as_dict(), allow_nan=False), flush=True)
    if request.junit_file is not None:
        try:
            write_junit(request.junit_file, record)
        except OSError as error:
            raise RecordError(f"{request.junit_file}: cannot be written: {error.strerror}") from None


@contextmanager
def closing_devices(context: Context) -> Iterator[None]:
    """Close the devices at the end, also after an error."""
    try:
        yield
    finally:
        context.forget()


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """One operator only may work on a record. The lock ends with the process."""
    lock = path.with_name(f".{path.name}.lock")
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RecordError(f"{path}: another terminal has this record open") from None
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
