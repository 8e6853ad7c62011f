"""The reference pages, settings.md and names.md: `python docs/reference/make.py`."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from pathlib import Path

import orbiflow
from orbiflow.errors import SettingError
from orbiflow.runtime import Operation, find
from orbiflow.settings import OPERATIONS, Field, Hidden

PAGE, NAMES = (Path(__file__).with_name(name) for name in ("settings.md", "names.md"))

TOP = """# Operations and settings

This page is made by `python docs/reference/make.py` from the operations
themselves. Each is a command, a Python function and a JSON object: an option `--tile-size` is the
argument or setting `tile_size` in Python and JSON. Settings in *italics* have no option.
"""

TOPICS = {
    "Tiles that look like a silhouette": (
        "Target Pins EscherizeSettings LikenessSearch OverlapSearch OccupancySearch "
        "SearchMethod escherize SearchResult fit_tile certified_tiles EscherTile write_run "
        "read_result "
    ),
    "What is made of a tile": (
        "ExportSettings export ArtSettings art artwork with_map read_over "
        "SolidSettings solid make_solid AnimationSettings animate exported Made Scene write_scene "
        "tile_picture tiling_picture tilings_png overlay_picture bending_picture "
    ),
    "Solids that fill space": (
        "read_mesh FillSettings fill EscherSolid read_solid BuildSettings build "
    ),
    "Tilings": (
        "Tile Tiling certify isohedral_class CLASSES ISOHEDRAL_TYPES dirichlet_tile "
        "dirichlet_tiling colouring copies_meeting copies_inside patch neighbours edges "
        "edge_classes edge_to_edge skeleton "
    ),
    "Losses of one's own": ("refine TileModel trainable load_model "),
    "Symmetry": (
        "CrystallographicGroup Isometry wallpaper_group WALLPAPER_GROUPS space_group "
        "group_from_operators group_from_cif operators cif_text translation rotation "
        "assert_equivariant "
    ),
    "Fields and flows": (
        "FourierField SplineField PeriodicFeatures symmetrize Flow load_flow save_flow "
        "field_picture "
    ),
    "Densities": (
        "DensityEstimator read_density density_to_bytes "
        "Density Mixture FlowDensity AdaptiveKernels VonMisesChains VonMisesNetwork Space make_space "
        "QuotientSpace RotationSpace UnitVectorSpace conditional marginal log_density_gradient "
        "highest_density_region DensityLevels outlines "
    ),
    "Comparing densities, and data": (
        "compare_models compare_scores compare_samples named_tests ComparisonSettings "
        "DataComparisonSettings NamedTestSettings cross_validate cross_validation_folds "
        "summarize_angles summarize_directions summarize_axes summarize_orientations "
    ),
    "Figures": (
        "Sheet PlotSettings plot_density density_picture flow_picture samples_picture "
        "corner_picture pdf_pages "
    ),
    "Running, saving and loading": (
        "load save to_json open_project CallProcess find Cancel Progress Note Finished "
    ),
    "Errors and warnings": (
        "OrbiflowError SettingError InputFileError OutputError CertificationError DataWarning "
    ),
}
"""The public names by topic."""

NAMES_TOP = """# Public names

This page is made by `python docs/reference/make.py`. `from orbiflow import ...` gives these names,
and loads nothing before it is used. They are documented and stable: a release that changes one says
so in the [changelog](../../CHANGELOG.md). Everything else in the package is internal, whether its
name begins with an underscore or not, and may change without notice.
"""


def names_page() -> str:
    """Return the page of public names in Markdown."""
    lines = [NAMES_TOP]
    for topic, names in TOPICS.items():
        lines += [f"## {topic}", "", "| name | |", "|---|---|"]
        lines += [f"| `{name}` | {_first_sentence(name)} |" for name in names.split()]
        entries = "\n".join(map(_entry, names.split()))
        lines += ["", "```{eval-rst}", ".. currentmodule:: orbiflow", "", entries, "```", ""]
    return "\n".join(lines)


def _first_sentence(name: str) -> str:
    doc = inspect.getdoc(getattr(orbiflow, name)) or ""
    if isinstance(getattr(orbiflow, name), (dict, tuple)):
        doc = "A table."
    return " ".join(doc.split("\n\n")[0].split()).split(". ")[0].rstrip(".") + "."


def _entry(name: str) -> str:
    found = getattr(orbiflow, name)
    if inspect.isclass(found):
        return f".. autoclass:: {name}\n   :members:\n"
    return f".. auto{'function' if callable(found) else 'data'}:: {name}\n"


def reference(operations: Iterable[Operation]) -> str:
    """Return the page in Markdown."""
    return "\n".join([TOP, *map(_section, operations)])


def _section(operation: Operation) -> str:
    lines = [f"## {operation.name}", "", operation.doc, ""]
    headings = dict.fromkeys(["", *(entry.group for entry in operation.fields)])
    for heading in headings:
        entries = [entry for entry in operation.fields if entry.group == heading]
        if not entries:
            continue
        if heading:
            lines += [f"### {operation.name}: {heading}", ""]
        lines += ["| setting | value | default | |", "|---|---|---|---|"]
        lines += [_row(entry) for entry in entries]
        lines.append("")
    return "\n".join(lines)


def _row(entry: Field) -> str:
    value = " \\| ".join(entry.kind.choices) or entry.kind.wanted
    default = "required" if entry.required else entry.default_text
    rules = " and ".join(SettingError(str(rule)).named(_code) for rule in entry.rules if str(rule))
    note = f" Only with {rules}." if rules else ""
    return f"| {_name(entry)} | {value} | {default} | {entry.doc}{note} |"


def _name(entry: Field) -> str:
    if entry.of_class(Hidden):
        return f"*{entry.name}*"
    if entry.positional:
        return f"`{entry.name.upper()}`"
    names = (*entry.option.names, *([entry.option.off] if entry.option.off else []))
    return " ".join(map(_code, names))


def _code(name: str) -> str:
    return f"`{name}`"


if __name__ == "__main__":
    PAGE.write_text(reference(map(find, OPERATIONS)), "utf-8")
    NAMES.write_text(names_page(), "utf-8")
