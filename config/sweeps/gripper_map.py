"""Grippers with other arms, and how fast they hold the ball."""

BARE = 2.2e-3
"""Of an arm, from its end: it has no upper layer there [m]."""
LIFT = 13.5
"""When the hub begins to rise [s]."""
WEIGHT = 0.027
"""Of the ball that the scene has [N]."""


def change(content, parameters):
    """Make the arms as long as `length`, with stations as far apart as those of the scene."""
    arm, length = content["rods"][0], parameters["length"]
    arm["stations"] = 1 + round((arm["stations"] - 1) * length / arm["path"]["length"])
    arm["path"]["length"] = length
    arm["layers"][1]["interval"] = [0.0, length - BARE]
    return content


def holding_force(run):
    """Return the largest upward force of the arms on the ball, which is held fast, while the hub rises [N].

    None if it would not lift the ball of the scene.
    """
    wrench = run.recording["body/ball/contact_wrench"].values
    force = float(wrench[run.recording.times >= LIFT, 2].max())
    return force if force > WEIGHT else None
