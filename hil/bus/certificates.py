"""Keys and certificates of a closed bus: one authority, and one certificate for each identity that may join.

The authority's key is only needed for signing: keep it off the hosts that fly. A host gets `ca.crt` and the two files
of each service that it runs.
"""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from hil.bus.leaf import Credentials

DAYS = 365
LOCAL = ("127.0.0.1", "localhost")
_SLACK = timedelta(hours=1)  # of a clock that is behind


class KeysError(ValueError):
    """Files of keys that cannot be made or used; the text states which, why and how to correct it."""


def make_keys(
    folder: Path, identities: Sequence[str], hosts: Sequence[str] = (), now: datetime | None = None
) -> list[Path]:
    """Write the authority and one key and certificate per identity into `folder`; returns the files, the authority's
    first. `hosts`: names or addresses besides this machine's own at which the hub will be reached.

    Raises KeysError if the folder already holds an authority, or cannot be written.
    """
    now = now or datetime.now(UTC)
    if (folder / "ca.crt").exists() or (folder / "ca.key").exists():
        raise KeysError(f"{folder} already holds keys: remove it, or give another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o700)
        authority_key = ec.generate_private_key(ec.SECP256R1())
        name = _name("perch-hil authority")
        authority = (
            _draft(name, name, authority_key, now)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(signs_certificates=True), critical=True)
            .sign(authority_key, hashes.SHA256())
        )
        files = _write(folder / "ca", authority_key, authority)
        for identity in identities:
            key = ec.generate_private_key(ec.SECP256R1())
            draft = _draft(_name(identity), name, key, now)
            draft = draft.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            draft = draft.add_extension(_usage(signs_certificates=False), critical=True)
            server = identity == "hub"
            purpose = ExtendedKeyUsageOID.SERVER_AUTH if server else ExtendedKeyUsageOID.CLIENT_AUTH
            draft = draft.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
            at = (
                [_general(host) for host in dict.fromkeys((*LOCAL, *hosts))]
                if server
                else [x509.DNSName(_dns(identity))]
            )
            draft = draft.add_extension(x509.SubjectAlternativeName(at), critical=False)
            files += _write(folder / identity, key, draft.sign(authority_key, hashes.SHA256()))
    except OSError as error:
        raise KeysError(f"{folder}: cannot be written: {error.strerror}") from None
    return files


def check_keys(credentials: Credentials, now: datetime | None = None) -> None:
    """Raises KeysError if the files are missing, open to others, of another authority, or not valid now.

    Check this first: on the wire all of these faults appear as a hub that does not answer.
    """
    now = now or datetime.now(UTC)
    authority, own = _load(credentials.authority), _load(credentials.certificate)
    with suppress(OSError):
        if credentials.key.stat().st_mode & 0o077:
            raise KeysError(f"{credentials.key} can be read by others: chmod 600 it, or better make new keys")
    try:
        key = serialization.load_pem_private_key(credentials.key.read_bytes(), None)
    except OSError as error:
        raise KeysError(_missing(credentials.key, error)) from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise KeysError(f"{credentials.key} is no private key without a pass phrase") from None
    try:
        belongs = key.public_key() == own.public_key()
    except (ValueError, UnsupportedAlgorithm):
        raise KeysError(f"{credentials.certificate} is damaged: its public key cannot be read") from None
    if not belongs:
        raise KeysError(f"{credentials.key} does not belong to {credentials.certificate}")
    try:
        own.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature, UnsupportedAlgorithm):
        raise KeysError(f"{credentials.certificate} was not signed by {credentials.authority}") from None
    for path, certificate in ((credentials.authority, authority), (credentials.certificate, own)):
        if now > certificate.not_valid_after_utc:
            raise KeysError(f"{path} ran out on {certificate.not_valid_after_utc:%Y-%m-%d}: make new keys")
        if now < certificate.not_valid_before_utc:
            raise KeysError(
                f"{path} is valid only from {certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC, and this host's "
                f"clock says {now:%Y-%m-%d %H:%M}: set the clock"
            )


def _load(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise KeysError(_missing(path, error)) from None
    except ValueError:
        raise KeysError(f"{path} is no certificate (PEM)") from None


def _missing(path: Path, error: OSError) -> str:
    return f"{path} cannot be read ({error.strerror}): `perch-hil bus keys {path.parent}` makes the files"


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _dns(identity: str) -> str:
    return identity.replace("_", "-")


def _general(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError:
        raise KeysError(f"{host!r} is neither an address nor a host's name") from None


def _draft(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _SLACK)
        .not_valid_after(now + timedelta(days=DAYS))
    )


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates, key_cert_sign=signs_certificates, crl_sign=signs_certificates,
        content_commitment=False, key_encipherment=False, data_encipherment=False, key_agreement=False,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip


def _write(stem: Path, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate) -> list[Path]:
    key_path, certificate_path = stem.with_suffix(".key"), stem.with_suffix(".crt")
    pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )  # fmt: skip
    with os.fdopen(os.open(key_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(pem)
    certificate_path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    return [certificate_path, key_path]
