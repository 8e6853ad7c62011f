"""How a silhouette is read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from orbiflow.settings import DefaultText, Range, Settings

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.target import Target


class ReadingSettings(Settings, group="Reading the silhouette"):
    """How a silhouette is read."""

    threshold: Annotated[float | None, Range(0, 1), DefaultText("found automatically")] = None
    """Level between shape and background."""

    invert: Annotated[bool | None, DefaultText("found automatically")] = None
    """Whether the shape is the light part of a picture, or the hole in what a drawing shows."""

    thicken: Annotated[float, Range(0, 0.2)] = 0.0
    """Grow legs and other parts thinner than this share of the silhouette's length, such as 0.04, to
    this width. Gaps stay open."""

    smooth: Annotated[float, Range(0, 0.2)] = 0.0
    """Round off noise and details narrower than this share of the silhouette's length, such as 0.01."""

    def read(self, image: Path, called: str | None = None) -> Target:
        """Return the silhouette in a file, which results call `called` or by its path."""
        from orbiflow.tiles.silhouette.target import Target

        target = Target.read(image, threshold=self.threshold, invert=self.invert)
        return self.shaped(replace(target, source=called or target.source))

    def shaped(self, target: Target) -> Target:
        """Return a silhouette with thin parts grown, and then details rounded off."""
        return target.thickened(self.thicken).smoothed(self.smooth)
