"""Films: pictures one after the other as MP4, encoded by the ffmpeg that comes with imageio-ffmpeg."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bilayer_core.record.paths import draft_of

if TYPE_CHECKING:
    from PIL import Image

ENCODING = ["-preset", "superfast", "-crf", "21", "-movflags", "+faststart", "-f", "mp4"]
"""Of x264: small enough to send, no blocks to be seen; a film begins before all of it is loaded."""


def save_mp4(pictures: Iterable[Image.Image], size: tuple[int, int], rate: float, path: str | Path) -> int:
    """Write a film and return how many pictures it has.

    Parameters
    ----------
    pictures : iterable of Image
        RGB, each of the same size; taken one by one.
    size : tuple of int
        Width and height, both even.
    rate : float
        Pictures a second.
    path : str or Path

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    import imageio_ffmpeg

    with draft_of(path, force=True) as draft:
        writer = imageio_ffmpeg.write_frames(
            str(draft), size, fps=rate, codec="libx264", quality=None, macro_block_size=1, output_params=ENCODING
        )
        count = 0
        try:
            writer.send(None)
            for picture in pictures:
                writer.send(picture.tobytes())
                count += 1
        finally:
            writer.close()
        if not draft.is_file() or not draft.stat().st_size:
            raise OSError(None, "the encoder wrote nothing")
    return count
