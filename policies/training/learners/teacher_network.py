"""A network as teacher: the graph of any exported policy, evaluated by torch on the learner's device.

The graph is read from the file, not rebuilt from weights: what an ONNX policy computes (gated experts, for example) is
data here and needs no code of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import NodeProto, numpy_helper
from torch import Tensor
from torch.nn import functional

from policies.environment.env import Env
from policies.flying.contract import ContractError, check_contract
from policies.flying.onnx_file import open_policy
from policies.task import tail_row
from policies.task.observation import TAIL
from policies.training.learners.storage import TrainingError
from vehicle.quadrotor import limits_row

_Inputs = list[Tensor]
_FOLDER = Path(__file__).parents[2] / "checkpoints"


class NetworkTeacher:
    """Labels from an exported policy; see `teachers.Labels`. It has no state between steps."""

    def __init__(self, env: Env, policy: str, device: torch.device) -> None:
        """`policy`: the name of a file in policies/checkpoints, or the path of an ONNX file.

        Raises TrainingError if it cannot be flown, reads another history than `env` keeps, or has an unknown operator.
        """
        path = Path(policy) if policy.endswith(".onnx") else _FOLDER / f"{policy}.onnx"
        try:
            contract = open_policy(path).contract
            check_contract(contract)
        except ContractError as error:
            raise TrainingError(f"teacher: {error}") from None
        if contract.observation.stride != env.config.stride:
            raise TrainingError(
                f"teacher {policy} reads a history of stride {contract.observation.stride}, the recipe keeps "
                f"{env.config.stride}: set env.stride to that"
            )
        self._graph = Graph(path, device)
        theirs, ours = contract.action, env.shared.limits
        low, high = theirs.thrust_min - ours[limits_row.THRUST_MIN], theirs.thrust_max - ours[limits_row.THRUST_MIN]
        span = ours[limits_row.THRUST_MAX] - ours[limits_row.THRUST_MIN]
        # of an action in the teacher's limits, what it is in the vehicle's: factor * action + offset
        factor = (*(theirs.rate_max / ours[limits_row.BODY_RATE],) * 3, (high - low) / span)
        self._factor = torch.tensor(factor, dtype=torch.float32, device=device)
        self._offset = torch.tensor((0.0, 0.0, 0.0, (high + low) / span - 1.0), dtype=torch.float32, device=device)

    def act(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Labels (N, 4) in [-1, 1] for observations (N, OBS_DIM), and (N,) ones: each may be learnt from.

        Observations and labels are in the limits of the environment's airframe; they are converted from and to the
        teacher's own limits.
        """
        before = slice(TAIL + tail_row.ACTION, TAIL + tail_row.ACTION + 4)
        seen = observation.clone()
        seen[:, before] = (observation[:, before] - self._offset) / self._factor
        label = (self._graph(seen) * self._factor + self._offset).clamp(-1.0, 1.0)
        return label, torch.ones_like(label[:, 0])

    def state(self) -> dict:
        """For a checkpoint."""
        return {}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""


class Graph:
    """An ONNX graph with one input and one output. Integer tensors (shapes, indices) stay on the host."""

    def __init__(self, path: Path, device: torch.device) -> None:
        """Raises TrainingError for an operator that this project's exporter does not write."""
        graph = onnx.load(path).graph
        self._input, self._output = graph.input[0].name, graph.output[0].name
        self._values: dict[str, Tensor] = {each.name: _tensor(each, device) for each in graph.initializer}
        self._nodes = []
        for node in graph.node:
            if node.op_type == "Constant":
                self._values[node.output[0]] = _tensor(node.attribute[0].t, device)
            elif node.op_type not in _OPERATORS:
                raise TrainingError(f"teacher {path}: operator {node.op_type} is not known")
            else:
                self._nodes.append(
                    (_OPERATORS[node.op_type](_attributes(node, device)), list(node.input), list(node.output))
                )

    @torch.no_grad()
    def __call__(self, observation: Tensor) -> Tensor:
        values = {**self._values, self._input: observation}
        for operator, inputs, outputs in self._nodes:
            result = operator([values[name] if name else _NOTHING for name in inputs])
            if len(outputs) == 1:
                values[outputs[0]] = result  # type: ignore[assignment]
            else:
                values.update(zip(outputs, result, strict=True))
        return values[self._output]


_NOTHING = torch.zeros(0)  # an optional input that is left out


def _tensor(data: onnx.TensorProto, device: torch.device) -> Tensor:
    array = torch.from_numpy(np.array(numpy_helper.to_array(data)))
    return array.to(device) if array.is_floating_point() else array


def _attributes(node: NodeProto, device: torch.device) -> dict:
    return {each.name: onnx.helper.get_attribute_value(each) for each in node.attribute} | {"device": device}


def _slice(x: _Inputs) -> Tensor:
    data, starts, ends = x[0], x[1].tolist(), x[2].tolist()
    axes = x[3].tolist() if len(x) > 3 and len(x[3]) else range(len(starts))
    steps = x[4].tolist() if len(x) > 4 else [1] * len(starts)
    for axis, start, end, step in zip(axes, starts, ends, steps, strict=True):
        at = range(*slice(start, end, step).indices(data.shape[axis]))
        data = data[(slice(None),) * axis + (slice(at.start, at.stop, at.step),)]
    return data


def _clip(x: _Inputs) -> Tensor:
    low, high = (bound if bound.numel() else None for bound in (*x[1:], _NOTHING, _NOTHING)[:2])
    return torch.clamp(x[0], low, high)


def _divided(a: Tensor, b: Tensor) -> Tensor:
    return torch.div(a, b, rounding_mode=None if a.is_floating_point() else "trunc")


def _gather(axis: int) -> Callable[[_Inputs], Tensor]:
    def gathered(x: _Inputs) -> Tensor:
        return x[0].select(axis, int(x[1])) if x[1].ndim == 0 else x[0].index_select(axis, x[1].to(x[0].device))

    return gathered


def _gemm(a: dict) -> Callable[[_Inputs], Tensor]:
    if a.get("alpha", 1.0) != 1.0 or a.get("beta", 1.0) != 1.0 or a.get("transA", 0):
        raise TrainingError("teacher: only plain Gemm is known")
    return lambda x: functional.linear(x[0], x[1] if a.get("transB", 0) else x[1].T, x[2])


def _reduce(function: Callable) -> Callable[[dict], Callable[[_Inputs], Tensor]]:
    """Axes are an attribute or, in newer operators, the second input."""

    def made(a: dict) -> Callable[[_Inputs], Tensor]:
        keep, fixed = bool(a.get("keepdims", 1)), tuple(a.get("axes", ()))
        return lambda x: function(x[0], fixed or tuple(x[1].tolist()), keep)

    return made


def _unsqueeze(x: _Inputs) -> Tensor:
    data = x[0]
    for axis in sorted(x[1].tolist()):
        data = data.unsqueeze(axis)
    return data


def _split(axis: int) -> Callable[[_Inputs], tuple[Tensor, ...]]:
    return lambda x: x[0].split(x[1].tolist(), axis)


def _pairwise(function: Callable[[Tensor, Tensor], Tensor]) -> Callable[[dict], Callable[[_Inputs], Tensor]]:
    return lambda _: lambda x: function(x[0], x[1])


def _single(function: Callable[[Tensor], Tensor]) -> Callable[[dict], Callable[[_Inputs], Tensor]]:
    return lambda _: lambda x: function(x[0])


def _filled(a: dict) -> Callable[[_Inputs], Tensor]:
    value = numpy_helper.to_array(a["value"]).item() if "value" in a else 0.0
    if isinstance(value, int):
        return lambda x: torch.full(tuple(x[0].tolist()), value, dtype=torch.int64)
    return lambda x: torch.full(tuple(x[0].tolist()), value, device=a["device"])


# Operator -> what its attributes make of it: a function of its inputs.
_OPERATORS: dict[str, Callable[[dict], Callable[[_Inputs], Tensor | tuple[Tensor, ...]]]] = {
    "Add": _pairwise(torch.add),
    "Sub": _pairwise(torch.sub),
    "Mul": _pairwise(torch.mul),
    "Div": _pairwise(_divided),
    "Pow": _pairwise(torch.pow),
    "MatMul": _pairwise(torch.matmul),
    "And": _pairwise(torch.logical_and),
    "Less": _pairwise(torch.lt),
    "LessOrEqual": _pairwise(torch.le),
    "Greater": _pairwise(torch.gt),
    "GreaterOrEqual": _pairwise(torch.ge),
    "Sqrt": _single(torch.sqrt),
    "Neg": _single(torch.neg),
    "Atan": _single(torch.atan),
    "Reciprocal": _single(torch.reciprocal),
    "Shape": _single(lambda x: torch.tensor(x.shape)),
    "Elu": lambda a: lambda x: functional.elu(x[0], a.get("alpha", 1.0)),
    "Gemm": _gemm,
    "Clip": lambda _: _clip,
    "Slice": lambda _: _slice,
    "Concat": lambda a: lambda x: torch.cat(x, a["axis"]),
    "Split": lambda a: _split(a.get("axis", 0)),
    "Gather": lambda a: _gather(a.get("axis", 0)),
    "Unsqueeze": lambda _: _unsqueeze,
    "Reshape": lambda _: lambda x: x[0].reshape(x[1].tolist()),
    "ConstantOfShape": _filled,
    "Where": lambda _: lambda x: torch.where(x[0], x[1], x[2]),
    "ReduceSum": _reduce(lambda x, axes, keep: x.sum(axes, keepdim=keep)),
    "ReduceMax": _reduce(lambda x, axes, keep: x.amax(axes, keepdim=keep)),
    "ReduceMin": _reduce(lambda x, axes, keep: x.amin(axes, keepdim=keep)),
    "ReduceL2": _reduce(lambda x, axes, keep: torch.linalg.vector_norm(x, dim=axes, keepdim=keep)),
}
