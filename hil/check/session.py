"""Runs a checklist: groups, automatic items and questions. The record is on disk before and after each item."""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple, Protocol

from hil.bench.devices import Context
from hil.bench.reading import NotApplicable, Unavailable
from hil.check import records
from hil.check.catalogue import checks
from hil.check.checklist import Checklist, Item
from hil.check.judge import Judgement, Outcome, Reading, Value, judge
from hil.check.records import Entry, Record, iso, passed
from hil.check.subject import list_subject


class Answer(NamedTuple):
    """The operator's answer to a manual item. `outcome` PENDING: return to the previous one."""

    outcome: Outcome
    reason: str = ""
    value: Value | None = None


class OperatorInterface(Protocol):
    """Shows items to the operator and asks. `interactive` False: there is no operator."""

    interactive: bool

    def show(self, record: Record, at: int) -> None:
        """Item `at` is begun."""
        ...

    def done(self, record: Record, at: int) -> None:
        """Item `at` has its outcome."""
        ...

    def ask(self, record: Record, at: int, item: Item) -> Answer:
        """The operator's answer. Raises KeyboardInterrupt or EOFError if there will be none."""
        ...

    def try_again(self, record: Record, group: str) -> bool:
        """The group did not pass: True if the failed items are to be tried again."""
        ...


class Session:
    """One session of an operator with a record."""

    def __init__(
        self,
        checklist: Checklist,
        context: Context,
        record: Record,
        path: Path,
        interface: OperatorInterface,
        operator: str,
    ) -> None:
        self._checklist, self._context, self._record, self._path = checklist, context, record, path
        self._operator_interface, self._operator = interface, operator
        self._checks = checks()
        self._items = [checklist.group[g].item[i] for g, i, _ in checklist.places()]

    def run(self) -> None:
        """Run the groups until the end or until a group does not pass.

        KeyboardInterrupt and EOFError are passed on; the record on disk then holds all complete items. Raises
        RecordError if it cannot be written.
        """
        record = self._record
        for entry in record.entries:
            again = entry.kind == "automatic" or entry.outcome in (Outcome.FAIL, Outcome.UNKNOWN)
            if again and entry.outcome is not Outcome.PENDING:
                entry.reset()
        record.sessions.append({"utc": iso(_now()), "operator": self._operator})
        self._write()
        start = 0
        for group in self._checklist.group:
            places = range(start, start + len(group.item))
            start += len(group.item)
            if not self._group(group.title, places):
                return

    def bind(self) -> str:
        """Note in the record of a go which real autopilot it is for; returns why that cannot be told, or nothing."""
        if self._checklist.kind == "preflight":
            try:
                self._record.autopilot = self._context.autopilot()
            except Unavailable as error:
                return str(error)
        return ""

    def _group(self, title: str, places: range) -> bool:
        entries = self._record.entries
        while True:
            at = places.start
            while at < places.stop:
                if entries[at].outcome is Outcome.PENDING:
                    at = self._item(at, places)
                else:
                    at += 1
            if all(passed(entries[i]) for i in places):
                return True
            if not (self._operator_interface.interactive and self._operator_interface.try_again(self._record, title)):
                return False
            self._context.forget()
            for i in places:
                if not passed(entries[i]):
                    entries[i].reset()
            self._write()

    def _item(self, at: int, places: range) -> int:
        """Run one item; returns the index of the next one."""
        entry, item = self._record.entries[at], self._items[at]
        self._operator_interface.show(self._record, at)
        began = time.monotonic()
        if not item.applies(self._context.rig):
            what = f"a {item.when} {item.device or 'rig'}"
            self._settle(entry, Judgement(Outcome.SKIPPED, None, f"for {what} only"), Reading())
        elif item.check:
            self._automatic(entry, item)
        elif not self._operator_interface.interactive:
            self._settle(entry, Judgement(Outcome.UNKNOWN, None, "there is no operator to ask"), Reading())
        else:
            answer = self._operator_interface.ask(self._record, at, item)
            if answer.outcome is Outcome.PENDING:
                return self._previous_question(at, places)
            self._manual(entry, item, answer)
        entry.utc, entry.seconds, entry.operator = iso(_now()), round(time.monotonic() - began, 3), self._operator
        self._write()
        self._operator_interface.done(self._record, at)
        return at + 1

    def _previous_question(self, at: int, places: range) -> int:
        for earlier in range(at - 1, places.start - 1, -1):
            if self._items[earlier].ask:
                self._record.entries[earlier].reset()
                self._write()
                return earlier
        return at

    def _automatic(self, entry: Entry, item: Item) -> None:
        try:
            reading = self._checks[item.check].function(self._context, **item.args)
        except Unavailable as error:
            self._settle(entry, Judgement(Outcome.UNKNOWN, None, str(error)), Reading())
        except NotApplicable as error:
            self._settle(entry, Judgement(Outcome.SKIPPED, None, str(error)), Reading())
        except Exception as error:  # an error in one check must not end the record or the other checks
            why = f"the check raised {type(error).__name__}: {error}"
            self._settle(entry, Judgement(Outcome.UNKNOWN, None, why), Reading())
        else:
            self._settle(entry, judge(reading, item.limits, entry.unit), reading)

    def _manual(self, entry: Entry, item: Item, answer: Answer) -> None:
        reading = Reading(answer.value, "", "operator", ok=True)
        if answer.outcome is Outcome.PASS and item.asks_number:
            if answer.value is None:
                judgement = Judgement(Outcome.FAIL, None, "limits are given, but no value was entered")
            else:
                judgement = judge(reading, item.limits, entry.unit)
        else:
            judgement = Judgement(answer.outcome, None, answer.reason)
        self._settle(entry, judgement, reading)

    @staticmethod
    def _settle(entry: Entry, judgement: Judgement, reading: Reading) -> None:
        value = reading.value
        if isinstance(value, float):
            value = float(f"{value:.6g}") if math.isfinite(value) else None
        margin = judgement.margin
        entry.outcome, entry.reason = judgement.outcome, judgement.reason
        entry.margin = None if margin is None else float(f"{margin:.6g}")
        entry.value, entry.source = value, reading.source
        entry.detail = "" if reading.detail == judgement.reason else reading.detail

    def _write(self) -> None:
        records.write(self._path, self._record)


def new_record(checklist: Checklist, subject: dict) -> Record:
    """A record with every item pending. `subject`: what it clears; the list's identity is added."""
    known, entries = checks(), []
    for g, i, key in checklist.places():
        group, item = checklist.group[g], checklist.group[g].item[i]
        title = item.title or item.ask or known[item.check].about.rstrip(".")
        unit = item.unit or (known[item.check].unit if item.check else "")
        entries.append(
            Entry(
                key=key,
                group=group.title,
                title=title,
                kind="automatic" if item.check else "manual",
                must=item.must,
                optional=item.optional,
                limit=item.limits.text(unit),
                limits={k: v for k, v in item.limits.model_dump().items() if v is not None},
                unit=unit,
                help=item.help,
            )
        )
    return Record(list_subject(checklist, subject), iso(_now()), entries)


def _now() -> datetime:
    return datetime.now(UTC)
