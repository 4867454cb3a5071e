"""Names that are almost those of a node: nothing connects them, and ROS says nothing about it."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Mapping

LIKENESS = 0.75
"""Of two names from which one may be meant by the other; 1 = the same."""


def nearest(name: str, names: Iterable[str], prefix: str = "") -> str:
    """Return the name that was meant, or an empty text; a prefix that all names share does not count."""
    tails = {other.removeprefix(prefix): other for other in names}
    close = difflib.get_close_matches(name.removeprefix(prefix), tails, n=1, cutoff=LIKENESS)
    return tails[close[0]] if close else ""


def of_topics(
    prefix: str,
    inputs: Mapping[str, str],
    outputs: Collection[str],
    published: Mapping[str, Collection[str]],
    subscribed: Collection[str],
) -> dict[str, str]:
    """Describe the topics on which a node and others miss each other.

    Parameters
    ----------
    prefix : str
        What names of the node begin with; others belong to nobody here.
    inputs : mapping
        Topics that the node subscribes to, with their types.
    outputs : collection of str
        Topics that it publishes.
    published : mapping
        Topics that others publish, with the types of what they publish.
    subscribed : collection of str
        Topics that others subscribe to.

    Returns
    -------
    dict
        Topic -> sentence.
    """
    said = {}
    for topic, types in published.items():
        if topic in inputs:
            wrong = sorted(set(types) - {inputs[topic]})
            if wrong:
                said[topic] = f"{topic} is published as {', '.join(wrong)}, which is not heard: it is {inputs[topic]}"
        elif topic.startswith(prefix) and topic not in outputs:
            meant = nearest(topic, inputs, prefix)
            family = topic.removeprefix(prefix).partition("/")[0]
            there = [name for name in inputs if name.startswith(f"{prefix}{family}/")]
            if meant:
                said[topic] = f"{topic} is published, but not heard: did you mean {meant}?"
            elif there:
                said[topic] = f"{topic} is published, but not heard: there are {', '.join(sorted(there))}"
    for topic in subscribed:
        if topic.startswith(prefix) and topic not in inputs and topic not in outputs and topic not in published:
            meant = nearest(topic, outputs, prefix)
            if meant:
                said[topic] = f"{topic} is listened to, but not published: did you mean {meant}?"
    return said
