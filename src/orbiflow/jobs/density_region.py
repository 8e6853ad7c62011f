"""Regions of highest density, with their outlines: the job of a `DensityRegionRequest`."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

from orbiflow.density import (
    DensityLevels,
    DensityRegion,
    Outline,
    outlines,
    to_geojson,
)
from orbiflow.density.operations import model_at
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.asked import samples_asked
from orbiflow.jobs.density_compare_requests import DensityRegionRequest
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.jobs.wording import (
    counted,
    percentage,
    with_error,
)
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    Written,
    one_thread,
    write_atomic,
)

MASSES = (0.5, 0.9)


@one_thread()
def density_region(request: DensityRegionRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Find thresholds and outlines, and write them.

    Returns:
        `summary`: `file` and `regions`, each with its mass, threshold and size.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_place(request.out, request.model)
    density, _ = model_at(request.model)
    kind = request.out.suffix.lower()
    space = density.space
    if kind == ".geojson" and not space.is_round:
        raise OrbiflowError(
            f"{request.out}: GeoJSON is for places on a globe, not for the angles of a {space.name}: "
            "write .json or .csv"
        )
    if kind == ".csv" and space.dim != 2:
        raise OrbiflowError(
            f"{request.out}: a table is of outlines, which are drawn in two dimensions; this "
            f"{space.name} has {space.dim}: write .json, and `orbiflow density "
            "score --region` for the rows inside"
        )
    masses = MASSES if request.mass is None and request.level is None else request.mass or ()
    samples = samples_asked(request, masses)
    tell(Progress(0.0, f"drawing {samples} samples"))
    cancel.check()
    levels = DensityLevels(density, samples=samples, seed=request.seed)
    regions = [levels.highest(mass) for mass in masses]
    regions += [levels.above(level) for level in request.level or ()]

    reached = 0.1

    def told(share: float, what: str) -> None:
        nonlocal reached
        cancel.check()
        reached = max(reached, 0.1 + 0.9 * share)
        tell(Progress(reached, what))

    drawn: list[Outline] = []
    if space.dim == 2:
        drawn = outlines(levels, regions, budget=request.budget, seed=request.seed, told=told)
    else:
        tell(
            Note(
                f"outlines are drawn in two dimensions, this {space.name} has {space.dim}: thresholds "
                "and sizes alone; `orbiflow density score --region` says of each row how far in it is"
            )
        )
    if kind == ".geojson":
        text = json.dumps(to_geojson(drawn), allow_nan=False)
    elif kind == ".csv":
        text = _csv(drawn)
    else:
        text = json.dumps(
            _document(request, samples, density.space, regions, drawn), allow_nan=False
        )
    cancel.check()
    write_atomic(request.out, text)
    tell(Written(request.out))
    unit = _unit(density.space)
    for k, region in enumerate(regions):
        tell(Note(_said(region, drawn[k] if drawn else None, unit)))
        for note in drawn[k].notes if drawn else ():
            tell(Note(note))
    tell(Note(f"written to {request.out}"))
    told_of = [region.to_json() for region in regions]
    return Finished("done", {"file": str(request.out), "regions": told_of})


def _document(
    request: DensityRegionRequest,
    samples: int,
    space: Any,
    regions: list[DensityRegion],
    drawn: list[Outline],
) -> dict[str, Any]:
    """Of a .json."""
    document: dict[str, Any] = {
        "kind": "regions",
        "space": {"name": space.name, **space.settings()},
        "size_unit": _unit(space),
        "samples": samples,
        "seed": request.seed,
    }
    if drawn:
        document["axes"] = list(drawn[0].window.names)
        document["window"] = [drawn[0].window.low.tolist(), drawn[0].window.high.tolist()]
        document["edges"] = drawn[0].window.edges
    document["regions"] = [one.to_json() for one in drawn or regions]
    return document


def _csv(drawn: list[Outline]) -> str:
    """A vertex a row."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["region", "mass", "log_prob", "polygon", "ring", *drawn[0].window.names])
    for number, outline in enumerate(drawn, 1):
        mass = "" if outline.region.mass is None else f"{outline.region.mass:g}"
        level = f"{outline.region.log_prob:.10g}"
        for polygon, rings in enumerate(outline.rings(), 1):
            for ring, points in enumerate(rings):
                for x, y in points:
                    writer.writerow([number, mass, level, polygon, ring, f"{x:.10g}", f"{y:.10g}"])
    return text.getvalue()


def _unit(space: Any) -> str:
    if space.is_round:
        return "steradians"
    return space.unit if space.dim == 1 else f"{space.unit}^{space.dim}"


def _said(region: DensityRegion, outline: Outline | None, unit: str) -> str:
    size, fraction = region.size, region.fraction
    drawn = ""
    if outline is not None:
        size, fraction = outline.size, outline.fraction
        count = len(outline.shape.geoms)
        holds = "holds" if count == 1 else "hold"
        drawn = f"; {counted(count, 'polygon')}, which {holds} "
        drawn += with_error(outline.mass, outline.error)
    return (
        f"mass {with_error(region.held, region.error)}: log density of at least "
        f"{region.log_prob:.4f} ({region.log_prob_low:.4f} to {region.log_prob_high:.4f}), "
        f"{size:.6g} {unit}, {percentage(fraction)} of the space{drawn}"
    )
