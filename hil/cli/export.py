"""`perch-hil runs export`: a run for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, fail


def export(
    run: Annotated[Path, typer.Argument(help="a run folder, or an .mcap")],
    ros2: Annotated[Path, typer.Option(help="folder to write: a ROS 2 bag in MCAP, with standard messages")],
) -> None:
    """Write a run as a ROS 2 bag.

    `ros2 bag`, RViz, PlotJuggler and Foxglove read it; no ROS 2 is needed to write it.

    Exit code: 0 written, 2 not a readable run, rosbags not installed or the folder exists, 3 could not write.
    """
    try:
        from hil.ros2.bag import export as write
    except ImportError:
        raise fail("the export is not installed: pip install 'perch-hil[ros2]' (rosbags 0.11)") from None
    try:
        counts = write(run, ros2)
    except ValueError as error:
        raise fail(str(error)) from None
    except OSError as error:
        raise fail(f"{error.filename or ros2}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    print(f"wrote {ros2}: {sum(counts.values())} messages on {len(counts)} topics")
