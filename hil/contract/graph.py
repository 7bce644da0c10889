"""A run's nodes, checked against the contract before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from hil.contract.topics import TOPICS, Knows, may_read, readers_of


class GraphError(ValueError):
    """The nodes do not fit the contract."""


class Declaration(Protocol):
    """What is checked of a node: its name and its topics."""

    @property
    def name(self) -> str: ...
    @property
    def inputs(self) -> tuple[str, ...]: ...
    @property
    def outputs(self) -> tuple[str, ...]: ...
    @property
    def wakes(self) -> tuple[str, ...]: ...


def check_graph(nodes: Sequence[Declaration], knows: Knows = "camera") -> None:
    """Every topic known, every input allowed and published by a node, every topic (but events) published once.

    `knows`: by what the policy may know of the board. Raises GraphError naming the node and the topic: above all when a
    node of the policy slot asks for the car's truth.
    """
    producers: dict[str, str] = {}
    for node in nodes:
        for topic in (*node.inputs, *node.outputs):
            if topic not in TOPICS:
                raise GraphError(
                    f"node {node.name!r} names topic {topic!r}, which hil/contract/topics.py does not list"
                )
        for topic in node.outputs:
            if topic != "event" and topic in producers:
                raise GraphError(f"topic {topic!r} is published by both {producers[topic]!r} and {node.name!r}")
            producers[topic] = node.name
    for node in nodes:
        for topic in node.inputs:
            if not may_read(node.name, topic, knows):
                readers = ", ".join(readers_of(topic, knows)) or "no node"
                raise GraphError(f"node {node.name!r} may not read {topic!r}: the contract allows {readers}")
            if topic not in producers:
                raise GraphError(f"node {node.name!r} reads {topic!r}, which no node of this graph publishes")
        for topic in node.wakes:
            if topic not in node.inputs:
                raise GraphError(f"node {node.name!r} wakes on {topic!r} without reading it")
