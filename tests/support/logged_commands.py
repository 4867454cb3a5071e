"""What acted in a run, from its log."""

from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_messages
from bilayer_core.observed.inputs import STIMULUS


def stimuli_taken(log) -> list[tuple[float, float]]:
    """Return when [s] which value of a stimulus was taken."""
    inputs = (decode_input(data) for _, _, _, data in read_messages(log, {INPUTS.full_name()}) if data is not None)
    return [(told.time, told.values[0]) for told in inputs if told.kind == STIMULUS]
