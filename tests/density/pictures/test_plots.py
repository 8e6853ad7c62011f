"""All pictures of a density: a folder of them, or one PDF; in memory and from folders."""

from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
import torch

import orbiflow.density as od
from density.quick_fits import quick_pictures
from orbiflow.density.operations.drawing import plot
from orbiflow.density.pictures.plots import refuse_foreign_files
from orbiflow.errors import OrbiflowError, OutputError
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from refusals import refused

DATA = np.random.default_rng(0).uniform(-3, 3, (40, 2))


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    quick_pictures(monkeypatch)
    monkeypatch.setattr("orbiflow.density.pictures.plots.SAMPLES", 50)
    monkeypatch.setattr("orbiflow.density.pictures.figures.few_colours", lambda png: png)


def example(space: Any = None) -> od.Density:
    space = space or od.Torus(2)
    field = FourierField(space.group, 1, dtype=torch.float64)
    field.parameters_.data.normal_(0, 0.02, generator=torch.Generator().manual_seed(3))
    return od.FlowDensity(space, Flow([field], steps=1))


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_folder_holds_the_pictures_of_one_plot(tmp_path: Path) -> None:
    out = tmp_path / "plots.pdf"
    out.mkdir()  # a folder may be called like a PDF
    plotted = od.plot_density(example(), out, od.PlotSettings(format="svg"), data=DATA)
    figures = {"density.svg", "flow.svg", "samples.svg"}
    assert names(out) == figures | {"surface.html"}
    assert set(plotted.files) == {out / name for name in names(out)}
    assert len(plotted.captions) == 3
    od.plot_density(example(), out)
    assert names(out) == {"density.png", "flow.png", "surface.html"}
    assert names(out) < set(od.PICTURES)
    (out / "notes.txt").write_text("mine")
    with refused("density.png", kind=OutputError):
        od.plot_density(example(), out)
    assert names(out) == {"density.png", "flow.png", "surface.html", "notes.txt"}


def test_one_pdf_has_a_page_a_figure(tmp_path: Path) -> None:
    out = tmp_path / "plots.pdf"
    plotted = od.plot_density(example(), out, od.PlotSettings(width=180.0), data=DATA)
    assert plotted.files == (out,)
    assert out.is_file()
    document = pypdfium2.PdfDocument(out)
    assert [round(page.get_width()) for page in document] == [510, 510, 510]
    words = [page.get_textpage().get_text_range() for page in document]
    assert "density" in words[0]
    assert "speed" in words[1]
    assert "samples" in words[2]


def test_three_angles_are_drawn_in_pairs(tmp_path: Path) -> None:
    density = od.UniformDensity(od.Torus(3))
    settings = od.PlotSettings(center=(np.pi, 0, -np.pi))
    od.plot_density(density, tmp_path / "plots", settings, data=np.zeros((9, 3)))
    assert names(tmp_path / "plots") == {"samples.png"}
    with refused("center", "3"):
        od.plot_density(density, tmp_path / "plots", od.PlotSettings(center=(0, 0)))


@pytest.mark.parametrize("ending", ["png", "SVG", "html"])
def test_one_picture_is_no_place_for_several(tmp_path: Path, ending: str) -> None:
    with refused("several", "pictures", kind=OutputError):
        od.plot_density(example(), tmp_path / f"plot.{ending}")
    assert not list(tmp_path.iterdir())


def test_inclinations_are_drawn_in_a_net(tmp_path: Path) -> None:
    model = tmp_path / "model"
    model.write_bytes(
        od.density_to_bytes(od.UniformDensity(od.ProjectivePlane()), columns=["inc", "dec"])
    )
    told: list[Any] = []
    plot(model=model, out=tmp_path / "net.pdf", on_event=told.append)
    assert "Schmidt net (equal-area)" in " ".join(map(str, told))


def test_a_fitted_estimator_is_drawn_and_another_refused(tmp_path: Path) -> None:
    estimator = od.DensityEstimator("torus", components="mixture")
    with refused("call", "data"):
        od.plot_density(estimator, tmp_path / "a.pdf")
    od.plot_density(estimator.fit(DATA), tmp_path / "a.pdf")
    # the flow has no part in it
    assert len(pypdfium2.PdfDocument(tmp_path / "a.pdf")) == 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"width": "wide"}, "width wide"),
        ({"measure": "flat"}, "measure"),
        ({"samples": 0}, "samples 1"),
    ],
)
def test_settings_are_checked(settings: dict[str, Any], message: str) -> None:
    with refused(*message.split()):
        od.PlotSettings(**settings)


def test_what_does_not_fit_the_density_is_refused_before_anything_is_written(tmp_path) -> None:
    out = tmp_path / "plots"
    for space, settings, message in (
        (od.Torus(2), od.PlotSettings(coastlines=Path("lines.csv")), "coastlines"),
        (od.Torus(9), od.PlotSettings(), "angles 9"),
        (od.Torus(2), od.PlotSettings(names=("one",)), "2 names"),
        (od.Sphere(), od.PlotSettings(center=(0.0, 0.0, 0.0)), "latitude longitude"),
        (od.Torus(2), od.PlotSettings(projection="lambert"), "projection"),
        (od.Torus(2), od.PlotSettings(radius=20), "radius"),
    ):
        density = example() if space.dim == 2 and space.is_torus else None
        density = density or od.UniformDensity(space)
        with refused(*message.split()):
            od.plot_density(density, out, settings)
    with pytest.raises(OrbiflowError):
        od.plot_density(example(), out, data=DATA[:, :1])
    assert not out.exists()


def test_a_folder_of_ones_own_pictures_is_left_alone(tmp_path: Path) -> None:
    for name in ("density.pdf", "notes.txt"):
        (tmp_path / name).write_text("mine")
    with refused("density.pdf", "notes.txt", kind=OutputError):
        refuse_foreign_files(tmp_path)
    (tmp_path / "notes.txt").unlink()
    refuse_foreign_files(tmp_path)  # as an earlier plot left it
    refuse_foreign_files(tmp_path / "not there yet")
