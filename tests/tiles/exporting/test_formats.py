"""Each format is what its readers expect: sizes, layers, units, and that it is sound."""

import io
import json
import re
from typing import Any

import ezdxf
import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
import pytest
import shapely
from PIL import Image

from exported import dxf_lines, scenes, sheet_content, tile_of
from orbiflow.errors import CertificationError
from orbiflow.tiles import EscherTile, ExportSettings, Tile, edges, export
from refusals import refused

TILE = tile_of("IH3")


def content(**options) -> Any:
    chosen = ExportSettings(**options)
    return sheet_content(scenes(TILE, chosen)[0][0], chosen)


@pytest.mark.parametrize("cut", ["none", "skeleton", "pieces"])
def test_dxf_is_sound(cut) -> None:
    text = content(format="dxf", cut=cut, calibrate=True)
    document, lines = dxf_lines(text)
    auditor = document.audit()
    assert not auditor.errors
    assert not auditor.fixes
    assert document.header["$INSUNITS"] == 4  # mm
    assert document.header["$MEASUREMENT"] == 1
    layers = {layer.dxf.name: layer.dxf.linetype.upper() for layer in document.layers}
    used = {line.layer for line in lines}
    assert used <= set(layers)
    assert all(layers[name] == "CONTINUOUS" for name in used)
    assert "calibration 100 mm" in used
    assert all(item.dxftype() == "LWPOLYLINE" for item in document.modelspace())
    if cut != "skeleton":
        assert all(line.closed for line in lines if not line.layer.startswith("calib"))
    points = np.concatenate([line.points for line in lines])
    assert (points >= 0).all()
    assert (points <= (300, 200)).all()


def test_dxf_of_old_machines_has_the_same_lines() -> None:
    old = content(format="dxf", dxf="r12", cut="pieces", calibrate=True)
    new = content(format="dxf", cut="pieces", calibrate=True)
    document = ezdxf.read(io.StringIO(old))
    assert document.dxfversion == "AC1009"
    assert not document.audit().has_errors
    lines: list[Any] = list(document.modelspace())
    assert {line.dxftype() for line in lines} == {"POLYLINE"}
    assert all(re.fullmatch(r"[A-Z0-9_]{1,31}", line.dxf.layer) for line in lines)
    for line, other in zip(lines, ezdxf.read(io.StringIO(new)).modelspace(), strict=True):
        points = [(p.x, p.y) for p in line.points()]
        np.testing.assert_allclose(points, list(other.get_points("xy")), atol=1e-9)
        assert line.is_closed == other.closed
    with refused("dxf"):
        content(format="svg", dxf="r12")


def test_the_calibration_mark_is_100_mm() -> None:
    text = content(format="dxf", calibrate=True)
    marks = [line for line in dxf_lines(text)[1] if line.layer.startswith("calib")]
    points = np.concatenate([line.points for line in marks])
    assert np.ptp(points[:, 0]) == pytest.approx(100, abs=1e-9)
    tiles = [line.points for line in dxf_lines(text)[1] if not line.layer.startswith("calib")]
    assert np.concatenate(tiles)[:, 1].max() < points[:, 1].min()
    with refused("110 mm", "90 mm"):
        content(calibrate=True, area=(90.0, 90.0))


@pytest.mark.parametrize("cut", ["none", "skeleton"])
def test_pdf_has_its_real_size_curves_and_no_fonts(cut) -> None:
    data = content(format="pdf", cut=cut, area=(210.0, 148.0))
    assert data == content(format="pdf", cut=cut, area=(210.0, 148.0))
    (box,) = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", data)
    assert [float(side) / 72 * 25.4 for side in box] == pytest.approx([210, 148], abs=1e-4)
    assert b"/FontFile" not in data
    objects = list(pypdfium2.PdfDocument(data)[0].get_objects())
    assert {pdfium.FPDFPageObj_GetType(o) for o in objects} == {pdfium.FPDF_PAGEOBJ_PATH}
    kinds = [
        pdfium.FPDFPathSegment_GetType(pdfium.FPDFPath_GetPathSegment(item, k))
        for item in objects
        for k in range(pdfium.FPDFPath_CountSegments(item))
    ]
    assert kinds.count(pdfium.FPDF_SEGMENT_BEZIERTO) > 150


def test_png_has_its_real_size() -> None:
    data = content(format="png", dpi=150.0, area=(127.0, 101.6))
    picture = Image.open(io.BytesIO(data))
    assert picture.size == (750, 600)
    assert picture.info["dpi"] == pytest.approx((150, 150), abs=0.1)
    assert len(picture.convert("RGB").resize((60, 48)).getcolors(9999) or []) > 50
    with refused("23622 x 15748 pixels"):
        content(format="png", dpi=2000.0)


def test_hairlines_show_in_a_png() -> None:
    data = content(format="png", cut="skeleton", outline=0.01, stroke="#ff0000", dpi=100.0)
    pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=int)
    assert (pixels[..., 1] < 100).mean() > 0.005


def test_json_says_where_every_tile_is() -> None:
    text = content(format="json", clip=True)
    document = json.loads(text)
    assert document["units"] == "mm"
    assert (document["class"], document["group"]) == ("IH3", "pg")
    assert document["certified"] is True
    prototile = np.array(document["prototile"])
    found = []
    for number, tile in enumerate(document["tiles"]):
        assert tile["number"] == number
        a, b, c, d, e, f = tile["transform"]
        polygon = np.array(tile["polygon"])
        moved = prototile @ np.array([[a, c], [b, d]]).T + [e, f]
        np.testing.assert_allclose(moved, polygon, atol=2e-4)
        found.append(shapely.Polygon(polygon))
        inside = shapely.box(0, 0, 300, 200).covers(found[-1])
        assert tile["whole"] == inside
    assert {tile["aspect"] for tile in document["tiles"]} == {0, 1}
    for tile in document["tiles"]:
        for other in tile["neighbours"]:
            assert tile["number"] in document["tiles"][other]["neighbours"]
            assert found[tile["number"]].distance(found[other]) < 1e-3
        if shapely.box(60, 60, 240, 140).contains(found[tile["number"]]):
            assert len(tile["neighbours"]) == len(edges(TILE).starts)


@pytest.mark.parametrize("form", ["svg", "pdf", "dxf", "json", "png"])
def test_what_is_not_certified_is_refused_or_says_so(form, tmp_path) -> None:
    bad = EscherTile(Tile(1.01 * TILE.polygon, TILE.group, "IH3"), name="boot-IH3")
    chosen = ExportSettings(format=form)
    with refused("boot-IH3", "force", kind=CertificationError):
        export(bad, tmp_path / "x", chosen)
    assert not list(tmp_path.iterdir())
    done = export(bad, tmp_path / f"x.{form}", chosen, force=True)
    data = done.files[0].read_bytes()
    assert b"NOT CERTIFIED" in data or "NOT CERTIFIED".encode("utf-16-be") in data
    assert "NOT CERTIFIED" in done.scenes[0].title


def test_a_forced_tile_that_crosses_itself(tmp_path) -> None:
    ring = TILE.polygon.copy()
    ring[[5, 9]] = ring[[9, 5]]
    bad = Tile(ring, TILE.group)
    for form in ("svg", "pdf", "dxf", "json"):
        chosen = ExportSettings(format=form, clip=True, warn_neck=1.0)
        done = export(bad, tmp_path / f"x.{form}", chosen, force=True)
        assert done.tiles > 20
        assert any("necks cannot be measured" in note for note in done.notes)
    with refused("polygon"):
        export(bad, tmp_path / "y.svg", ExportSettings(cut="pieces"), force=True)
