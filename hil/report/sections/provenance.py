"""Origin of the run: code, packages, policy and rig; values that were not default; the recording itself."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from markupsafe import Markup
from pydantic import ValidationError

from hil.assembly.rig import Rig
from hil.recording import autopilot_parameters as ap
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded
from scenarios.spec import list_scenarios
from scenarios.spec import load as load_scenario

_SHOWN = ("identity", "state", "host", "seed")
_TABLES = ("scenario", "rig", "code", "policy", "packages", "machine", "wall_clock", "format", ap.TABLE, *_SHOWN)


def build(recorded: Recorded) -> Section:
    section = Section("provenance", "Provenance")
    manifest = recorded.manifest
    if not manifest:
        section.text(
            "No manifest: nothing is known of the code, the policy, the rig and the machine of this recording."
        )
        section.html(table(("", ""), [*_recording(recorded)], "left"))
        return section
    rows: list[tuple[object, ...]] = [(key, manifest[key]) for key in _SHOWN if key in manifest]
    for key in ("policy", "code", "wall_clock", "machine"):
        rows += [
            (f"{key}.{name}", f"{value:.6g}" if isinstance(value, float) else value)
            for name, value in _flat(manifest.get(key, {}))
            if not name.startswith("untracked")
        ]
    rows += [("code.untracked", f"{len(untracked)} files git knew nothing of") for untracked in _untracked(manifest)]
    section.html(table(("", ""), [*rows, *_recording(recorded)], "left"))
    for title, changed in _changes(manifest):
        section.html(Markup("<h3>{}</h3>").format(title))
        if changed:
            section.html(table(("parameter", "this run", "default"), changed, "left"))
        else:
            section.text("None: everything is as it ships.")
    _autopilot(section, recorded)
    extra = {key: value for key, value in manifest.items() if key not in _TABLES}
    for key, value in extra.items():
        section.html(_folded(key.replace("_", " "), [*_flat(value)]))
    section.html(_folded("packages", list(manifest.get("packages", {}).items())))
    section.html(_folded("scenario", [*_flat(manifest.get("scenario", {}))]))
    section.html(_folded("rig", [*_flat(manifest.get("rig", {}))]))
    return section


def _recording(recorded: Recorded) -> Iterator[tuple[object, ...]]:
    first, last = recorded.span_ns
    messages = sum(len(c) for c in recorded.topics.values())
    yield (
        "recording",
        f"{recorded.path.name}: {recorded.path.stat().st_size / 1e6:.2f} MB, {messages} messages, "
        f"{(last - first) / 1e9:.1f} s",
    )
    yield (
        "recording is complete",
        "yes" if recorded.recording.complete and not recorded.recording.faults else "no, see the top of the page",
    )
    if recorded.score and recorded.rescored:
        same = json.loads(json.dumps(recorded.rescored.as_dict())) == recorded.score
        yield (
            "score.json against the recording",
            "agrees" if same else "DIFFERS: scoring the recording again gives other numbers",
        )


def _autopilot(section: Section, recorded: Recorded) -> None:
    """Parameters that the driver read from the autopilot: from the manifest, else from the recording."""
    section.html(Markup("<h3>{}</h3>").format("Autopilot parameters that are not default"))
    held = ap.of_run(recorded.manifest)
    if not held and ap.TOPIC in recorded.topics:
        held = ap.latest(recorded.topics[ap.TOPIC].messages)
    if not held:
        section.text("Neither manifest nor recording holds autopilot parameters: which were not default is unknown.")
        return
    rows = [(c.name, c.value, "no such parameter" if c.other is None else c.other) for c in ap.not_default(held)]
    if rows:
        section.html(table(("parameter", "this run", f"default ({ap.BASE})"), [*rows], "left"))
    else:
        section.text(f"None of the {len(held)} that were read: all are as in {ap.BASE}.")
    section.html(_folded(f"autopilot: all {len(held)} parameters that were read", sorted(held.items())))


def _untracked(manifest: dict[str, Any]) -> list[Any]:
    untracked = manifest.get("code", {}).get("untracked")
    return [untracked] if untracked else []


def _changes(manifest: dict[str, Any]) -> Iterator[tuple[str, list[tuple[object, ...]]]]:
    scenario = manifest.get("scenario", {})
    name = scenario.get("name")
    if name in list_scenarios():
        shipped = load_scenario(name).model_dump(mode="json")
        yield f"Scenario parameters that are not those of {name} as it ships", _differences(scenario, shipped)
    try:
        rig = {key: value for key, value in manifest.get("rig", {}).items() if key != "name"}
        defaults = Rig(title=str(rig.get("title", ""))).model_dump(mode="json")
    except ValidationError:
        return
    yield "Rig parameters that are not default", _differences(rig, defaults)


def _differences(ours: dict[str, Any], theirs: dict[str, Any]) -> list[tuple[object, ...]]:
    a, b = dict(_flat(ours)), dict(_flat(theirs))
    keys = [*a, *(key for key in b if key not in a)]
    return [(key, a.get(key, "not set"), b.get(key, "no such parameter")) for key in keys if a.get(key) != b.get(key)]


def _flat(value: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{at}.{key}" if at else str(key))
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for i, inner in enumerate(value):
            yield from _flat(inner, f"{at}[{i}]")
    else:
        yield at, value


def _folded(title: str, rows: list[Any]) -> Markup:
    return Markup("<details><summary>{}</summary>{}</details>").format(title, table(("", ""), rows, "left"))
