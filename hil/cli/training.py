"""One training run from the command line: progress, saving on Ctrl-C, and the command that continues it."""

from __future__ import annotations

import shlex
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hil.cli.options import INTERRUPTED, OK
from hil.cli.screen import print_json
from policies.training.learners.storage import TrainingError, read_curve
from policies.training.recipe import Recipe, load_recipe
from policies.training.run import CURVE, PICTURE, run

_LINE_EVERY = 30.0  # s between lines where there is no terminal
_FEWEST = 20  # episodes that make a share


@dataclass(frozen=True)
class Request:
    """Options from the command line."""

    stage: str
    recipe: str
    airframe: str
    changes: tuple[str, ...]
    seed: int
    out: Path
    resume: bool
    parent: Path | None
    device: str
    as_json: bool = False

    def again(self) -> str:
        """The command that goes on with this run."""
        words = [
            "perch-hil",
            "policy",
            "train",
            "--stage",
            self.stage,
            "--recipe",
            self.recipe,
            "--airframe",
            self.airframe,
        ]
        words += [word for change in self.changes for word in ("--set", change)]
        words += ["--seed", str(self.seed), "--out", str(self.out), "--device", self.device, "--resume"]
        return shlex.join(words)


class _Stop:
    """True once a signal asked the run to end; a later Ctrl-C ends it at once, without saving."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._asked = False

    def __call__(self) -> bool:
        return self._asked

    def _ask(self, number: int, _frame: object) -> None:
        if self._asked and number == signal.SIGINT:
            raise KeyboardInterrupt
        self._asked = True
        self._console.print(f"{signal.Signals(number).name}: saving after this iteration; Ctrl-C ends it without")

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Catch Ctrl-C and SIGTERM within."""
        before = {number: signal.signal(number, self._ask) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _Display:
    """A bar a phase on a terminal; elsewhere a line now and then."""

    def __init__(self, console: Console, plan: Recipe) -> None:
        text = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[status]}")
        off = not console.is_terminal
        self.progress = Progress(*text, TimeElapsedColumn(), TimeRemainingColumn(), console=console, disable=off)
        kinds = [f"{k + 1}/{len(plan.phase)} {phase.kind}" for k, phase in enumerate(plan.phase)]
        self._tasks = [self.progress.add_task(kind, total=1.0, status="", start=False) for kind in kinds]
        self._console, self._kinds, self._printed_s = console, kinds, 0.0
        self._phase, self._from = -1, (0, 0.0)
        self._hits = self._episodes = 0.0  # of the phase's last iterations, older ones counting less

    def __call__(self, numbers: dict) -> None:
        phase, samples, seconds = numbers["phase"], numbers["samples"], numbers["seconds"]
        if phase != self._phase:
            self._phase, self._from, self._hits, self._episodes = phase, (samples, seconds), 0.0, 0.0
            for before in self._tasks[:phase]:
                self.progress.update(before, completed=1.0)
            self.progress.start_task(self._tasks[phase])
        if numbers["episodes"]:
            self._hits = 0.9 * self._hits + numbers["success"] * numbers["episodes"]
            self._episodes = 0.9 * self._episodes + numbers["episodes"]
        since = seconds - self._from[1]
        rate = f", {(samples - self._from[0]) / since / 1e3:.1f} k/s" if since > 0.0 else ""
        known = self._episodes >= _FEWEST
        success = f"{100.0 * self._hits / self._episodes:.1f} %" if known else "unknown yet"
        status = f"{samples / 1e6:.2f} M samples, success {success}{rate}"
        self.progress.update(self._tasks[phase], completed=numbers["share"], status=status)
        if self.progress.disable and time.monotonic() - self._printed_s > _LINE_EVERY:
            self._printed_s = time.monotonic()
            self._console.print(f"{self._kinds[phase]} {100.0 * numbers['share']:.1f} %, {status}", highlight=False)


def train_policy(request: Request) -> int:
    """Train as asked; returns the exit code. Raises RecipeError, TrainingError and ContractError."""
    recipe = load_recipe(request.recipe).changed((f"env.airframe={request.airframe}", *request.changes))
    resume, out = request.resume, request.out
    if not resume and any(out.glob("checkpoint*.pt")):
        raise TrainingError(f"{out} holds a run already: go on with it by --resume, or give another --out")
    console = Console(stderr=True, soft_wrap=True)
    stop, display = _Stop(console), _Display(console, recipe)
    status = f"{recipe.title}: {request.stage} stage, {request.airframe}, seed {request.seed}, into {out}"
    console.print(status, highlight=False)
    with stop.caught(), display.progress:
        where = (recipe, request.stage, request.seed, out, resume, request.device, request.parent)
        policy = run(*where, progress=display, stop=stop)
    if stop():
        print(f"saved; go on with:\n  {request.again()}")
        return INTERRUPTED
    if request.as_json:
        print_json(read_curve(out / CURVE))
        return OK
    print(f"policy  {policy}\ncurve   {out / PICTURE} ({CURVE} beside it)\nnext    perch-hil policy evaluate {policy}")
    return OK
