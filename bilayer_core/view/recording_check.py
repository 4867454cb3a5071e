"""Recordings from elsewhere: Markdown can name images, which the viewer would fetch, so `bilayer view` refuses it."""

from __future__ import annotations

import warnings
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as compute
from rerun.chunk import RrdReader

from bilayer_core.errors import InputError

MARKDOWN = "text/markdown"
_LISTS = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
_TEXTS = (pa.types.is_string, pa.types.is_large_string)


def refuse_markdown(path: Path) -> None:
    """Raise InputError if a recording or its layout says of any text that it is Markdown, or cannot be read."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # one that a follower was writing when it was killed has no index
            entity = _entity_with_markdown(RrdReader(path))
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a rerun recording: {error}") from error
    if entity is not None:
        raise InputError(
            f"{path}: the text of {entity} is Markdown, with which a recording can make the viewer fetch addresses. "
            "Make the recording again from its log with `bilayer view LOG.mcap --save FILE.rrd`, or, if you trust "
            "where it comes from, open it with `rerun`"
        )


def _entity_with_markdown(reader: RrdReader) -> str | None:
    """Return the first entity with the media type as a value: layouts can show any value as the media type."""
    for store in (*reader.recordings(), *reader.blueprints()):
        for chunk in reader.stream(store=store):
            for column in chunk.to_record_batch().columns:
                while any(is_kind(column.type) for is_kind in _LISTS):
                    column = column.flatten()
                is_text = any(is_kind(column.type) for is_kind in _TEXTS)
                if is_text and compute.any(compute.equal(column, MARKDOWN)).as_py():
                    return chunk.entity_path
    return None
