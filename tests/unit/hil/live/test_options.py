"""Options of the live host that contradict each other give an error of one line, before anything is started."""

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


def test_valid_combinations_of_options_pass(tmp_path):
    check_options(SIM, (), None, None)
    check_options(SIM, ("brain", "hub"), HERE, None)
    make_keys(tmp_path / "keys", ["hub", *OBSERVERS, *SERVICES])
    check_options(SIM, (), None, tmp_path / "keys")
    check_options(SIM, ("brain",), HERE.replace("tcp", "tls"), tmp_path / "keys")


def test_invalid_remote_services_are_refused():
    refused("no service 'brian'; did you mean \"brain\"", remote=("brian",), endpoint=HERE)
    for tied in ("vehicle_link", "vehicle_device", "car", "car_device"):
        refused("share a wire of one host", remote=(tied,), endpoint=HERE)
    refused("--remote needs --endpoint", remote=("brain",))


@pytest.mark.parametrize(
    "endpoint", ["", "192.168.1.10:7447", "udp/1.2.3.4:7447", "tcp/:7447", "tcp/host:0", "tcp/host:70000"]
)
def test_endpoint_with_invalid_syntax_is_refused(endpoint):
    with pytest.raises(ConfigError, match="write tcp/HOST:PORT"):
        check_endpoint(endpoint, None)


def test_tls_without_keys_and_keys_without_tls_are_refused(tmp_path):
    refused("tls/ needs --keys", endpoint="tls/127.0.0.1:7447")
    refused("with --keys the bus is on tls/", endpoint=HERE, keys=tmp_path)


def test_viewer_needs_its_own_key(tmp_path):
    make_keys(tmp_path / "keys", ["hub", "supervisor", "recorder", *SERVICES])
    check_options(SIM, (), None, tmp_path / "keys")
    with pytest.raises(KeysError, match=r"viewer\.crt cannot be read"):
        check_options(SIM, (), None, tmp_path / "keys", viewed=True)


def test_only_the_keys_of_this_host_are_needed(tmp_path):
    make_keys(tmp_path / "keys", ["hub", "supervisor", "recorder", *(name for name in SERVICES if name != "brain")])
    endpoint = HERE.replace("tcp", "tls")
    check_options(SIM, ("brain",), endpoint, tmp_path / "keys")
    with pytest.raises(KeysError, match=r"brain\.crt cannot be read"):
        check_options(SIM, (), endpoint, tmp_path / "keys")
