"""Label masks in colours are read by their labels, and flat drawings by their colours."""

import io
from collections.abc import Sequence

import numpy as np
import pytest
from PIL import Image

from orbiflow.tiles import FileContent, Reading, iou, read_outline

VOC = [[0, 0, 0], [128, 0, 0], [0, 128, 0], [128, 128, 0], [0, 0, 128], [128, 0, 128]]
VOC += [[0, 128, 128], [128, 128, 128], [64, 0, 0], [192, 0, 0], [64, 128, 0], [192, 128, 0]]
VOC += [[64, 0, 128], [192, 0, 128], [64, 128, 128], [192, 128, 128], [0, 64, 0], [128, 64, 0]]
VOC += [[0, 192, 0], [128, 192, 0], [0, 64, 128]]
PADDED = [*VOC, *([0, 0, 0] for _ in range(234)), [224, 224, 192]]
DAVIS = [[c - (c == 192) for c in colour] for colour in VOC] + [[k] * 3 for k in range(21, 256)]
OTHERS = [[k * 37 % 256, k * 91 % 256, k * 53 % 256] for k in range(256)]
VGA = [*VOC[:7], [192, 192, 192], [128, 128, 128], [255, 0, 0], [0, 255, 0], [255, 255, 0]]
VGA += [[0, 0, 255], [255, 0, 255], [0, 255, 255], [255, 255, 255]]
SHAPE = [[10, 10], [40, 10], [40, 40], [60, 40], [60, 70], [10, 70]]


def read(labels: Sequence[int], palette: list[list[int]], kind: str = "PNG") -> Reading:
    """Of a shape, what touches it on the right, a line around it, and the background."""
    inner, beside, line, ground = labels
    numbers = np.full((80, 100), ground, np.uint8)
    numbers[8:72, 8:62] = line
    numbers[10:70, 10:60] = ground
    numbers[10:70, 10:40] = inner
    numbers[40:70, 40:60] = inner
    numbers[20:40, 40:58] = beside
    image = Image.fromarray(numbers).convert("P")
    image.putdata(numbers.ravel().tolist())
    image.putpalette(np.ravel(palette).tolist())
    stream = io.BytesIO()
    image.save(stream, kind)
    return read_outline(FileContent(stream.getvalue(), f"a.{kind.lower()}"))


@pytest.mark.parametrize("palette", [VOC, PADDED, DAVIS], ids=["VOC", "padded", "DAVIS"])
@pytest.mark.parametrize("labels", [(15, 8, 0, 0), (1, 2, 0, 0), (1, 2, 3, 0), (20, 9, 1, 0)])
def test_touching_labels_of_known_palettes(labels: Sequence[int], palette: list[list[int]]) -> None:
    reading = read(labels, palette)
    assert iou(reading.outline, SHAPE) > 0.97
    assert any(f"took label {labels[0]}, the largest" in note for note in reading.notes)


@pytest.mark.parametrize("palette", [PADDED, OTHERS], ids=["VOC", "others"])
@pytest.mark.parametrize("labels", [(15, 0, 255, 0), (15, 8, 255, 0), (1, 255, 255, 0)])
def test_void_around_a_label_is_background(labels: Sequence[int], palette: list[list[int]]) -> None:
    reading = read(labels, palette)
    assert iou(reading.outline, SHAPE) > 0.97
    assert any(note.startswith("label mask") for note in reading.notes)


@pytest.mark.parametrize(
    ("labels", "palette"),
    [
        ((1, 2, 3, 0), [[255, 255, 255], [250, 200, 90], [200, 40, 40], [0, 0, 0]]),
        ((1, 2, 3, 0), [[0, 0, 0], [250, 200, 90], [255, 255, 255], [200, 200, 200]]),
        ((2, 2, 0, 1), [[0, 0, 0], [255, 255, 255], [200, 40, 40]]),
        ((9, 14, 15, 0), VGA),
        ((1, 2, 4, 0), VGA),
        ((14, 9, 0, 15), VGA),
    ],
)
@pytest.mark.parametrize("kind", ["PNG", "GIF"])
def test_flat_drawings_stay_drawings(
    labels: Sequence[int], palette: list[list[int]], kind: str
) -> None:
    reading = read(labels, palette, kind)
    assert not any(note.startswith("label mask") for note in reading.notes)
