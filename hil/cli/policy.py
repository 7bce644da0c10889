"""`perch-hil policy train|evaluate|check`: trains policies, evaluates them, and checks a policy's file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from hil.cli.groups import add_group
from hil.cli.legends import EVALUATION, explained
from hil.cli.options import COULD_NOT_RUN, INTERRUPTED, OK, POLICIES, USAGE, Cluster, Json, Rig, fail


def train(
    stage: Annotated[
        Literal["state", "vision"],
        typer.Option(help="state: the policy is told where the board is; vision: it sees a camera's belief"),
    ] = "state",
    recipe: Annotated[
        str | None,
        typer.Option(help="a name in policies/training/recipes or a .toml [default: the stage's]"),
    ] = None,
    airframe: Annotated[str, typer.Option(help="the vehicle to train for: a name or a .toml")] = "paper_quad",
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="change a setting of the recipe: network.width=128, env.rho=false, budget=0.5"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=999_999_999)] = 1,
    out: Annotated[
        Path | None, typer.Option(help="folder of the run [default: training_runs/RECIPE-STAGE-SEED]")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="go on where the run in --out was stopped or killed")
    ] = False,
    parent: Annotated[
        Path | None, typer.Option(help="begin with the weights of this run (its folder) or of this .onnx file")
    ] = None,
    device: Annotated[str, typer.Option(help="cpu, cuda or cuda:N")] = "cpu",
    as_json: Json = False,
) -> None:
    """Train a policy.

    Leaves policy.onnx, curve.csv, curve.svg and checkpoints in a folder; --json prints the curve at the end.

    Ctrl-C saves and says how to go on; a kill loses at most a minute.

    Exit code: 0 trained, 2 usage or recipe, or a checkpoint, device or parent that does not fit, 3 stopped by numbers
    that are not finite or a disk that is full, 130 interrupted.
    """
    try:
        from hil.cli.training import Request, train_policy
    except ModuleNotFoundError as error:
        raise fail(f"training needs {error.name}: pip install 'perch-hil[train]'", USAGE) from None
    from policies.flying.contract import ContractError
    from policies.training.learners.storage import DivergedError, TrainingError
    from policies.training.recipe import RecipeError

    named = recipe or stage
    folder = out or Path("training_runs") / f"{Path(named).stem}-{stage}-{seed}"
    request = Request(stage, named, airframe, tuple(change or ()), seed, folder, resume, parent, device, as_json)
    try:
        code = train_policy(request)
    except (DivergedError, ContractError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    except (RecipeError, TrainingError) as error:
        raise fail(str(error), USAGE) from None
    except OSError as error:
        raise fail(f"{error.filename or folder}: {error.strerror}", COULD_NOT_RUN) from None
    except KeyboardInterrupt:
        raise fail("stopped without saving; the last checkpoint is as it was", INTERRUPTED) from None
    raise typer.Exit(code)


@explained(EVALUATION)
def evaluate(
    policy: Annotated[
        str,
        typer.Argument(
            help=f"{POLICIES}, state (it is told where the board is), PATH.onnx, expert (it knows the future), "
            "fast-perching or fast-perching-ctrv"
        ),
    ],
    episodes: Annotated[int, typer.Option(min=10, help="episodes at each point")] = 2000,
    stage: Annotated[
        Literal["state", "vision"] | None,
        typer.Option(help="state: it is told where the board is; vision: a camera's belief [default: the policy's]"),
    ] = None,
    noise: Annotated[
        Literal["paper", "measured"], typer.Option(help="the simulated detector's: the paper's, or our detector's own")
    ] = "paper",
    airframe: Annotated[
        str | None, typer.Option(help="the vehicle: a name or a .toml [default: the one that the policy was made for]")
    ] = None,
    hover: Annotated[
        bool, typer.Option("--hover", help="begin hovering and watching for up to 1 s, as a flight does")
    ] = False,
    time_limit: Annotated[float, typer.Option(min=1.0, max=60.0, help="seconds to perch in (the paper's: 5)")] = 5.0,
    motions: Annotated[bool, typer.Option("--motions", help="also the four trajectory families")] = False,
    robust: Annotated[
        bool, typer.Option("--robust", help="also other vehicles, cameras and cars than it was made for")
    ] = False,
    heatmap: Annotated[
        Path | None, typer.Option(help="also map speed x inclination: writes this .svg and a .csv beside it")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="evaluation seed; no training or tuning draws from these")] = 0,
    cluster: Cluster = None,
    as_json: Json = False,
) -> None:
    """Judge a policy by the paper's tables.

    It flies in the training environment; its rows stand beside the paper's.

    Thousands of episodes; success with exact intervals.

    Exit code: 0 evaluated, 2 not a policy that can be flown, wrong options or no such cluster, 3 could not write, or a
    cluster was lost.
    """
    from hil.campaign.workers.work import WorkersError
    from hil.cli.evaluation import Request, evaluate_policy
    from hil.cli.screen import print_json
    from policies.flying.contract import ContractError

    if heatmap is not None and heatmap.suffix != ".svg":
        raise fail(f"--heatmap {heatmap}: give a file that ends in .svg; the data goes beside it as .csv", USAGE)
    request = Request(
        policy, episodes, stage, noise, hover, time_limit, motions, robust, heatmap, seed, cluster, airframe
    )
    try:
        found = evaluate_policy(request)
    except (ContractError, ValueError, FileNotFoundError) as error:
        raise fail(str(error), USAGE) from None
    except WorkersError as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    except OSError as error:
        raise fail(f"{error.filename or heatmap}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    except KeyboardInterrupt:
        raise fail("stopped; nothing was evaluated to the end", INTERRUPTED) from None
    if as_json:
        print_json(found.data())
    else:
        found.show()


def check(
    policy: Annotated[str, typer.Argument(help="PATH.onnx, or the name of a shipped network")],
    rig: Rig = "sim",
    as_json: Json = False,
) -> None:
    """Tell whether a policy file can be flown.

    The checks of every run, a line each: the file, its contract against the rig's airframe and camera, its answers to
    recorded observations, how long one takes, and how far they are from the shipped network's.

    Exit code: 0 it can be flown, 2 refused.
    """
    from hil.cli.policy_check import check_policy
    from hil.cli.screen import print_json, say

    try:
        findings = check_policy(policy, rig)
    except ValueError as error:
        raise fail(str(error), USAGE) from None
    if as_json:
        print_json([asdict(finding) for finding in findings])
    else:
        for finding in findings:
            say(f"{finding.check:10s} {'ok' if finding.ok else 'REFUSED':8s} {finding.text}")
    raise typer.Exit(OK if all(finding.ok for finding in findings) else USAGE)


def register(app: typer.Typer) -> None:
    """Add the group; `check` has no flat name: that is the checklists'."""
    group = add_group(app, "policy", "Train policies, and judge them.", {"train": train, "evaluate": evaluate})
    group.command("check")(check)
