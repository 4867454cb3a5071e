"""Colours of pictures: the background of choice, and what stands out against it."""

from __future__ import annotations

from dataclasses import dataclass

from bilayer_core.errors import InputError

BACKGROUND = (28, 30, 34)
OBSTACLE_COLOURS = ((112, 122, 138), (98, 107, 122))
BALL_COLOURS = ((245, 166, 35), (226, 217, 200))
JOINT_COLOURS = ((205, 210, 218), (150, 156, 166))
ARROW_COLOUR = (64, 224, 148)
REACTION_COLOURS = {"clamp_forces": (80, 160, 255), "clamp_moments": (200, 110, 235)}
SIDE_SHADE = 0.9  # brightness of the narrow faces of ribbons: layers are read there, by the colour bar
Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Theme:
    """Colours of a picture."""

    background: Colour  # Red, green and blue; what a transparent one is drawn for
    transparent: bool
    text: Colour
    halo: Colour
    """`text`, `halo`: of what is written, and of its outline."""
    ground: tuple[Colour, Colour]  # Squares of planes


def theme_of(background: str) -> Theme:
    """Return the theme of a background.

    A background is ``dark``, ``white``, ``transparent``, or a colour that Pillow knows (``#f4f1e8``). Raises InputError
    if it is none of these.
    """
    from PIL import ImageColor

    if background == "transparent":
        return Theme((255, 255, 255), True, (30, 33, 38), (255, 255, 255), ((205, 209, 215), (186, 191, 199)))
    if background == "dark":
        colour: Colour = BACKGROUND
    else:
        try:
            colour = ImageColor.getrgb(background)[:3]
        except ValueError:
            raise InputError(
                f"--background: found {background!r}; allowed are dark, white, transparent, and colours such as "
                "'#f4f1e8' or 'lightgrey'"
            ) from None
    light = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 127.0
    if colour == BACKGROUND:
        ground = ((74, 79, 88), (62, 66, 74))
    else:
        shades = (0.89, 0.81) if light else (0.80, 0.86)
        other = 0.0 if light else 255.0
        ground = tuple(tuple(round(share * c + (1 - share) * other) for c in colour) for share in shades)
    text, halo = ((30, 33, 38), (255, 255, 255)) if light else ((225, 228, 232), (12, 13, 15))
    return Theme(colour, False, text, halo, ground)
