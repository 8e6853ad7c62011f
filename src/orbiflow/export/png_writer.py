"""A scene as a picture of pixels."""

from __future__ import annotations

import io

from orbiflow.errors import OrbiflowError
from orbiflow.export.drawing import INCH, drawn
from orbiflow.export.scene import Scene

MOST_PIXELS = 100_000_000


def write_png(scene: Scene, *, dpi: float = 300.0) -> bytes:
    """The scene as PNG that says its resolution, so that it prints in its real size.

    Raises:
        OrbiflowError: for more than `MOST_PIXELS`.
    """
    width, height = (side * dpi / INCH for side in (scene.width, scene.height))
    if width * height > MOST_PIXELS or max(width, height) >= 2**16:
        raise OrbiflowError(
            f"at {dpi:g} dots per inch the page has {width:.0f} x {height:.0f} pixels; "
            f"choose fewer dots or another format"
        )
    if min(width, height) < 1:
        raise OrbiflowError(f"at {dpi:g} dots per inch the page has no pixel; choose more dots")
    figure = drawn(scene, least_width=INCH / dpi)
    buffer = io.BytesIO()
    metadata = {"Title": scene.title, "Description": " ".join(scene.notes), "Software": "orbiflow"}
    figure.savefig(buffer, format="png", dpi=dpi, metadata=metadata)
    return buffer.getvalue()
