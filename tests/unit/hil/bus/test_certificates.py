"""Keys: private ones are private, each identity has its own, and what cannot be used is told by name beforehand."""

import shutil
import stat
from datetime import UTC, datetime, timedelta

import pytest

from hil.bus.certificates import DAYS, KeysError, check_keys, make_keys
from hil.bus.leaf import credentials_in

NOW = datetime(2026, 3, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys") / "made"
    make_keys(folder, ["hub", "brain"], ["10.0.0.1", "field-laptop"], now=NOW)
    return folder


@pytest.fixture
def keys(made, tmp_path):
    return shutil.copytree(made, tmp_path / "keys")


def test_every_identity_has_a_key_that_only_its_owner_reads(made):
    names = {path.name for path in made.iterdir()}
    assert names == {f"{who}.{kind}" for who in ("ca", "hub", "brain") for kind in ("crt", "key")}
    for path in made.glob("*.key"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    for who in ("hub", "brain"):
        check_keys(credentials_in(made, who), now=NOW)


def test_keys_are_not_overwritten(keys):
    with pytest.raises(KeysError, match="already holds keys"):
        make_keys(keys, ["brain"])


def test_a_host_that_is_no_host_is_refused(tmp_path):
    with pytest.raises(KeysError, match="neither an address nor"):
        make_keys(tmp_path / "keys", ["hub"], ["höst"])


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(KeysError, match="cannot be written"):
        make_keys(tmp_path / "file" / "keys", ["hub"])


def fault(keys, who="brain", now=NOW):
    with pytest.raises(KeysError) as error:
        check_keys(credentials_in(keys, who), now=now)
    return str(error.value)


def test_a_missing_file_is_named(keys):
    assert "nobody.crt cannot be read (No such file" in fault(keys, "nobody")
    (keys / "brain.key").unlink()
    assert "brain.key cannot be read" in fault(keys)


def test_a_key_that_others_read_is_refused(keys):
    (keys / "brain.key").chmod(0o640)
    assert "can be read by others" in fault(keys)


def test_another_authoritys_certificate_is_refused(keys, tmp_path):
    make_keys(tmp_path / "other", ["brain"], now=NOW)
    for name in ("brain.crt", "brain.key"):
        shutil.copy(tmp_path / "other" / name, keys / name)
    assert "was not signed by" in fault(keys)


def test_a_key_of_another_identity_is_refused(keys):
    shutil.copy(keys / "hub.key", keys / "brain.key")
    assert "does not belong to" in fault(keys)


def test_what_is_no_key_is_refused(keys):
    (keys / "brain.key").write_text("no key")
    assert "is no private key" in fault(keys)
    (keys / "brain.crt").write_text("no certificate")
    assert "is no certificate" in fault(keys)


def test_time_runs_out_and_a_clock_may_be_wrong(keys):
    assert "ran out on 2027-03-01" in fault(keys, now=NOW + timedelta(days=DAYS, hours=1))
    assert "set the clock" in fault(keys, now=NOW - timedelta(days=1))
