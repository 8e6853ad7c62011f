"""A scene as PDF in its real size, curves as curves and no fonts."""

from __future__ import annotations

import io

from orbiflow.export.drawing import drawn
from orbiflow.export.scene import Scene


def write_pdf(scene: Scene) -> bytes:
    """The scene as one page; the same scene gives the same bytes."""
    buffer = io.BytesIO()
    metadata = {
        "Title": scene.title,
        "Subject": " ".join(scene.notes),
        "Creator": "orbiflow",
        "CreationDate": None,
    }
    drawn(scene).savefig(buffer, format="pdf", metadata=metadata, facecolor="none")
    return buffer.getvalue()
