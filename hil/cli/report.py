"""`perch-hil runs report`, `view` and `export`: a run as a page, in a 3-D viewer, and for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.options import COULD_NOT_RUN, USAGE, fail


def report(
    runs: Annotated[
        list[Path],
        typer.Argument(help="a run folder or .mcap; several, or a folder of runs: a campaign; a checklist's .json"),
    ],
    compare: Annotated[Path | None, typer.Option(help="a second run, shown side by side with the first")] = None,
    out: Annotated[Path | None, typer.Option(help="file to write [default: report.html in the run folder]")] = None,
    ulog: Annotated[
        Path | None, typer.Option(help="the autopilot's own log of the run (.ulg) [default: one in the run folder]")
    ] = None,
    each: Annotated[bool, typer.Option("--each", help="of a campaign: also the report of each of its runs")] = False,
) -> None:
    """Write one HTML file of a run that opens offline.

    Verdict, the paper's row, contact, plots, provenance. Several runs make one page. A checklist's record makes one,
    beside it: what held it up, every item, who signed it, and whether it was changed since.

    Exit code: 0 written, 2 not a readable run or record, 3 could not write. The report says what a recording lacks.
    """
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError
    from hil.report.write import write_report

    if ulog is not None and not ulog.is_file():
        raise fail(f"{ulog}: there is no such file")
    try:
        path = write_report(runs, compare, out, each=each, ulog=ulog)
    except (ReadError, RunError, ValueError) as error:
        raise fail(str(error), USAGE) from None
    except OSError as error:
        raise fail(f"{error.filename or out}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")


def view(
    run: Annotated[Path, typer.Argument(help="a run folder, or an .mcap")],
    save: Annotated[Path | None, typer.Option(help="write this .rrd file instead of showing it")] = None,
) -> None:
    """Open a run in Rerun, or write it for Rerun.

    3-D with board, camera and tags, pictures with detections, the time series that matter. Without a display it
    serves a page on this computer's loopback.

    Exit code: 0 opened or written, 2 not a readable run or Rerun not installed, 3 could not open or write.
    """
    from hil.cli.screen import say
    from hil.recording.reader import ReadError
    from hil.recording.runs import RunError
    from hil.viewer.view import ViewerError, open_viewer, save_rrd

    try:
        if save is None:
            open_viewer(run, say)
        else:
            save_rrd(run, save)
    except (ReadError, RunError, ValueError) as error:
        raise fail(str(error), USAGE) from None
    except ViewerError as error:
        raise fail(str(error), error.code) from None
    except OSError as error:
        raise fail(f"{error.filename or save}: cannot be written: {error.strerror}", COULD_NOT_RUN) from None
    if save is not None:
        print(f"wrote {save} ({save.stat().st_size / 1e6:.2f} MB): open it with `rerun {save}`")


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
