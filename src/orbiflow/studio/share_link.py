"""A tile as a text that a link carries: nothing is kept on a server, and any studio opens it.

The text is the tile's entry in a result file without its measures and map, compressed. Whoever opens
it gets a project with that tile, which is read and certified as one out of a project's file.
"""

from __future__ import annotations

import base64
import binascii
import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

from orbiflow.errors import InputFileError
from orbiflow.runtime import is_object
from orbiflow.studio.project_file import FORMAT, PROJECT

MAX_TEXT = 60_000  # characters of a link's text
MAX_UNPACKED = 1_000_000  # bytes of what it holds
MAX_NAME = 80  # characters of a project's name
ENTRY = (
    "class",
    "arrangement",
    "objective",
    "rating",
    "score",
    "polygon",
    "corners",
    "group",
    "parts",
)
LOOK = ("palette", "custom", "line")
MEASURES = ("bent", "metrics", "recognisability", "thinnest")
NO_PICTURE = "shared"  # the source of a tile that comes without its silhouette
DIGITS = 12  # of coordinates: rounding stays far below what a certificate allows
DAMAGED = "the link is damaged or cut off; copy all of it again"


def link_text(result: Path, name: str, look: Any) -> str:
    """Return the text of a link to a tile.

    Args:
        result: The tile's folder.
        name: What the project is called.
        look: Its colours and lines, as pages remember them.

    Raises:
        InputFileError: If the tile has too many points for a link.
    """
    document = json.loads((result / "result.json").read_text("utf-8"))
    entry = {key: value for key, value in document["tiles"][0].items() if key in ENTRY}
    parts = [
        {k: v for k, v in part.items() if k not in MEASURES} for part in entry.get("parts", ())
    ]
    content = {
        "schema": document["schema_version"],
        "name": name[:MAX_NAME],
        "y_down": bool(document["input"]["y_down"]),
        "look": {key: value for key, value in (look or {}).items() if key in LOOK},
        "tile": _short({**entry, "parts": parts} if parts else entry),
    }
    plain = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
    text = base64.urlsafe_b64encode(zlib.compress(plain, 9)).decode().rstrip("=")
    if len(text) > MAX_TEXT:
        raise InputFileError("the tile has too many points for a link; save the project instead")
    return text


def _short(value: Any) -> Any:
    """Return JSON whose lists of points have no more digits than are needed."""
    if isinstance(value, dict):
        return {key: item if key == "group" else _short(item) for key, item in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], list):
        import numpy as np

        points = np.asarray(value, dtype=np.float64)
        size = float(abs(points).max()) or 1.0
        return np.round(points, DIGITS - 1 - int(np.floor(np.log10(size)))).tolist()
    return value


def write_linked(text: str, out: Path) -> None:
    """Write what a link's text holds as a project's file; its tile is not looked at yet.

    Raises:
        InputFileError: If the text is too long or none of a link.
    """
    if len(text) > MAX_TEXT:
        raise InputFileError("the link is too long; open a project's file instead")
    try:
        packed = base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
        unpacker = zlib.decompressobj()
        plain = unpacker.decompress(packed, MAX_UNPACKED)
        content = json.loads(plain)
    except (binascii.Error, zlib.error, ValueError, RecursionError) as error:
        raise InputFileError(DAMAGED) from error
    if not unpacker.eof or not is_object(content) or not is_object(content.get("tile")):
        raise InputFileError(DAMAGED)
    look, name = content.get("look"), content.get("name")
    look = look if is_object(look) else {}
    view = {"look": {key: look[key] for key in LOOK if key in look}}
    name = name[:MAX_NAME] if isinstance(name, str) and name.strip() else "Shared tile"
    project = {"format": FORMAT, "name": name, "kind": "tile", "view": view, "tiles": [{"id": 1}]}
    result = {
        "schema_version": content.get("schema"),
        "input": {"source": NO_PICTURE, "y_down": bool(content.get("y_down"))},
        "tiles": [{key: value for key, value in content["tile"].items() if key in ENTRY}],
    }
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr(PROJECT, json.dumps(project))
        archive.writestr("tiles/1/result.json", json.dumps(result))
