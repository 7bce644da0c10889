"""An ONNX file opened as a policy: all of it in the one file, one observation in, one action out, for any batch."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, NamedTuple

from policies.flying.contract import METADATA_KEY, Contract, ContractError, parse_contract
from policies.flying.external_data import external_files
from vehicle.quadrotor import command_row

_FLOAT = "tensor(float)"
_FREE = "export it with a free first dimension (torch: dynamic_axes)"


class OpenedPolicy(NamedTuple):
    """A policy file's network, its contract, and the sha256 of the bytes that both were read from."""

    session: Any  # onnxruntime.InferenceSession
    contract: Contract
    sha256: str

    @property
    def input(self) -> str:
        """Name of the network's input."""
        return self.session.get_inputs()[0].name

    def run(self, observations: Any) -> Any:
        """Actions (N, 4) float32 in [-1, 1] for observations (N, OBS_DIM) float32."""
        return self.session.run(None, {self.input: observations})[0]


def open_policy(path: str | Path) -> OpenedPolicy:
    """Open a policy file (ONNX Runtime, one thread, no spinning).

    Raises ContractError for a file that cannot be read, has no contract, keeps numbers in another file, or whose
    inputs and outputs are others than a batch of observations and a batch of actions.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise ContractError(
            f"policy {path} does not exist; train one or name a file under policies/checkpoints"
        ) from None
    except OSError as error:
        raise ContractError(f"policy {path} cannot be read: {error.strerror}") from None
    _check_whole(path, data)
    session, text = _session(path, data)
    if text is None:
        raise ContractError(f"policy {path} carries no '{METADATA_KEY}' metadata; `perch-hil policy train` exports it")
    contract = parse_contract(text, f"policy {path}")
    _check_ends(path, session, contract.observation.dimension)
    return OpenedPolicy(session, contract, hashlib.sha256(data).hexdigest())


def _check_whole(path: Path, data: bytes) -> None:
    """A checksum of the file must cover all of the network."""
    try:
        outside = external_files(data)
    except ValueError as error:
        raise ContractError(f"policy {path} is not a readable ONNX model ({error}); copy or export it again") from None
    if outside:
        raise ContractError(
            f"policy {path} keeps weights in another file ({', '.join(outside)[:80]}), which its checksum does not "
            "cover; save it as one file (onnx.save of onnx.load)"
        )


def _session(path: Path, data: bytes) -> tuple[Any, str | None]:
    """The session and the contract's text, None without one."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        for end in (*session.get_inputs(), *session.get_outputs()):
            _ = end.name, end.shape  # each is decoded when it is asked for
        return session, session.get_modelmeta().custom_metadata_map.get(METADATA_KEY)
    except Exception as error:  # onnxruntime raises a family of bare exceptions for a damaged file
        reason = " ".join(str(error).split())[:160]
        raise ContractError(f"policy {path} is not a readable ONNX model ({reason}); copy or export it again") from None


def _check_ends(path: Path, session: Any, dimension: int) -> None:
    inputs, outputs = session.get_inputs(), session.get_outputs()
    for ends, verb, meant in ((inputs, "reads", "one observation"), (outputs, "gives", "one action")):
        if len(ends) != 1:
            names = ", ".join(end.name for end in ends)[:80] or "nothing"
            raise ContractError(
                f"policy {path} {verb} {len(ends)} tensors ({names}), not {meant}; a network that keeps a state "
                "between steps or reads anything else cannot be flown"
            )
        if ends[0].type != _FLOAT:
            raise ContractError(f"policy {path} {verb} a {ends[0].type}, not a {_FLOAT}; export it in 32-bit floats")
    reads, gives = inputs[0].shape, outputs[0].shape
    if len(reads) != 2 or reads[1] != dimension:
        raise ContractError(
            f"policy {path} reads {_shape(reads)} numbers but its contract promises batch x {dimension}"
        )
    if len(gives) != 2 or (isinstance(gives[1], int) and gives[1] != command_row.DIM):
        raise ContractError(f"policy {path} gives {_shape(gives)} numbers, not batch x {command_row.DIM}")
    for shape in (reads, gives):
        if isinstance(shape[0], int):
            raise ContractError(f"policy {path} takes batches of {shape[0]} only; {_FREE}")


def _shape(shape: list[Any]) -> str:
    return " x ".join(str(size) for size in shape) or "single"
