"""Films: pictures one after the other as MP4, encoded by the ffmpeg that comes with imageio-ffmpeg."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

from bilayer_core.log.file.output_paths import draft_of

if TYPE_CHECKING:
    from PIL import Image

ENCODING = "-an -c:v libx264 -pix_fmt yuv420p -preset superfast -crf 21 -movflags +faststart -f mp4".split()
"""Of x264: small enough to send, no blocks to be seen; a film begins before all of it is loaded."""


def save_mp4(pictures: Iterable[Image.Image], size: tuple[int, int], rate: float, path: str | Path) -> int:
    """Write a film and return how many pictures it has.

    `pictures`: RGB, each of the same size; taken one by one. `size`: width and height, both even. `rate`: pictures a
    second. Raises OutputError if it cannot be written.
    """
    from imageio_ffmpeg import get_ffmpeg_exe

    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:.12g}", "-i", "-"]
    with draft_of(path, force=True) as draft, tempfile.TemporaryFile() as said:
        command = [get_ffmpeg_exe(), "-y", "-v", "warning", *source, *ENCODING, str(draft)]
        encoder = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said, restore_signals=False
        )
        try:
            count = _send(pictures, encoder.stdin)
            failed = encoder.wait()
        finally:
            encoder.kill()  # it has ended, but for an exception
            encoder.wait()
        said.seek(0)
        lines = said.read().decode(errors="replace").strip().splitlines()
        if failed or not draft.is_file() or not draft.stat().st_size:
            raise OSError(None, lines[0].rpartition(": ")[2] if lines else "the encoder wrote nothing")
    return count


def _send(pictures: Iterable[Image.Image], encoder: IO[bytes]) -> int:
    """Send pictures to an encoder, as long as it takes them; return how many were sent."""
    count = 0
    with suppress(BrokenPipeError), encoder:  # it ended early, and its exit code and last words say why
        for picture in pictures:
            encoder.write(picture.tobytes())
            count += 1
    return count
