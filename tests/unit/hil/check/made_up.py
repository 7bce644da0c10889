"""Checklists for tests, a scripted operator, and checks with scripted results."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil.assembly.rig import load_rig
from hil.bench.devices import Context
from hil.check import registry
from hil.check.checklist import Checklist
from hil.check.judge import Outcome, Reading
from hil.check.records import Record
from hil.check.session import Answer, Session, new_record
from hil.check.subject import subject
from scenarios.spec import load

PASS = Answer(Outcome.PASS)


@contextmanager
def registered(name: str, function: Callable[..., Reading], unit: str = ""):
    """A check that exists for the test only."""
    registry.check(name, unit)(function)
    try:
        yield
    finally:
        del registry.REGISTERED[name]


def checklist(*groups: list[dict[str, Any]], kind: str = "preflight") -> Checklist:
    """Groups of items called one, two, ..."""
    names = ("one", "two", "three", "four")
    made = [{"title": name, "item": items} for name, items in zip(names, groups, strict=False)]
    return Checklist.model_validate({"title": "made up", "kind": kind, "group": made})


def context(tmp_path: Path) -> Context:
    """All simulated."""
    return Context("sim", load_rig("sim"), "planner", load("simple-i"), tmp_path)


def record_of(made: Checklist) -> Record:
    """Everything pending."""
    return new_record(made, subject("sim", load_rig("sim"), "planner", load("simple-i")))


class Operator:
    """Answers from a script: by title, one answer a question; an exception is raised."""

    interactive = True

    def __init__(self, answers: dict[str, list[Any]] | None = None, again: int = 0) -> None:
        self.answers, self.again = answers or {}, again
        self.asked: list[str] = []
        self.seen: list[str] = []

    def show(self, record: Record, at: int) -> None:
        self.seen.append(record.entries[at].key)

    def done(self, record: Record, at: int) -> None:
        pass

    def ask(self, record: Record, at: int, item: Any) -> Answer:
        self.asked.append(item.ask)
        answer = self.answers.get(item.ask, [PASS]).pop(0) if self.answers.get(item.ask) else PASS
        if isinstance(answer, Answer):
            return answer
        raise answer

    def try_again(self, record: Record, group: str) -> bool:
        self.again -= 1
        return self.again >= 0


class NoOperator(Operator):
    """No terminal."""

    interactive = False


def run_session(
    made: Checklist, record: Record, tmp_path: Path, interface: Operator | None = None, who: str = "Ann"
) -> Operator:
    """One sitting; the record is at record.json."""
    interface = interface or Operator()
    Session(made, context(tmp_path), record, tmp_path / "record.json", interface, who).run()
    return interface
