"""What a cross-validation is asked for: splits, settings to compare, and the files of one fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from orbiflow.density import operations
from orbiflow.density.fitting import COMPONENTS, KNOWN, ComponentSettings, DensitySettings
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import SettingError, literal
from orbiflow.settings import DefaultText, Range, Repeated, Settings, as_whole

SCORES, REPORT = "scores.csv", "report.json"
"""Files of one fit."""

DEFAULT, UNIFORM = "default", "uniform"
"""Names of what a fit chooses by itself, and of the density that is the same everywhere."""

Components = tuple[str, ...] | None
"""Those of a setting, None for what a fit chooses by itself."""


class CvSettings(Settings, group="Cross-validation"):
    """How rows are split, what is compared, and how sure the comparison is."""

    folds: Annotated[int, Range(2, 1000)] = 10
    """Number of parts of the rows; each is held out once."""

    times: Annotated[int, Range(1, 100)] = 1
    """Number of splits; more of them take away the chance of one."""

    against: Annotated[tuple[str, ...] | None, Repeated(), DefaultText("kernels")] = None
    """Other components, such as kernels,mixture, that are fitted to the same folds and compared row by
    row; also default, all components, and uniform. May be repeated."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Probability that all intervals hold at once."""

    bootstrap: Annotated[int, Range(100, 1_000_000)] = 2000
    """Number of resamples of rows or groups."""

    def check(self) -> None:
        for text in self.against or ():
            if text != UNIFORM:
                _setting_in(text)

    @property
    def others(self) -> dict[str, Components]:
        """The components of the other settings that are fitted, by name."""
        texts = ("kernels",) if self.against is None else self.against
        return dict(_setting_in(text) for text in texts if text != UNIFORM)


class CvDensitySettings(SpaceSettings, ComponentSettings, group="Density"):
    """Where the data live, and which components a density may have."""


@dataclass(frozen=True)
class CrossValidation:
    """The table and the folder for the results, the fit in question, how rows are read and split."""

    data: Path
    out: Path
    density: CvDensitySettings
    rows: RowSettings
    cv: CvSettings

    def __post_init__(self) -> None:
        as_whole(self.density.seed, "seed", 0, 2**63 - 1)  # splits have fewer seeds than fits
        name, _ = setting_of(self.density.components, "components")
        if self.cv.against is not None and name in self.cv.others:
            raise SettingError(
                f"{{components}} and {{against}} are both {name}; compare it with others, or with "
                "uniform"
            )
        if self.rows.missing == "marginalise":
            for components in self.settings.values():
                operations.check_marginalised(
                    self.density, DensitySettings().replace(components=components)
                )

    @property
    def settings(self) -> dict[str, Components]:
        """The components by the name of each setting that is fitted, the one in question first."""
        settings = dict([setting_of(self.density.components, "components")])
        for name, components in self.cv.others.items():
            settings.setdefault(name, components)
        return settings

    @property
    def names(self) -> list[str]:
        """The names of what is compared: the uniform density, too, if asked for or beside one alone."""
        fitted = list(self.settings)
        return (
            [*fitted, UNIFORM] if UNIFORM in (self.cv.against or ()) or len(fitted) == 1 else fitted
        )


def setting_of(components: Sequence[str] | None, field: str) -> tuple[str, Components]:
    """Return the name of a setting, and its components in one order.

    >>> setting_of(["mixture", "kernels"], "components")
    ('kernels+mixture', ('kernels', 'mixture'))
    """
    if components is None:
        return DEFAULT, None
    unknown = [name for name in components if name not in KNOWN]
    if unknown or not components:
        others = ", default or uniform" if field == "against" else ""
        raise SettingError(
            f"{{{field}}} must be of {', '.join(KNOWN)} with commas between{others}, got "
            + literal(repr(", ".join(unknown)))
        )
    ordered = tuple(name for name in KNOWN if name in components)
    return (DEFAULT, None) if ordered == COMPONENTS else ("+".join(ordered), ordered)


def _setting_in(text: str) -> tuple[str, Components]:
    """Return the setting that a word of `against` names."""
    if text == DEFAULT:
        return DEFAULT, None
    pieces = [piece.strip() for piece in text.replace("+", ",").split(",")]
    return setting_of([piece for piece in pieces if piece], "against")


def written_files(folder: Path) -> set[str]:
    """Return the names of what an earlier fold wrote into the folder."""
    return {SCORES, REPORT} if (folder / SCORES).is_file() else set()
