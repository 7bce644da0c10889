"""`perch-hil results`: measures the experiments of docs/results.md and writes its tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, INTERRUPTED, USAGE, Cluster, complain, fail


def results(
    names: Annotated[list[str] | None, typer.Argument(help="experiments [default: all that are not measured]")] = None,
    again: Annotated[bool, typer.Option("--again", help="measure also what is measured already")] = False,
    listing: Annotated[bool, typer.Option("--list", help="list the experiments, and measure nothing")] = False,
    folder: Annotated[Path, typer.Option(help="folder of the data")] = Path("results"),
    flights: Annotated[Path, typer.Option(help="folder of the runs")] = Path("runs/results"),
    page: Annotated[Path, typer.Option(help="the page whose tables are made from the data")] = Path("docs/results.md"),
    cluster: Cluster = None,
) -> None:
    """Measure the experiments of docs/results.md; write its tables.

    All of them take hours. After a stop the same command goes on; what was measured with the networks that ship now
    is kept.

    Exit code: 0 done, 2 usage, 3 an experiment could not be carried out, 130 interrupted.
    """
    from hil.campaign.workers.opening import open_workers
    from hil.campaign.workers.work import ClusterError
    from hil.recording.provenance import ProvenanceError, code
    from hil.results.experiments import EXPERIMENTS
    from hil.results.measure import MeasureError, is_measured, kept, measure
    from hil.results.page import PageError, figures, fill
    from kernel.toml_errors import nearest

    known = {experiment.name: experiment for experiment in EXPERIMENTS}
    for name in names or ():
        if name not in known:
            raise fail(f"no experiment '{name}'{nearest(name, tuple(known))} There are: {', '.join(known)}", USAGE)
    wanted = [known[name] for name in names or known]
    if listing:
        for experiment in wanted:
            state = "measured" if is_measured(experiment, folder) else "not measured"
            print(f"{experiment.name:28s} {state:13s} {experiment.text}")
        return
    if not page.is_file():
        raise fail(f"{page}: no such page; run this in the project's folder, or give --page", USAGE)
    try:
        with open_workers(cluster, None):
            pass  # a cluster that is not there or does not fit is told before the first hour
        for experiment in wanted:
            if again or not is_measured(experiment, folder):
                complain(f"measuring {experiment.name}: {experiment.text}")
                measure(experiment, folder, flights, code().manifest(), cluster)
        found = {name: kept(experiment, folder) for name, experiment in known.items()}
        data = {name: one["data"] for name, one in found.items() if one is not None}
        for file, picture in figures(data).items():
            (folder / file).write_text(picture, encoding="utf-8")
        page.write_text(fill(page.read_text(encoding="utf-8"), data), encoding="utf-8")
    except KeyboardInterrupt:
        raise fail("interrupted; the same command goes on from here", INTERRUPTED) from None
    except ClusterError as error:
        raise fail(str(error), USAGE) from None
    except PageError as error:
        raise fail(f"{page}: {error}", USAGE) from None
    except (MeasureError, ProvenanceError, OSError) as error:
        raise fail(str(error), COULD_NOT_RUN) from None
    print(f"wrote {page}")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(results)
