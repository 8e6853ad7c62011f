"""What can be asked for of fitted densities and data sets beside each other, and of regions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from orbiflow.jobs.density_requests import (
    SpaceName,
    Unit,
    columns_named,
    region_samples_in_range,
)
from orbiflow.jobs.request import (
    Request,
    ends_in,
    in_range,
)
from orbiflow.runtime import RecordError


@dataclass(frozen=True)
class DensityCompareRequest(Request):
    """Compare models at held-out rows, or two data sets; see `orbiflow density compare --help`.

    - `data`: one table and two `models` or more; or two tables and a `space`.
    - `columns`, `header`, `drop_missing`: as for a fit. `unit`: of angles in two data sets.
    - `group`: the column that says which rows are not independent.
    - `bootstrap`, `level`: resamples, and the level of the intervals.
    - `permutations`: of the test of two data sets.
    - `out`: .json or .csv, None to write nothing.
    """

    KIND = "density-compare"

    data: tuple[Path, ...]
    models: tuple[Path, ...] = ()
    space: SpaceName | None = None
    out: Path | None = None
    columns: tuple[str, ...] | None = None
    header: bool | None = None
    drop_missing: bool = False
    unit: Unit | None = None
    group: str | None = None
    bootstrap: int = 2000
    permutations: int = 999
    level: float = 0.95
    seed: int = 0

    def check(self) -> None:
        columns_named(self.columns)
        if self.models:
            self._check_models()
        else:
            self._check_data()
        in_range(self, "bootstrap", 100, 1_000_000)
        in_range(self, "permutations", 19, 100_000)
        in_range(self, "level", 0.5, 0.999)
        in_range(self, "seed", 0, 2**63 - 1)
        ends_in(self.out, (".json", ".csv"))

    def _check_models(self) -> None:
        if len(self.models) < 2:
            raise RecordError("{models} must be given twice or more, to be compared; or two {data}")
        if len(set(self.models)) < len(self.models):
            raise RecordError("{models} names one folder twice: give each once")
        if len(self.data) != 1:
            raise RecordError("models are compared at one {data}, rows that none was fitted to")
        for name in ("space", "unit"):
            if getattr(self, name) is not None:
                raise RecordError(f"{{{name}}} is that of the models: leave it out")

    def _check_data(self) -> None:
        if len(self.data) != 2:
            raise RecordError(
                "give two {models} or more and one {data} to compare models, or two {data} and their "
                "{space} to compare data"
            )
        if self.space is None:
            raise RecordError("two {data} need their {space}")


@dataclass(frozen=True)
class DensityRegionRequest(Request):
    """Find the regions where a density is highest; see `orbiflow density region --help`.

    - `mass`: that regions hold. `level`: log densities in natural measure, above which a region lies.
      Neither: 0.5 and 0.9.
    - `samples`: of the density, by which the masses are known; None for 20,000, or more where a mass
      needs it.
    - `budget`: evaluations after which outlines get no finer.
    - `out`: .geojson (spheres and projective planes), .json or .csv.
    """

    KIND = "density-region"

    model: Path
    out: Path = Path("regions.json")
    mass: tuple[float, ...] | None = None
    level: tuple[float, ...] | None = None
    samples: int | None = None
    budget: int = 300_000
    seed: int = 0

    def check(self) -> None:
        for share in self.mass or ():
            if not 0 < share < 1:
                raise RecordError(f"{{mass}} must be between 0 and 1, got {share:g}")
        for value in self.level or ():
            if not math.isfinite(value):
                raise RecordError(f"{{level}} must be finite, got {value:g}")
        if self.mass == () or self.level == ():
            raise RecordError("{mass} and {level} need a number each, or several, as in 0.5,0.9")
        if len(self.mass or ()) + len(self.level or ()) > 50:
            raise RecordError("more than 50 regions: ask for fewer {mass} and {level}")
        region_samples_in_range(self, "samples")
        in_range(self, "budget", 1, 10**9)
        in_range(self, "seed", 0, 2**63 - 2)
        ends_in(self.out, (".geojson", ".json", ".csv"))
