"""The checklist on the operator's terminal: passed items are counted, the current one is shown. Texts carry
the meaning; colours only repeat it."""

from __future__ import annotations

from itertools import groupby

from rich.console import Console
from rich.text import Text

from hil.check.checklist import Item
from hil.check.judge import Outcome, Value
from hil.check.keyboard import Keyboard
from hil.check.records import Entry, Record, passed
from hil.check.session import Answer

_STYLE = {
    Outcome.PASS: "bold green",
    Outcome.MARGINAL: "bold yellow",
    Outcome.FAIL: "bold white on red",
    Outcome.UNKNOWN: "bold magenta",
    Outcome.SKIPPED: "bold",
    Outcome.PENDING: "",
}
_QUIET = (Outcome.PASS, Outcome.SKIPPED)


class OperatorTerminal:
    """A `OperatorInterface` on a terminal; without a terminal one line per item."""

    def __init__(self, console: Console, keyboard: Keyboard, operator: str) -> None:
        self.interactive = keyboard.present and console.is_terminal
        self._console, self._keyboard, self._operator = console, keyboard, operator

    def show(self, record: Record, at: int) -> None:
        if self.interactive:
            self._draw(record, at)
            if record.entries[at].kind == "automatic":
                self._console.print(Text("checking ...", style="bold"))

    def done(self, record: Record, at: int) -> None:
        if not self.interactive:
            self._console.print(entry_line(record.entries[at]))

    def ask(self, record: Record, at: int, item: Item) -> Answer:
        keys = [("p", "pass") if not item.asks_number else ("m", "enter the number"), ("f", "fail")]
        keys += [] if item.must else [("s", "skip")]
        keys += [("b", "back"), ("q", "stop here")]
        while True:
            pressed = self._press(keys)
            if pressed == "q":
                raise KeyboardInterrupt
            if pressed == "b":
                return Answer(Outcome.PENDING)
            if pressed == "p":
                return Answer(Outcome.PASS)
            if pressed == "m":
                number = self._number(record.entries[at])
                if number is not None:
                    return Answer(Outcome.PASS, value=number)
            elif pressed in "fs":
                outcome = Outcome.FAIL if pressed == "f" else Outcome.SKIPPED
                reason = self._keyboard.line(f"{'Skip' if pressed == 's' else 'Fail'}: why? (empty: back) ")
                if reason:
                    return Answer(outcome, reason)

    def try_again(self, record: Record, group: str) -> bool:
        self._draw(record, None, group)
        self._console.print(Text(f"{group}: did not pass.", style="bold"))
        return self._press([("r", "try what did not pass again"), ("q", "stop here")]) == "r"

    def sign(self, record: Record) -> bool:
        """Ask for the sign-off."""
        return self._press([("y", f"sign as {self._operator}"), ("n", "leave it unsigned")]) == "y"

    def operator(self, proposed: str) -> str:
        """Ask for the operator's name."""
        self._operator = self._keyboard.line(f"Your name [{proposed}]: ") or proposed
        return self._operator

    def summary(self, record: Record, verdict: str, path: str) -> None:
        """The end: verdict, items that did not pass, path of the record."""
        if self.interactive:
            self._clear()
        print_summary(self._console, record, verdict, path)

    def _press(self, keys: list[tuple[str, str]]) -> str:
        return self._keyboard.key("".join(key for key, _ in keys), lambda: self._console.print(_keys(keys)))

    def _number(self, entry: Entry) -> Value | None:
        text = self._keyboard.line(f"Value{f' in {entry.unit}' if entry.unit else ''}: ").replace(",", ".")
        try:
            return float(text)
        except ValueError:
            self._console.print(f"{text!r} is no number" if text else "nothing entered")
            return None

    def _draw(self, record: Record, at: int | None, group: str = "") -> None:
        self._clear()
        current = record.entries[at].group if at is not None else group
        console = self._console
        console.print(heading(record))
        after_current = False
        for number, (title, entries) in enumerate(groupby(record.entries, key=lambda e: e.group), start=1):
            members = list(entries)
            if title == current:
                console.print(Text(f"{number}. {title}", style="bold underline"))
                _print_group(console, members)
                if at is not None:
                    _print_current(console, record.entries[at])
                after_current = True
            elif after_current:
                console.print(f"{number}. {title}: closed, {len(members)} items")
            else:
                console.print(f"{number}. {title}: {_counts(members)}")
        console.print()

    def _clear(self) -> None:
        if not self._console.is_dumb_terminal:
            self._console.clear()


def heading(record: Record) -> Text:
    """One line: list, rig, policy and scenario."""
    s = record.subject
    return Text(f"{s['list']}  |  rig {s['rig']}, policy {s['policy']['name']}, scenario {s['scenario']}", style="bold")


def entry_line(entry: Entry) -> Text:
    """One item on one line (or as few as the width allows)."""
    line = Text()
    line.append(f"{entry.outcome.value:<8}", style=_STYLE[entry.outcome])
    line.append(f" {entry.title}")
    if entry.value is not None:
        line.append(f": {entry.found}")
    if entry.limit and entry.outcome is not Outcome.SKIPPED:
        line.append(f" ({entry.limit})")
    remedy = entry.help if entry.outcome in (Outcome.FAIL, Outcome.MARGINAL) else ""
    reason = "" if entry.limit and entry.reason == f"must be {entry.limit}" else entry.reason
    text = "; ".join(part for part in (reason, entry.detail, remedy) if part)
    if text:
        line.append(f" - {text}")
    return line


def print_summary(console: Console, record: Record, verdict: str, path: str) -> None:
    """See `OperatorTerminal.summary`."""
    console.print(heading(record))
    for entry in record.entries:
        own = entry.outcome is Outcome.SKIPPED and entry.source != "operator"  # does not apply to this rig
        if entry.outcome not in (Outcome.PASS, Outcome.PENDING) and not own:
            console.print(entry_line(entry))
    console.print(Text(_counts(record.entries)))
    style = {"GO": "bold green", "NO-GO": "bold white on red"}.get(verdict.split(":")[0].split(",")[0], "bold yellow")
    console.print(Text(verdict, style=style))
    console.print(f"record: {path}", soft_wrap=True, highlight=False)


def _print_group(console: Console, members: list[Entry]) -> None:
    quiet = sum(entry.outcome in _QUIET for entry in members)
    if quiet:
        console.print(f"   {_counts([e for e in members if e.outcome in _QUIET])}")
    for entry in members:
        if entry.outcome not in (*_QUIET, Outcome.PENDING):
            console.print(entry_line(entry))


def _print_current(console: Console, entry: Entry) -> None:
    console.print()
    console.print(Text(f"> {entry.title}", style="bold"))
    if entry.limit:
        console.print(f"  limit: {entry.limit}", highlight=False)
    if entry.help and entry.kind == "manual":
        console.print(f"  {entry.help}", highlight=False)
    if entry.history:
        console.print(f"  before: {entry.history[-1]}", highlight=False)


def _counts(entries: list[Entry]) -> str:
    names = {Outcome.PASS: "passed", Outcome.FAIL: "failed", Outcome.PENDING: "not reached"}
    parts = [
        f"{count} {names.get(outcome, outcome.value.lower())}"
        for outcome in Outcome
        if (count := sum(entry.outcome is outcome for entry in entries))
    ]
    held = sum(not passed(entry) and entry.outcome is not Outcome.PENDING for entry in entries)
    return ", ".join(sorted(parts, key=lambda part: "passed" not in part)) + (
        f"; {held} hold{'s' if held == 1 else ''} it up" if held else ""
    )


def _keys(keys: list[tuple[str, str]]) -> Text:
    line = Text()
    for key, meaning in keys:
        line.append(f" {key} ", style="bold reverse")
        line.append(f" {meaning}   ")
    return line
