"""The operation that tells the figures of a texture, which is a density of orientations."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.density.operations.drawing import Model
from orbiflow.density.run_folder import write_file
from orbiflow.settings import DefaultText, Ending, Option, Range, Settings, Unit

if TYPE_CHECKING:
    from orbiflow.density.models import Density


class TextureSettings(Settings, group="Texture"):
    """Which shares of a texture are told."""

    near: Annotated[tuple[str, ...] | None, DefaultText("all of them for cubic crystals")] = None
    """Ideal orientations, of cube, goss, brass, copper and s, of which the volume fractions near them
    are told, those of all variants in a rolled sheet together."""

    orientation: Annotated[tuple[float, ...] | None, DefaultText("none")] = None
    """An orientation of which the volume fraction near it is told, as the data write theirs: Bunge's
    angles, for a model of such."""

    within: Annotated[float, Range(above=0, most=60), Unit("degrees")] = 15.0
    """Angle within which an orientation is near another."""


@runtime.operation("density texture")
def texture(
    settings: TextureSettings = TextureSettings(),
    *,
    model: Model,
    out: Annotated[Path | None, DefaultText("none"), Option("-o"), Ending(".json")] = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Tell the figures of a fitted texture: index, entropy, its highest place, volume fractions.

    Args:
        model: Folder that `fit` wrote.
        out: A .json for the figures.
    """
    from orbiflow.density.operations.saved import model_at

    if out is not None:
        runtime.check_output_file(out, model)
    density, _ = model_at(model)
    with runtime.one_thread():
        found = _figures(density, settings, runtime.progress_events(on_event, cancel))
    for table in _tables(found, settings.within):
        on_event(table)
    document = {"kind": "texture", "within": settings.within, **found}
    if out is not None:
        text = json.dumps(document, allow_nan=False, indent=1)
        write_file(out, text, on_event, f"written to {out}")
    return runtime.Outcome({"file": None if out is None else str(out), **document})


def _figures(density: Density, settings: TextureSettings, progress: Any) -> dict[str, Any]:
    """Return the figures as JSON has them, each with its standard error."""
    import torch

    from orbiflow.density import inference, orientations

    space = inference.rotations_only(density)
    named = {
        name: orientations.ideal_variants(name)
        for name in orientations.near_names(space, settings.near)
    }
    if settings.orientation is not None:
        named["orientation"] = space.to_chart([settings.orientation])
    progress(0.0, "integrating the square")
    index = inference.texture_index(density)
    progress(0.4, "estimating the entropy")
    entropy = density.estimated_entropy(measure="uniform")
    progress(0.6, "finding the highest place")
    mode = density.mode
    with torch.no_grad():
        peak = float(density.log_prob(mode[None], measure="uniform").exp())
    progress(0.8, "counting volume fractions")
    reach = math.radians(settings.within)
    shares = inference.fractions_near(density, list(named.values()), reach)
    return {
        "index": index.value,
        "index_error": index.error,
        "entropy": entropy.value,
        "entropy_error": entropy.error,
        "mode": space.from_chart(mode[None])[0].tolist(),
        "mode_density": peak,
        "fractions": [
            {"name": name, "share": share.value, "error": share.error}
            for name, share in zip(named, shares, strict=True)
        ],
    }


def _tables(found: dict[str, Any], within: float) -> list[runtime.Table]:
    error = found["index_error"]
    index = f"{found['index']:.5g}" + (f" \u00b1 {error:.2g}" if error else ", exact")
    lines = (
        ("texture index, the mean of the squared density", index),
        ("entropy, nats", f"{found['entropy']:.4f} \u00b1 {found['entropy_error']:.4f}"),
        ("highest at", ", ".join(f"{value:.5g}" for value in found["mode"])),
        ("density there, multiples of random", f"{found['mode_density']:.4g}"),
    )
    made = [runtime.Table("Texture", ("figure", "value"), lines)]
    shares = tuple(
        (one["name"], f"{100 * one['share']:.2f}", f"{100 * one['error']:.2f}")
        for one in found["fractions"]
    )
    heads = (f"within {within:g} degrees of", "% of the volume", "standard error")
    return [*made, runtime.Table("Volume fractions", heads, shares)] if shares else made
