"""The runs of a campaign: each a line, and what is counted together: by content, so that what has only its name in
common with others stands apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from hil.recording.manifest import board_known_by, clean_manifest, clean_score, nested
from hil.recording.provenance import content_sha256
from hil.recording.runs import Run
from hil.scoring.verdict import INCOMPLETE, verdict_word

_NOT_FLOWN = ("title", "crew_keys", "preflight")  # keys of a rig that change no flight


class Group(NamedTuple):
    """What a count is of. `camera`: pictures, or the paper's model of them. `rig`: empty if all runs had the same.
    `fault`: titles of the scenario's faults.

    A name is followed by the beginning of its content's digest where runs of that name differ in content.
    """

    scenario: str
    identity: str
    camera: str
    policy: str
    rig: str = ""
    fault: str = ""

    @property
    def ident(self) -> str:
        """For the page's links."""
        return "".join(c if c.isalnum() else "-" for c in "-".join(self))


@dataclass(frozen=True)
class Line:
    """One run of a campaign: its folder's name, manifest and score.

    `apart`: of scenario, rig and policy, those that another run has by the same name with another content.
    """

    name: str
    manifest: dict[str, Any]
    score: dict[str, Any]
    apart: frozenset[str] = frozenset()

    @property
    def group(self) -> Group:
        """Runs are counted together if all of this is the same."""
        return Group(
            self._label("scenario"),
            str(self.manifest.get("identity", "unknown")),
            board_known_by(self.manifest.get("rig")),
            self.policy,
            self._label("rig") if "rig" in self.apart else "",
            fault_titles(self.manifest),
        )

    def named(self, part: str) -> str:
        """Name of its `part`: scenario, rig or policy."""
        return str(nested(self.manifest, part).get("name", "unknown"))

    def digest(self, part: str) -> str:
        """Of the content of its `part`, beside its name and what is told otherwise."""
        content = {key: value for key, value in nested(self.manifest, part).items() if key != "path"}
        if part == "rig":
            camera = {key: value for key, value in nested(content, "camera").items() if key != "source"}
            content = {key: value for key, value in content.items() if key not in _NOT_FLOWN} | {"camera": camera}
        return content_sha256(content)

    def _label(self, part: str) -> str:
        return f"{self.named(part)} {self.digest(part)[:8]}" if part in self.apart else self.named(part)

    @property
    def policy(self) -> str:
        """Name, and of a file the beginning of its sha256: files of one name differ."""
        digest = nested(self.manifest, "policy").get("sha256")
        return f"{self.named('policy')} {str(digest)[:8]}" if digest else self._label("policy")

    @property
    def verdict(self) -> str:
        """One word of `hil.scoring.verdict`."""
        score = self.score
        return verdict_word(
            attached=score["attached"], within_tolerance=score["within_tolerance"], outcome=score["outcome"],
            state=str(self.manifest.get("state", "finished")),
        )  # fmt: skip

    @property
    def commit(self) -> str:
        """Of the code it was flown with; "+" if that was changed since."""
        code = nested(self.manifest, "code")
        return f"{str(code.get('commit') or code.get('version', 'unknown'))[:10]}{'+' if code.get('dirty') else ''}"


def fault_titles(manifest: Mapping[str, Any]) -> str:
    """The faults of a run's scenario by their titles, each once; empty without faults."""
    tables = nested(manifest, "scenario").get("fault") or ()
    titles = [str(table.get("name") or table.get("kind")) for table in tables if isinstance(table, Mapping)]
    return " + ".join(dict.fromkeys(titles))


def gather(runs: Sequence[Run]) -> tuple[list[Line], list[str]]:
    """The runs that count, and a line for each that does not. Raises RunError for an unreadable file."""
    lines, skipped = [], []
    for run in runs:
        notes: list[str] = []
        score, manifest = clean_score(run.score, notes), clean_manifest(run.manifest, notes)
        line = Line(run.path.name, manifest, score or {})
        if score is None:
            skipped.append(f"{line.name}: {notes[0] if notes else 'no score'}")
        elif line.verdict == INCOMPLETE:
            undecided = score["outcome"] == INCOMPLETE
            why = "ended before the referee decided" if undecided else f"its state is {manifest.get('state')}"
            skipped.append(f"{line.name}: {notes[0] if notes else why}")
        elif nested(score, "flight").get("not_begun"):
            skipped.append(f"{line.name}: {score['reasons'][-1]}")
        else:
            lines.append(line)
    return _told_apart(lines), skipped


def _told_apart(lines: Sequence[Line]) -> list[Line]:
    """The lines, each with the parts whose name does not say which content it was."""
    contents: dict[tuple[str, str], set[str]] = {}
    for line in lines:
        for part in ("scenario", "rig", "policy"):
            contents.setdefault((part, line.named(part)), set()).add(line.digest(part))
    parts = [
        frozenset(part for part, name in contents if len(contents[part, name]) > 1 and line.named(part) == name)
        for line in lines
    ]
    return [replace(line, apart=apart) for line, apart in zip(lines, parts, strict=True)]
