"""How costs grow with their size: CPU seconds at several sizes, and the power of size with which the cost grows between
the larger ones. A cost with an exponent of at most 1.15 is called linear: noise of the machine is in it.

    python -m benchmarks.bench_growth
"""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from hil.assembly.plan import Plan
from hil.campaign.grid import Grid, check, left_to_do
from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.host.flight import fly
from hil.recording import provenance, runs_table
from hil.recording.mcap_writer import McapWriter
from hil.recording.reader import Recording
from hil.recording.recorder import PREFIX
from hil.recording.runs import MANIFEST, RECORDING, SCORE, list_runs
from hil.report import campaign
from hil.report.write import write_report
from policies.environment.config import EnvConfig
from policies.environment.env import Env

LINEAR = 1.15
FLOWN = Path(__file__).parents[1] / "tests" / "data" / "runs" / "simple-ii"
_ROWS = 100_000  # stepped for one time


@dataclass(frozen=True)
class Growth:
    """CPU seconds of `what` at each of `sizes`."""

    what: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]
    peak_mb: tuple[float, ...] = ()  # of memory, where it is measured

    @property
    def exponent(self) -> float:
        """By which the cost grows, over the larger two thirds of the sizes: what is constant hides there least."""
        upper = len(self.sizes) // 3
        size, cost = np.log(self.sizes[upper:]), np.log(self.seconds[upper:])
        return float(np.polyfit(size, cost, 1)[0])

    @property
    def linear(self) -> bool:
        """Whether the cost grows no faster than its size."""
        return self.exponent <= LINEAR

    def as_dict(self) -> dict:
        """For JSON."""
        return {**asdict(self), "exponent": self.exponent, "linear": self.linear}


def line(one: dict) -> str:
    """One line of a growth's table, for a terminal."""
    word = "linear or less" if one["linear"] else "MORE THAN LINEAR"
    sizes, seconds = one["sizes"], one["seconds"]
    ends = ", ".join(f"{sizes[i]:,}: {seconds[i]:.3g} s" for i in sorted({0, len(sizes) - 1}))
    return f"{one['what']:52s} {ends:34s} exponent {one['exponent']:5.2f}: {word}"


def grown(what: str, sizes: Sequence[int], cost: Callable[[int], float]) -> Growth:
    """`cost(size)` in CPU seconds at each size."""
    return Growth(what, tuple(sizes), tuple(cost(size) for size in sizes))


def timed(call: Callable[[], object]) -> float:
    """CPU seconds that `call` takes, of all threads: what other work on the machine changes least."""
    begun = time.process_time()
    call()
    return time.process_time() - begun


def least(call: Callable[[], object]) -> float:
    """The least of some `timed`."""
    return min(timed(call) for _ in range(3))


def environment_step(stage: str, count: int) -> float:
    """CPU seconds of one control step of `count` rows."""
    env = Env(EnvConfig(stage=stage, count=count, seed=1, horizon=80, future_stride=5))
    env.reset()
    actions = np.random.default_rng(1).normal(0.0, 0.1, (count, 4))
    env.step(actions)
    steps = max(1, _ROWS // count)  # the system counts the time of other threads in ticks of some milliseconds

    def some() -> None:
        for _ in range(steps):
            env.step(actions)

    return least(some) / steps


def report_costs(lengths: Sequence[int]) -> tuple[list[float], list[float]]:
    """CPU seconds of the report of recordings of so many seconds, and the largest memory of its process, MB."""
    costs = []
    with tempfile.TemporaryDirectory() as folder:
        plan = Plan("simple-ii", "sim", None, "model")
        flown = fly(
            plan.scenario, plan.rig, plan.make_policy(), 0, policy_name=plan.policy_name, rig_name="sim",
            pictures="none", out=Path(folder), code=provenance.code(), progress=lambda _now, _stage: None,
        )  # fmt: skip
        for seconds in lengths:
            run = longer_run(flown.run.path, Path(folder) / f"{seconds} s", seconds)
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                costs.append(process.submit(_report, run).result())
    return [seconds for seconds, _ in costs], [memory for _, memory in costs]


def _report(run: Path) -> tuple[float, float]:
    seconds = timed(lambda: write_report([run]))
    return seconds, largest_memory_mb()


def largest_memory_mb() -> float:
    """The largest memory of this process so far, MB.

    `getrusage` would give a new process the memory that its parent had when it started it.
    """
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0


def longer_run(flown: Path, folder: Path, seconds: int) -> Path:
    """A run of about `seconds` in `folder`: the messages of the run `flown`, repeated, each later by its length."""
    folder.mkdir()
    for name in (MANIFEST, SCORE):
        shutil.copy(flown / name, folder)
    recording, writer = Recording(flown), McapWriter(folder / RECORDING)
    kinds = {PREFIX + name: codec(topic.message) for name, topic in TOPICS.items() if PREFIX + name in recording.topics}
    channels = {topic: writer.channel(topic, kind.name, kind.schema) for topic, kind in kinds.items()}
    entries = list(recording.messages())
    length = entries[-1].log_ns - entries[0].log_ns + 1
    for turn in range(max(1, round(seconds * 1e9 / length))):
        for log_ns, name, message in entries:
            later, topic = replace(message, stamp_ns=message.stamp_ns + turn * length), PREFIX + name
            writer.add(channels[topic], log_ns + turn * length, kinds[topic].encode(later))
    writer.close()
    return folder


def list_seconds(count: int) -> float:
    """CPU seconds of `perch-hil runs list` on a folder of `count` runs."""
    with tempfile.TemporaryDirectory() as folder:
        _runs(Path(folder), count)
        return least(lambda: runs_table.table(runs_table.rows(Path(folder))))


def campaign_own_seconds(seeds: int) -> float:
    """CPU seconds of a campaign of `seeds` without its flights: what is left to do, and the page."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        _runs(out, seeds)
        grid = Grid(("simple-ii",), ("planner",), range(seeds), "sim", "pictures", "none", out)

        def work() -> None:
            left_to_do(grid, check(grid))
            campaign.render(list_runs(out))

        return least(work)


def _runs(out: Path, count: int) -> None:
    """`count` runs in `out`, without recordings, each of its own seed."""
    manifest, score = (json.loads((FLOWN / name).read_text()) for name in (MANIFEST, SCORE))
    for seed in range(count):
        run = out / f"20260101T000000Z_simple-ii_sim-seed{seed}"
        run.mkdir()
        (run / MANIFEST).write_text(json.dumps({**manifest, "seed": seed}))
        (run / SCORE).write_text(json.dumps({**score, "seed": seed}))


def measure(
    rows: Sequence[int], recordings: Sequence[int], folders: Sequence[int], seeds: Sequence[int]
) -> list[Growth]:
    """Every growth at the sizes given: rows, seconds, runs, seeds."""
    return [
        *(
            grown(f"a control step of the environment, {stage}, by rows", rows, partial(environment_step, stage))
            for stage in ("state", "vision")
        ),
        Growth("the report, by seconds recorded", tuple(recordings), *map(tuple, report_costs(recordings))),
        grown("the list of runs, by runs", folders, list_seconds),
        grown("a campaign without its flights, by seeds", seeds, campaign_own_seconds),
    ]


SIZES = ((256, 1024, 4096, 16384, 65536), (10, 60, 300, 1800), (10, 100, 1000, 10000), (1, 10, 100, 1000))

if __name__ == "__main__":
    for found in measure(*SIZES):
        print(line(found.as_dict()))
