"""`perch-hil train` and `perch-hil evaluate`: making policies, and judging whatever could fly."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

USAGE, COULD_NOT_RUN = 2, 3


def evaluate(
    policy: Annotated[str, typer.Argument(help="an .onnx file, planner, planner-analytic or expert (with foresight)")],
    episodes: Annotated[int, typer.Option(min=10, help="episodes at each point")] = 2000,
    stage: Annotated[
        Literal["state", "vision"] | None,
        typer.Option(help="state: it is told where the board is; vision: a camera's belief [default: the policy's]"),
    ] = None,
    noise: Annotated[
        Literal["paper", "measured"], typer.Option(help="the simulated detector's: the paper's, or our detector's own")
    ] = "paper",
    hover: Annotated[
        bool, typer.Option("--hover", help="begin hovering and watching for up to 1 s, as a flight does")
    ] = False,
    time_limit: Annotated[float, typer.Option(min=1.0, max=60.0, help="seconds to perch in (the paper's: 5)")] = 5.0,
    motions: Annotated[bool, typer.Option("--motions", help="also the four trajectory families")] = False,
    heatmap: Annotated[
        Path | None, typer.Option(help="also map speed x inclination: writes this .svg and a .csv beside it")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="evaluation seed; no training or tuning draws from these")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="one object on stdout, nothing else there")] = False,
) -> None:
    """Fly a policy thousands of times in the training environment and print its rows beside the paper's.

    Exit code: 0 evaluated, 2 not a policy that can be flown or wrong options, 3 could not write.
    """
    from hil.evaluation import Request, evaluate_policy  # imports kernels: keep `--help` quick
    from policies.contract import ContractError

    if heatmap is not None and heatmap.suffix != ".svg":
        raise _fail(f"--heatmap {heatmap}: give a file that ends in .svg; the data goes beside it as .csv", USAGE)
    request = Request(policy, episodes, stage, noise, hover, time_limit, motions, heatmap, seed)
    try:
        found = evaluate_policy(request)
    except (ContractError, ValueError, FileNotFoundError) as error:
        raise _fail(str(error), USAGE) from None
    except OSError as error:
        raise _fail(f"{error.filename or heatmap}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    except KeyboardInterrupt:
        raise _fail("stopped; nothing was evaluated to the end", 130) from None
    if as_json:
        print(json.dumps(found.data()))
    else:
        found.show()


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(evaluate)


def _fail(text: str, code: int) -> typer.Exit:
    print(f"perch-hil: {text}", file=sys.stderr)
    return typer.Exit(code)
