"""What is measured of a tile, said in words as well."""

from __future__ import annotations

from typing import NamedTuple

from orbiflow.escher.result import TileResult


class Measure(NamedTuple):
    """A number and what it says: its `name`, `value` as text, `words` for it, and its `meaning`."""

    name: str
    value: str
    words: str
    meaning: str


def measures(result: TileResult) -> list[Measure]:
    """Of a tile, what counts most first; those that were not taken are left out."""
    found = [_score(result)]
    if result.deformation is not None:
        found.append(
            Measure(
                "Deformation",
                f"{result.deformation:.3f}",
                _word(
                    result.deformation,
                    (0.1, "bent a little"),
                    (0.2, "bent somewhat"),
                    (0.35, "bent much"),
                    "bent very much",
                ),
                "What bending the silhouette into the tile costs; 0 is the silhouette itself.",
            )
        )
    found += [
        Measure(
            "Overlap (IoU)",
            f"{result.metrics.iou:.3f}",
            f"{100 * result.metrics.dice:.0f} % of their areas in common",
            "Area common to tile and silhouette, as it is, over the area of both together.",
        ),
        Measure(
            "Recognised",
            f"{result.recognisability.score:.2f}",
            f"limbs {result.recognisability.limbs:.2f}",
            "Share of the outlines that is found again, point by point; 1 is all.",
        ),
    ]
    if result.thinnest is not None:
        thin = result.thinnest.share < max(result.min_neck, 0.02)
        found.append(
            Measure(
                "Thinnest neck",
                f"{100 * result.thinnest.share:.1f} %",
                "thin: mind it when you cut" if thin else "sound",
                "Its width, in hundredths of the square root of the tile's area.",
            )
        )
    if result.pinned is not None:
        found.append(
            Measure(
                "Pinned parts",
                f"{result.pinned:.4f}",
                "as they were" if result.pinned < 0.01 else "changed",
                "How far the worst of them is from similar to what it was; 0 is the same shape.",
            )
        )
    return found


POOR_MATCH, POOR_LIKENESS = 0.4, 0.2
"""Scores up to which a tile is called poor, after a search for overlap and for likeness."""


def is_poor(result: TileResult) -> bool:
    """Whether nobody would know the silhouette in it."""
    return result.score <= (POOR_MATCH if result.fidelity is None else POOR_LIKENESS)


def _score(result: TileResult) -> Measure:
    if result.fidelity is None:
        words = _word(
            -result.score,
            (-0.8, "a close match"),
            (-0.6, "a fair match"),
            (-POOR_MATCH, "a loose match"),
            "a poor match",
        )
        meaning = "Overlap and recognisability together, 0 to 1; tiles are ranked by it."
    else:
        words = _word(
            -result.score,
            (-0.6, "a good likeness"),
            (-0.4, "a middling likeness"),
            (-POOR_LIKENESS, "a loose likeness"),
            "a poor likeness",
        )
        meaning = "How much of the outline's shape bending left, 0 to 1; tiles are ranked by it."
    return Measure("Score", f"{result.score:.2f}", words, meaning)


def _word(value: float, *scale: tuple[float, str] | str) -> str:
    """The word of the first bound that the value is below; the last has none."""
    for step in scale:
        if isinstance(step, str):
            return step
        if value < step[0]:
            return step[1]
    return ""
