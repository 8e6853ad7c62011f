"""The files of an escherized class: artwork, pictures and the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from orbiflow.draw.field import field_png
from orbiflow.draw.files import write_atomic
from orbiflow.draw.raster import overlay_png, tiling_png
from orbiflow.draw.svg import tile_svg, tiling_svg
from orbiflow.errors import OutputError
from orbiflow.escher.model import TileModel
from orbiflow.escher.result import TileResult
from orbiflow.escher.target import Target
from orbiflow.tilings import colouring


def make_folder(path: Path) -> Path:
    """Create a folder (and its parents) that can be written to.

    Raises:
        OutputError: if it cannot be.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".orbiflow-write-test"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"cannot write into {path}: {error.strerror or error}; choose another --out"
        ) from error
    return path


def write_tile_folder(result: TileResult, target: Target, folder: Path) -> list[Path]:
    """Write tile.svg, tiling.svg, tiling.png, overlay.png, field.png and model.safetensors.

    Raises:
        OutputError: if a file cannot be written.
    """
    make_folder(folder)
    y_down = target.y_down
    colours = colouring(result.tile)
    title = f"{target.source.rsplit('/', 1)[-1]}, {result.name} ({result.group_name})"
    if not result.certificate.valid:
        title += ", NOT CERTIFIED"
    label = f"{result.name} ({result.group_name})"
    contents: dict[str, Callable[[], str | bytes]] = {
        "tile.svg": lambda: tile_svg(result.tile, y_down=y_down, title=title),
        "tiling.svg": lambda: tiling_svg(result.tile, y_down=y_down, title=title, colours=colours),
        "tiling.png": lambda: tiling_png(result.tile, y_down=y_down, colours=colours),
        "overlay.png": lambda: overlay_png(result.tile, target.outline, y_down=y_down, label=label),
        "field.png": lambda: field_png(
            placed_field(result.model.restore()), result.normal_tile.group, result.normal_tile
        ),
        "model.safetensors": result.model.to_bytes,
    }
    return [write_atomic(folder / name, make()) for name, make in contents.items()]


def placed_field(model: TileModel) -> Callable[[Tensor], Tensor]:
    """The vector field of a single candidate, pushed forward by A o L to the target's normal form.

    The mean over time, where the flow has several segments.
    """
    linear = model.linear().detach()[0]
    # fields are linear in their parameters: one evaluation for any number of segments
    parameters = torch.stack([segment.parameters_.detach() for segment in model.fourier_fields()])
    mean = model.with_fields([parameters.mean(dim=0)])

    @torch.no_grad()
    def field(points: Tensor) -> Tensor:
        flat = points.to(linear).reshape(1, -1, 2)
        return (mean.flow.segments[0](model.unplace(flat)) @ linear.mT).reshape(points.shape)

    return field
