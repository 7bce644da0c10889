"""Without --rig, what flies or is checked is the rig that the scenario names."""

import pytest
from typer.testing import CliRunner

from hil.check.command import _context
from hil.cli.main import app
from hil.live import soak
from kernel.toml_errors import ConfigError
from scenarios.spec import FOLDER
from tests.unit.hil.check.console import check_request


def test_campaign_of_rigs_with_different_policies_asks_for_one(tmp_path):
    found = CliRunner().invoke(app, ["campaign", "fly", "simple-i", "crazyflie-wall", "--out", str(tmp_path)])
    assert found.exit_code == 2 and "rigs sim, crazyflie-sim fly different policies: give --policy" in found.output


@pytest.mark.parametrize(("asked", "rig"), [(None, "crazyflie-sim"), ("sim", "sim")])
def test_checklist_is_for_the_rig_of_the_scenario_unless_another_is_asked_for(tmp_path, asked, rig):
    _, about = _context(check_request(tmp_path, tmp_path / "list.toml", scenario="crazyflie-wall", rig=asked))
    assert about["rig"] == rig


def test_soak_of_a_scenario_whose_rig_has_real_devices_is_refused(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text('rig = "field"\n' + (FOLDER / "simple_i.toml").read_text())
    with pytest.raises(ConfigError, match='rig "field" has real devices: a soak is all simulated'):
        soak.soak(str(mine), 2.0, tmp_path)
