"""The crew's key (Ed25519, PEM): it signs checklist records, and its public half, named in the rig, verifies them.

`openssl genpkey -algorithm ed25519 -out crew.pem` makes one; `openssl pkey -in crew.pem -pubout -out crew.pub` gives
the public half.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

_CONTEXT = b"perch-hil checklist record\n"  # a signature of this key for another purpose is none of a record


class CrewKeyError(ValueError):
    """A key file that cannot be used; the message states which file and why."""


def load_crew_key(path: Path) -> Ed25519PrivateKey:
    """The private key in `path`. Raises CrewKeyError, also if other users may read or write the file."""
    data = _content(path)
    mode = path.stat().st_mode & 0o777
    if mode & 0o077:
        raise CrewKeyError(f"{path}: other users may use this key (mode {mode:04o}): chmod 600 {path}")
    try:
        key = serialization.load_pem_private_key(data, None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        key = None
    if not isinstance(key, Ed25519PrivateKey):
        raise CrewKeyError(f"{path}: is not an Ed25519 private key in PEM without a pass phrase")
    return key


def load_public_keys(paths: tuple[str, ...]) -> dict[str, Ed25519PublicKey]:
    """Fingerprint -> public key of the files in `paths`. Raises CrewKeyError."""
    found: dict[str, Ed25519PublicKey] = {}
    for name in paths:
        try:
            key = serialization.load_pem_public_key(_content(Path(name)))
        except (ValueError, TypeError, UnsupportedAlgorithm) as error:
            if isinstance(error, CrewKeyError):
                raise
            key = None
        if not isinstance(key, Ed25519PublicKey):
            raise CrewKeyError(f"{name}: is not an Ed25519 public key in PEM")
        found[fingerprint(key)] = key
    return found


def fingerprint(key: Ed25519PublicKey) -> str:
    """The first 16 digits of the sha256 of the raw public key."""
    return hashlib.sha256(key.public_bytes_raw()).hexdigest()[:16]


def sign_digest(key: Ed25519PrivateKey, digest: str) -> str:
    """Signature (hex) of a record's digest."""
    return key.sign(_CONTEXT + digest.encode()).hex()


def verifies(key: Ed25519PublicKey, digest: str, signature: str) -> bool:
    """True if `signature` (hex) is that of `digest` by `key`."""
    try:
        key.verify(bytes.fromhex(signature), _CONTEXT + digest.encode())
    except (InvalidSignature, ValueError):
        return False
    return True


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(4096)
    except OSError as error:
        raise CrewKeyError(f"{path}: the key cannot be read: {error.strerror}") from None
