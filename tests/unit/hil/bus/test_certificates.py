"""Keys: private files are private, each identity has its own, and an unusable file is named before the start."""

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


def test_key_file_of_every_identity_is_readable_by_its_owner_only(made):
    names = {path.name for path in made.iterdir()}
    assert names == {f"{identity}.{kind}" for identity in ("ca", "hub", "brain") for kind in ("crt", "key")}
    for path in made.glob("*.key"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    for identity in ("hub", "brain"):
        check_keys(credentials_in(made, identity), now=NOW)


def test_existing_keys_are_not_overwritten(keys):
    with pytest.raises(KeysError, match="already holds keys"):
        make_keys(keys, ["brain"])


def test_invalid_host_name_is_refused(tmp_path):
    with pytest.raises(KeysError, match="neither an address nor"):
        make_keys(tmp_path / "keys", ["hub"], ["höst"])


def test_error_names_an_unwritable_key_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(KeysError, match="cannot be written"):
        make_keys(tmp_path / "file" / "keys", ["hub"])


def fault(keys, identity="brain", now=NOW):
    with pytest.raises(KeysError) as error:
        check_keys(credentials_in(keys, identity), now=now)
    return str(error.value)


def test_error_names_a_missing_key_file(keys):
    assert "absent.crt cannot be read (No such file" in fault(keys, "absent")
    (keys / "brain.key").unlink()
    assert "brain.key cannot be read" in fault(keys)


def test_key_readable_by_other_users_is_refused(keys):
    (keys / "brain.key").chmod(0o640)
    assert "can be read by others" in fault(keys)


def test_certificate_file_of_another_authority_is_refused(keys, tmp_path):
    make_keys(tmp_path / "other", ["brain"], now=NOW)
    for name in ("brain.crt", "brain.key"):
        shutil.copy(tmp_path / "other" / name, keys / name)
    assert "was not signed by" in fault(keys)


def test_a_key_of_another_identity_is_refused(keys):
    shutil.copy(keys / "hub.key", keys / "brain.key")
    assert "does not belong to" in fault(keys)


def test_invalid_key_or_certificate_file_is_refused(keys):
    (keys / "brain.key").write_text("no key")
    assert "is no private key" in fault(keys)
    (keys / "brain.crt").write_text("no certificate")
    assert "is no certificate" in fault(keys)


def test_expired_certificate_and_wrong_clock_errors_name_the_remedy(keys):
    assert "ran out on 2027-03-01" in fault(keys, now=NOW + timedelta(days=DAYS, hours=1))
    assert "set the clock" in fault(keys, now=NOW - timedelta(days=1))
