"""The runs of a campaign: each a line, and what is counted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from hil.recording.manifest import clean_manifest, clean_score, nested
from hil.recording.runs import Run
from hil.scoring.verdict import INCOMPLETE, verdict_word


class Group(NamedTuple):
    """What a count is of. `camera`: pictures, or the paper's model of them."""

    scenario: str
    identity: str
    camera: str
    policy: str

    @property
    def ident(self) -> str:
        """For the page's links."""
        return "".join(c if c.isalnum() else "-" for c in "-".join(self))


@dataclass(frozen=True)
class Line:
    """One run of a campaign: its folder's name, manifest and score."""

    name: str
    manifest: dict[str, Any]
    score: dict[str, Any]

    @property
    def group(self) -> Group:
        """Runs are counted together if all of this is the same."""
        return Group(
            str(nested(self.manifest, "scenario").get("name", "unknown")),
            str(self.manifest.get("identity", "unknown")),
            str(nested(self.manifest, "rig", "camera").get("source", "unknown")),
            self.policy,
        )

    @property
    def policy(self) -> str:
        """Name, and of a file the beginning of its sha256: files of one name differ."""
        policy = nested(self.manifest, "policy")
        digest = f" {str(policy['sha256'])[:8]}" if policy.get("sha256") else ""
        return f"{policy.get('name', 'unknown')}{digest}"

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
        else:
            lines.append(line)
    return lines, skipped
