"""A cluster that is not there, or that cannot be used, is refused in one line."""

import socket

import pytest
from typer.testing import CliRunner

from hil.campaign.workers.cluster import check_address
from hil.campaign.workers.work import ClusterError
from hil.cli.main import app


@pytest.fixture
def nobody():
    """An address at which nothing listens, as long as the test lasts."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield f"127.0.0.1:{taken.getsockname()[1]}"


@pytest.mark.parametrize(
    "address", ["", "ray://", "host", "host:", "http://host:1", "ray://host:0", "host:65536", "a b:1", "host:1\n"]
)
def test_what_is_no_address_is_refused_with_the_forms_that_are(address):
    with pytest.raises(ClusterError, match="give ray://HOST:10001"):
        check_address(address)


@pytest.mark.parametrize("protocol", ["", "ray://"])
@pytest.mark.parametrize(
    "command",
    [
        [
            "campaign",
            "simple-i",
            "--policy",
            "planner-analytic",
            "--camera",
            "model",
            "--seeds",
            "0..0",
            "--out",
            "OUT",
        ],
        ["policy", "evaluate", "state", "--episodes", "10"],
        ["results", "state", "--folder", "OUT"],
    ],
)
def test_cluster_that_is_not_there_is_one_line_and_exit_2(command, protocol, nobody, tmp_path):
    words = [str(tmp_path / "out") if word == "OUT" else word for word in command]
    result = CliRunner().invoke(app, [*words, "--cluster", f"{protocol}{nobody}"])
    assert result.exit_code == 2, result.output
    (line,) = result.output.strip().splitlines()
    assert f"--cluster {protocol}{nobody}: no cluster answers there" in line
    assert not (tmp_path / "out").exists()


def test_firmware_of_this_machine_is_not_flown_on_a_cluster(tmp_path):
    words = ["campaign", "simple-i", "--rig", "px4-firmware", "--camera", "model", "--cluster", "auto"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")])
    assert result.exit_code == 2 and "flies a firmware of this machine" in result.output


def test_auto_is_the_cluster_of_rays_own_variable_and_is_refused_when_it_has_crashed(nobody, monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setenv("RAY_ADDRESS", nobody)
    result = CliRunner().invoke(app, ["policy", "evaluate", "state", "--episodes", "10", "--cluster", "auto"])
    assert result.exit_code == 2
    (line,) = result.output.strip().splitlines()
    assert f"--cluster {nobody}: no cluster answers there" in line


def test_auto_without_a_cluster_is_one_line(monkeypatch):
    services = pytest.importorskip("ray._private.services")
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(services, "find_bootstrap_address", lambda _: None)
    result = CliRunner().invoke(app, ["policy", "evaluate", "state", "--episodes", "10", "--cluster", "auto"])
    assert result.exit_code == 2
    (line,) = result.output.strip().splitlines()
    assert "no cluster was started on this machine" in line
