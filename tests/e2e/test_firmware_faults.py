"""Faults at our side of a real firmware's sensors, and how each flight ends; skipped where no PX4 is built."""

import json
import os

import pytest
from typer.testing import CliRunner

from hil.assembly import hitl
from hil.cli.main import app
from hil.recording.runs import list_runs
from hil.scoring.flight_class import ABORTED, MISSED, PERCHED, UNSAFE
from tests.paths import ROOT

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(not os.environ.get(hitl.BUILD), reason=f"{hitl.BUILD} names no build of PX4's SITL"),
]
ON_THE_WAY = 'phase == "goto"'
SAFE = {PERCHED, MISSED, ABORTED}


def flight_class(tmp_path, fault):
    scenario = tmp_path / "broken.toml"
    table = "\n".join(f"{key} = {json.dumps(value)}" for key, value in fault.items())
    scenario.write_text(f"{(ROOT / 'scenarios/simple_i.toml').read_text()}\n[[fault]]\n{table}\n")
    runs = tmp_path / "runs"
    options = ["--rig", "px4-firmware", "--camera", "model", "--json", "--out", str(runs)]
    result = CliRunner().invoke(app, ["run", str(scenario), *options])
    (run,) = list_runs(runs)
    assert result.exit_code in (0, 1, 3), result.output
    return json.loads((run.path / "score.json").read_text())["flight"]["class"]


@pytest.mark.parametrize(
    ("fault", "ends"),
    [
        ({"kind": "sensor.stuck", "sensor": "magnetometer", "at": 0.5}, SAFE),
        ({"kind": "gps.loss", "at": 0.5}, SAFE),
        ({"kind": "estimator.reset", "at": 0.0}, SAFE),
        ({"kind": "battery.empty", "at": ON_THE_WAY}, {ABORTED}),
        ({"kind": "mavlink.down", "at": 0.8}, {ABORTED}),
        ({"kind": "firmware.reboot", "at": 0.5}, {UNSAFE}),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_flight_with_a_fault_of_the_firmwares_ends_as_stated(tmp_path, fault, ends):
    assert flight_class(tmp_path, fault) in ends
