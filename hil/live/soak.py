"""Soak test: one long live run that checks that neither memory nor lateness of any service grows.

The scenario's lead is stretched: the vehicle hovers and the car drives with all nodes at full rate; then the attempt is
flown as in any run.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from rich import box
from rich.table import Table

from kernel.toml_errors import ConfigError
from scenarios.spec import FOLDER, load

SAMPLE_S = 2.0
SETTLE_S = 20.0  # of a run in which buffers and caches still fill
MEMORY_KB = 2048.0  # growth from the first third to the last that is none, with as many hundredths of the whole:
MEMORY_SHARE = 0.02
LATE_SHARE = 0.02  # of a node's steps, more of them late in the last third than in the first


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample of one service. `steps` and `late` count since its start, over its nodes, missed ones among both."""

    at_s: float
    own_kb: float
    steps: int
    late: int


@dataclass(frozen=True, slots=True)
class Verdict:
    """What one service did. `early` and `last`: shares of late steps in the first and the last third of the run."""

    service: str
    own_kb: float
    growth_kb: float
    early: float
    last: float
    faults: tuple[str, ...]


class Samples:
    """Samples of every service from the lead on, when every node of a run works."""

    def __init__(self) -> None:
        self.samples: dict[str, list[Sample]] = {}
        self.shared: list[tuple[float, int]] = []  # s, files that the run's processes hold in shared memory
        self._next_s = float("inf")

    def stage(self, _: int, name: str) -> None:
        """The run's progress."""
        if name == "lead" and self._next_s == float("inf"):
            self._next_s = 0.0

    def look(self, health: Mapping[str, Mapping[str, Any]], at_s: float) -> None:
        """Take a sample of every service each `SAMPLE_S` seconds; may be called much more often."""
        if at_s < self._next_s:
            return
        self._next_s = at_s + SAMPLE_S
        self.shared.append((at_s, len({name for table in health.values() for name in table.get("memory", ())})))
        for service, table in list(health.items()):
            if "own_kb" in table:
                paces = list(table.get("nodes", {}).values())
                steps, late, missed = (sum(pace.get(key, 0) for pace in paces) for key in ("steps", "late", "missed"))
                sample = Sample(at_s, float(table["own_kb"]), steps + missed, late + missed)
                self.samples.setdefault(service, []).append(sample)


def judge(service: str, samples: Sequence[Sample]) -> Verdict:
    """Compare the last third of a service's samples with the first, without those before `SETTLE_S`."""
    settled = [sample for sample in samples if sample.at_s >= samples[0].at_s + SETTLE_S]
    third = len(settled) // 3
    if third < 2:
        return Verdict(service, samples[-1].own_kb, 0.0, 0.0, 0.0, ("too short to tell",))
    first, last = settled[:third], settled[-third:]
    before, after = (median(sample.own_kb for sample in part) for part in (first, last))
    early, late = _late(first), _late(last)
    faults = []
    if after - before > MEMORY_KB + MEMORY_SHARE * before:
        faults.append(f"memory grew by {(after - before) / 1024:.1f} MB")
    if late > early + LATE_SHARE and late > 1.5 * early:
        faults.append(f"late steps grew from {early:.1%} to {late:.1%}")
    return Verdict(service, after, after - before, early, late, tuple(faults))


def judge_shared(counts: Sequence[tuple[float, int]]) -> list[Verdict]:
    """A fault if more files were held in shared memory in the last third than ever in the first.

    What is there at the end is no fault: the run removes it. Zenoh's hub, which is the last to hold the pictures' pool,
    leaves that file behind when it ends in good order.
    """
    settled = [count for at_s, count in counts if at_s >= counts[0][0] + SETTLE_S]
    third = len(settled) // 3
    if third == 0 or max(settled[-third:]) <= max(settled[:third]):
        return []
    grown = f"files in shared memory grew from {max(settled[:third])} to {max(settled[-third:])}"
    return [Verdict("bus", 0.0, 0.0, 0.0, 0.0, (grown,))]


def _late(part: Sequence[Sample]) -> float:
    steps = part[-1].steps - part[0].steps
    return (part[-1].late - part[0].late) / steps if steps > 0 else 0.0


def table(verdicts: Sequence[Verdict]) -> Table:
    """For the console."""
    made = Table(box=box.SIMPLE_HEAD)
    for column in ("service", "memory MB", "growth MB", "late, first third", "last third", ""):
        made.add_column(column, justify="left" if column in ("service", "") else "right")
    for one in verdicts:
        made.add_row(
            one.service, f"{one.own_kb / 1024:.1f}", f"{one.growth_kb / 1024:+.1f}", f"{one.early:.1%}",
            f"{one.last:.1%}", "; ".join(one.faults), style="yellow" if one.faults else "",
        )  # fmt: skip
    return made


def stretched(scenario: str, minutes: float, folder: Path) -> Path:
    """The scenario with a lead of `minutes`, as a file in `folder`. Raises ConfigError for an unknown one."""
    load(scenario)
    source = Path(scenario) if scenario.endswith(".toml") else FOLDER / f"{scenario.lower().replace('-', '_')}.toml"
    text, lead = source.read_text(encoding="utf-8"), f"lead = {minutes * 60:.1f}"
    text, found = re.subn(r"(?m)^lead\s*=.*$", lead, text)
    if not found:
        text = re.sub(r"(?m)^\[car\]\s*$", f"[car]\n{lead}", text) if "[car]" in text else f"{text}\n[car]\n{lead}\n"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"soak-{source.stem}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def soak(scenario: str, minutes: float, out: Path, seed: int = 0) -> tuple[list[Verdict], str, Path]:
    """Run for `minutes` and judge: verdicts, what else went wrong (empty if nothing), the run's folder.

    Raises ConfigError, and what a live run raises.
    """
    from hil.assembly.plan import Plan
    from hil.live.liveness import footprint
    from hil.live.run import fly_live
    from hil.recording import provenance

    path = stretched(scenario, minutes, out)
    names: dict[str, Any] = {"scenario": str(path.resolve()), "rig": None, "policy": None, "camera": None}
    plan = Plan(**names)
    if not plan.rig.simulated:
        raise ConfigError(f'rig "{plan.rig_name}" has real devices: a soak is all simulated')
    samples = Samples()
    live = fly_live(
        plan, names, seed, pictures="preview", out=out, code=provenance.code(), progress=samples.stage,
        watch=lambda supervisor: samples.look({**supervisor.health, "supervisor": footprint()}, time.monotonic()),
    )  # fmt: skip
    verdicts = [judge(service, samples) for service, samples in sorted(samples.samples.items())]
    trouble = "interrupted" if live.flight.interrupted else live.summary["ended"]["trouble"]
    verdicts += judge_shared(samples.shared)
    return verdicts, trouble, live.flight.run.path
