"""When an animation is how far: there and back in a loop, slow at both ends, with rests."""

from __future__ import annotations

from typing import NamedTuple

REST, MOVE, SHOW = 0.07, 0.37, 0.19
"""Shares of the loop: the rest at the start, each way, and the rest at the end, where the tile is."""


class Frame(NamedTuple):
    """A picture of a loop: its `progress`, 0 to 1, and for how many `seconds` it is seen."""

    progress: float
    seconds: float


def eased(share: float) -> float:
    """0 to 1, slow at both ends.

    >>> [round(eased(share), 3) for share in (0.0, 0.25, 0.5, 1.0)]
    [0.0, 0.156, 0.5, 1.0]
    """
    return share * share * (3 - 2 * share)


def progress(time: float) -> float:
    """How far the loop is at a time, 0 to 1, of it.

    >>> [round(progress(time), 3) for time in (0.0, 0.255, 0.5, 0.815)]
    [0.0, 0.5, 1.0, 0.5]
    """
    if time < REST:
        return 0.0
    if time < REST + MOVE:
        return eased((time - REST) / MOVE)
    if time < REST + MOVE + SHOW:
        return 1.0
    return eased(max(0.0, 1 - (time - REST - MOVE - SHOW) / MOVE))


def frames(seconds: float, fps: float) -> list[Frame]:
    """The pictures of a loop; those that follow each other and are the same are one.

    The way back has the pictures of the way there.
    """
    way = max(2, round(MOVE * seconds * fps))
    there = [Frame(eased(k / way), MOVE * seconds / way) for k in range(1, way)]
    return [
        Frame(0.0, REST * seconds + MOVE * seconds / way),
        *there,
        Frame(1.0, SHOW * seconds + MOVE * seconds / way),
        *reversed(there),
    ]
