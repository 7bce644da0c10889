"""Records signed with a key of the crew: only these clear a rig that names its crew's keys."""

import json

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, generate_private_key
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from hil.check import records
from hil.check.command import run_checklist
from hil.check.crew_key import CrewKeyError, fingerprint, load_crew_key, load_public_keys
from hil.check.interlock import NotClearedError
from hil.check.judge import Outcome
from tests.unit.hil.check.cleared import Site, real_car
from tests.unit.hil.check.console import check_request

PEM, NO_PHRASE = serialization.Encoding.PEM, serialization.NoEncryption()


def private_file(folder, key, name="crew.pem", mode=0o600):
    path = folder / name
    path.write_bytes(key.private_bytes(PEM, serialization.PrivateFormat.PKCS8, NO_PHRASE))
    path.chmod(mode)
    return path


def public_file(folder, key, name="crew.pub"):
    path = folder / name
    path.write_bytes(key.public_key().public_bytes(PEM, serialization.PublicFormat.SubjectPublicKeyInfo))
    return str(path)


@pytest.fixture
def crew(tmp_path):
    return Ed25519PrivateKey.generate()


@pytest.fixture
def site(tmp_path, crew):
    made = Site(tmp_path)
    made.rig = real_car(preflight=made.rig.preflight, crew_keys=(public_file(tmp_path, crew),))
    return made


def test_go_signed_with_the_crews_key_clears_and_the_key_is_in_the_manifest(tmp_path, site, crew):
    path = site.go(key=load_crew_key(private_file(tmp_path, crew)))
    assert records.read(path).state == "signed"
    assert site.clear().manifest()["key"] == fingerprint(crew.public_key())


def test_no_go_turned_into_a_go_and_hashed_anew_does_not_clear(site, crew):
    path = site.go(Outcome.FAIL, key=crew)
    record = records.read(path)
    record.entries[0].outcome = Outcome.PASS
    sign = record.sign_off
    assert sign is not None
    sign["sha256"] = records._digest(record.content(), sign)
    records.write(path, record)
    assert records.read(path).genuine()
    with pytest.raises(NotClearedError, match="is not signed by its key"):
        site.clear()


def test_sealed_record_does_not_clear_a_rig_with_crew_keys(site):
    site.go()
    with pytest.raises(NotClearedError, match=r"is only sealed.*--key FILE"):
        site.clear()


def test_record_signed_with_another_key_does_not_clear(site):
    site.go(key=Ed25519PrivateKey.generate())
    with pytest.raises(NotClearedError, match="not by a key of this rig's crew"):
        site.clear()


@pytest.mark.parametrize("change", [{"signature": "zz"}, {"signature": ""}, {"utc": "2026-01-02T12:00:01Z"}], ids=str)
def test_changed_sign_off_does_not_clear(site, crew, change):
    path = site.go(key=crew)
    table = json.loads(path.read_text())
    table["sign_off"] |= change
    path.write_text(json.dumps(table))
    with pytest.raises(NotClearedError):
        site.clear()


@pytest.mark.parametrize("mode", [0o666, 0o644, 0o620])
def test_private_key_open_to_other_users_is_refused(tmp_path, crew, mode):
    with pytest.raises(CrewKeyError, match="chmod 600"):
        load_crew_key(private_file(tmp_path, crew, mode=mode))


def test_error_names_an_invalid_key_file(tmp_path, crew):
    (tmp_path / "odd.pem").write_text("no key")
    (tmp_path / "odd.pem").chmod(0o600)
    for path in (tmp_path / "odd.pem", private_file(tmp_path, generate_private_key(SECP256R1()), "ec.pem")):
        with pytest.raises(CrewKeyError, match=f"{path.name}: is not an Ed25519 private key"):
            load_crew_key(path)
    with pytest.raises(CrewKeyError, match=r"odd\.pem: is not an Ed25519 public key"):
        load_public_keys((str(tmp_path / "odd.pem"),))
    with pytest.raises(CrewKeyError, match="cannot be read"):
        load_public_keys((str(tmp_path / "nowhere"),))


def test_missing_public_key_is_a_refusal(tmp_path, site, crew):
    site.go(key=crew)
    with pytest.raises(NotClearedError, match="nowhere: the key cannot be read"):
        site.clear(site.rig.model_copy(update={"crew_keys": (str(tmp_path / "nowhere"),)}))


def test_check_signs_with_the_key_of_the_command_line(tmp_path, crew, capsys):
    (tmp_path / "list.toml").write_text(
        'title = "one"\n[[group]]\ntitle = "g"\n[[group.item]]\ncheck = "host.disk"\nmin = 0.0\n'
    )
    request = check_request(tmp_path, tmp_path / "list.toml", sign=True, crew_key=private_file(tmp_path, crew))
    assert run_checklist(request) == 0
    assert f"GO, signed by Ann with key {fingerprint(crew.public_key())}" in capsys.readouterr().out.replace("\n", " ")
    assert records.read(tmp_path / "record.json").signed_by({fingerprint(crew.public_key()): crew.public_key()})
