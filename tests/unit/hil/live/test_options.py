"""Options of the live host that do not go together are told in one line, before anything is started."""

import pytest

from hil.assembly.node_table import SERVICES
from hil.assembly.rig import load_rig
from hil.bus.certificates import KeysError, make_keys
from hil.bus.leaf import OBSERVERS
from hil.live.options import check_endpoint, check_options
from kernel.toml_errors import ConfigError

SIM = load_rig("sim")
HERE = "tcp/192.168.1.10:7447"


def refused(text, *, remote=(), endpoint=None, keys=None, viewed=False):
    with pytest.raises(ConfigError, match=text):
        check_options(SIM, remote, endpoint, keys, viewed=viewed)


def test_what_fits_together_passes(tmp_path):
    check_options(SIM, (), None, None)
    check_options(SIM, ("brain", "hub"), HERE, None)
    make_keys(tmp_path / "keys", ["hub", *OBSERVERS, *SERVICES])
    check_options(SIM, (), None, tmp_path / "keys")
    check_options(SIM, ("brain",), HERE.replace("tcp", "tls"), tmp_path / "keys")


def test_remote_services_are_the_rigs_and_can_travel():
    refused("no service 'brian'; did you mean \"brain\"", remote=("brian",), endpoint=HERE)
    for tied in ("vehicle_link", "vehicle_device", "car", "car_device"):
        refused("share a wire of one host", remote=(tied,), endpoint=HERE)
    refused("--remote needs --endpoint", remote=("brain",))


@pytest.mark.parametrize(
    "endpoint", ["", "192.168.1.10:7447", "udp/1.2.3.4:7447", "tcp/:7447", "tcp/host:0", "tcp/host:70000"]
)
def test_an_endpoint_has_a_form(endpoint):
    with pytest.raises(ConfigError, match="write tcp/HOST:PORT"):
        check_endpoint(endpoint, None)


def test_keys_and_tls_go_together(tmp_path):
    refused("tls/ needs --keys", endpoint="tls/127.0.0.1:7447")
    refused("with --keys the bus is on tls/", endpoint=HERE, keys=tmp_path)
    refused("--view cannot join", keys=tmp_path, viewed=True)


def test_only_the_keys_of_this_host_are_needed(tmp_path):
    make_keys(tmp_path / "keys", ["hub", "supervisor", "recorder", *(name for name in SERVICES if name != "brain")])
    endpoint = HERE.replace("tcp", "tls")
    check_options(SIM, ("brain",), endpoint, tmp_path / "keys")
    with pytest.raises(KeysError, match=r"brain\.crt cannot be read"):
        check_options(SIM, (), endpoint, tmp_path / "keys")
