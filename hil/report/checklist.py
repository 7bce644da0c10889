"""The page of a checklist's record: what was found, what held it up, who signed it, and whether it is unchanged."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from markupsafe import Markup

from hil.check.judge import Outcome
from hil.check.records import GO, NO_GO, Entry, Record, passed, read
from hil.report.drawing.section import table
from hil.report.page import asset, template

_BADGE = {Outcome.FAIL: "error", Outcome.MARGINAL: "warning", Outcome.UNKNOWN: "warning"}
_HEAD = ("", "item", "found", "limit", "why, from where", "when, by")


def render(path: Path) -> str:
    """The page of the record at `path`. Raises RecordError if it is none."""
    record = read(path)
    held = [entry for entry in record.entries if not passed(entry)]
    groups = [(title, _table(list(members))) for title, members in groupby(record.entries, key=lambda e: e.group)]
    headline, css = _verdict(record)
    about = record.subject
    return template("checklist.html.j2").render(
        title=f"Checklist {path.stem}",
        headline=headline,
        css_class=css,
        facts=[
            ("list", about.get("list")),
            ("rig", about.get("rig")),
            ("scenario", about.get("scenario")),
            ("policy", _name(about.get("policy"))),
            ("begun", record.started_utc),
        ],
        sign=_sign(record),
        held=_table(held) if held else None,
        groups=groups,
        autopilot=_autopilot(record),
        css=Markup(asset("report.css")),
    )


def _verdict(record: Record) -> tuple[str, str]:
    code = record.exit_code()
    if record.sign_off is not None and not record.genuine():
        return "CHANGED after it was signed off", "bad"
    if code == NO_GO:
        return "NO-GO", "bad"
    if code == GO:
        return ("GO", "good") if record.sign_off else ("INCOMPLETE: not signed off", "warn")
    return "INCOMPLETE: not every item is known", "warn"


def _sign(record: Record) -> str:
    sign = record.sign_off
    if sign is None:
        return "without a signature"
    how = f"signed with key {sign['key']}" if "key" in sign else "sealed (a digest: no key of the crew signed it)"
    return f"{how}, by {sign['operator']} at {sign['utc']}"


def _table(entries: list[Entry]) -> Markup:
    rows: list[tuple[object, ...]] = []
    for entry in entries:
        badge = Markup('<span class="badge {}">{}</span>').format(
            _BADGE.get(entry.outcome, "info"), entry.outcome.value
        )
        remedy = entry.help if entry.outcome in (Outcome.FAIL, Outcome.MARGINAL) else ""
        why = "; ".join(part for part in (entry.reason, entry.detail, remedy, *entry.history) if part)
        source = f"{why} ({entry.source})" if entry.source and why else why or entry.source
        rows.append((badge, entry.title, entry.found, entry.limit, source, f"{entry.utc} {entry.operator}".strip()))
    return table(_HEAD, rows, "left wide")


def _autopilot(record: Record) -> Markup | None:
    """The real autopilot that the go is for; None without one."""
    rows: list[tuple[object, ...]] = [
        ("parameters that are held", len(value)) if isinstance(value, dict) else (name, value)
        for name, value in record.autopilot.items()
    ]
    return table(("", ""), rows, "left") if rows else None


def _name(policy: object) -> object:
    return policy.get("name") if isinstance(policy, dict) else policy
