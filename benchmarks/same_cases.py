"""The corpus of `same.py`: its inputs, its commands, and what has been renamed since version 0.1.

Commands are written as version 0.1 wants them. What they read is in `../inputs` or in the folder of an
earlier case, `../CASE`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Renamed:
    """What the present tree calls otherwise than version 0.1, and what is meant to differ.

    - `options`: Option of version 0.1 to the present option, or None to leave it out;
      `"density sample -n"` for one command alone.
    - `values`: Arguments, and texts in JSON and CSV, to what they are now.
    - `keys`: Keys in JSON, columns in CSV and names of arrays to what they are now; None where the
      key is gone. "settings.x" is x within settings alone.
    - `added`: Keys that version 0.1 did not have.
    - `files`: Names of files, without folders, to what they are now; None where the file is gone.
    - `expected`: `"CASE"` or `"CASE file"` to the reason why it differs on purpose; `*` stands for
      anything.
    """

    options: dict[str, str | None] = field(default_factory=dict[str, "str | None"])
    values: dict[str, str] = field(default_factory=dict[str, str])
    keys: dict[str, str | None] = field(default_factory=dict[str, "str | None"])
    added: frozenset[str] = frozenset()
    files: dict[str, str | None] = field(default_factory=dict[str, "str | None"])
    expected: dict[str, str] = field(default_factory=dict[str, str])


BEFORE = Renamed()
PRESENT = Renamed(
    options={
        "density fit --parts": "--components",
        "density batch --parts": "--components",
        "density cv --parts": "--components",
        "density fit --detail": "--max-frequency",
        "art --repeat": "--repeat=basic",
    },
    keys={
        "parts": "components",
        "detail": "max_frequency",
        "shares": None,
        "settings.kernels": None,
    },
    # the shares, by the names of the components; what is said of tiles; offsets of exports
    added=frozenset(
        {"weights", "rating", "arrangement", "stars", "word", "offset", "near_symmetry"}
    ),
    expected={
        "* read.png": "what was read is drawn before the search",
        "* index.html": "the page has commands, palettes and stars",
        "* overview.png": "the sheet has stars and names of arrangements",
        "* model.safetensors": "the map carries the silhouette's whole outline",
        "*dxf* a.dxf": "layers have colours",
        "* density.safetensors": "saved as a mixture, in format 5",
        "*fit-torus4-flow*": "flows on tori of four or more angles are gone",
        "*batch* batch.csv": "the settings of a line are those of the operation",
        "density-marginal samples.csv": "no sham kernel for the uniform density: others are drawn",
        "density-marginal density.png": "has a histogram of such samples",
        "density-conditional density.png": "has a histogram of such samples",
    },
)
"""The one table to change with the present tree."""


@dataclass(frozen=True)
class Case:
    """A sequence of commands that run in one folder, whose files are compared.

    - `name`: Name of its folder, KIND-WHAT.
    - `commands`: Command lines of `orbiflow`, run in order.
    - `slow`: Whether it is left out unless it is asked for.
    - `said`: What to compare of the words that are printed, a regular expression; none by default.
    - `refused`: Whether its commands are mistakes, which are to be refused.
    """

    name: str
    commands: tuple[str, ...]
    slow: bool = False
    said: str = ""
    refused: bool = False

    @property
    def kind(self) -> str:
        return self.name.partition("-")[0]

    @property
    def needs(self) -> set[str]:
        """Return the cases whose folders it reads."""
        return set(re.findall(r"\.\./([\w-]+)", " ".join(self.commands))) - {"inputs"}


IN = "../inputs"
ONE = "--workers 1"

SEARCHES = {
    "likeness": f"{IN}/squirrel.dat --effort fast {ONE}",
    "normal": f"{IN}/turtle.png --classes IH4,IH7 --seed 1 {ONE}",
    "pins": f"{IN}/barbet.svg --classes IH4,IH5 --effort fast --pin 600,250,120 --pin-angle {ONE}",
    "pin-mask": f"{IN}/night-monkey.png --classes IH6 --effort fast --pin {IN}/white.png "
    f"--emphasis {IN}/white.png --strength 6 --figures {ONE}",
    "per-class": f"{IN}/bat_60.dat --classes IH1,IH28 --effort fast --per-class 3 --workers 2",
    "overlap": f"{IN}/squirrel.dat --classes IH1,IH5,IH21 --effort fast --objective overlap "
    f"--figures {ONE}",
    "overlap-normal": f"{IN}/turtle.png --classes IH4 --objective overlap --max-frequency 6 "
    f"--emphasis {IN}/white.png {ONE}",
    "occupancy": f"{IN}/squirrel.dat --classes IH4,IH5 --method occupancy --turns 3 --iterations 40 "
    f"--seed 3 {ONE}",
    "inverted": f"{IN}/inverted.png --classes IH4 --effort fast --invert --threshold 0.4 {ONE}",
    "best": f"{IN}/squirrel.dat --classes IH4 --effort best {ONE}",
    "best-overlap": f"{IN}/squirrel.dat --classes IH5 --effort best --objective overlap {ONE}",
}

FITS = {
    "torus1": "torus1.csv --space torus --unit radians --parts kernels,mixture,chains",
    "default": "backbone.csv --space torus --unit degrees",
    "flow": "backbone.csv --space torus --unit degrees --parts flow --detail 4 --segments 1",
    "torus3": "torus3.csv --space torus --unit turns --columns a,b,c --parts kernels,mixture "
    "--missing marginalise --weights w --seed 2",
    "torus4": "torus4.csv --space torus --unit degrees --columns a,b,c,d "
    "--parts network,chains --group who",
    "torus4-flow": "torus4.csv --space torus --unit degrees --columns a,b,c,d --parts flow",
    "sphere": "sphere.csv --space sphere --columns lat,lon",
    "vectors": "vectors.csv --space sphere --parts flow,mixture --detail 4 --segments 1",
    "axes": "poles.csv --space projective-plane --parts kernels,mixture,chains --repeats rounding",
    "klein": "patches.csv --space klein-bottle --columns theta,phi --parts kernels,chains",
}
"""The arguments of `density fit`; the table's first rows are the queries."""


def corpus() -> list[Case]:
    """Return all cases, each after those that it needs."""
    return [*searches(), *fits(), *inference(), *exports(), *artwork(), *others()]


def searches() -> list[Case]:
    """Return the searches."""
    return [
        Case(f"search-{name}", (f"escherize {line} --out run",), slow=name.startswith("best"))
        for name, line in SEARCHES.items()
    ]


def fits() -> list[Case]:
    """Return the fits, each with scores and samples."""
    return [
        Case(
            f"fit-{name}",
            (
                f"density fit {IN}/{line} --out model",
                *used(name, "model"),
                "density sample --model model -n 50 --seed 5 --out samples.csv",
            ),
        )
        for name, line in FITS.items()
    ]


def used(name: str, model: str) -> tuple[str, ...]:
    """Return the command that scores the table's first rows, with gradients, by a model."""
    table, *words = FITS[name].split()
    columns = f" --columns {words[words.index('--columns') + 1]}" if "--columns" in words else ""
    return (
        f"density score {IN}/query-{table} --model {model}{columns} --gradient --out scores.csv",
    )


def inference() -> list[Case]:
    """Return what is asked of densities."""
    backbone, four, sphere = (f"../fit-{name}/model" for name in ("default", "torus4", "sphere"))
    query = f"{IN}/query-backbone.csv"
    return [
        Case(
            "density-scores",
            (
                f"density score {query} --model {backbone} --measure uniform --out uniform.csv",
                f"density score {query} --model {backbone} --measure square --out table.csv",
                f"density score {query} --model {backbone} --region --samples 1000 --out region.csv",
                f"density score {IN}/holes.csv --model {four} --columns a,b,c,d --missing marginalise "
                "--out holes.csv",
            ),
        ),
        Case(
            "density-marginal",
            (
                f"density marginal --model {four} --columns a --out two",
                "density sample --model two -n 20 --out samples.csv",
                f"density marginal --model {backbone} --columns psi --out one",
                "density marginal --model ../fit-torus3/model --columns 1,3 --out chains",
            ),
        ),
        Case(
            "density-conditional",
            (
                f"density conditional --model {four} --given b=-60,d=170 --out two",
                f"density conditional --model {four} --given a=60 --columns b --out one",
                f"density conditional --model {backbone} --given psi=-45 --out phi",
                "density sample --model phi -n 20 --out samples.csv",
            ),
        ),
        Case(
            "density-region",
            (
                f"density region --model {sphere} --mass 0.5,0.9 --samples 2000 --budget 20000 "
                "--out sphere.geojson",
                f"density region --model {backbone} --mass 0.5 --samples 2000 --budget 20000 "
                "--out torus.json",
                f"density region --model {backbone} --level=-9 --samples 2000 --budget 20000 "
                "--out level.csv",
                "density region --model ../fit-torus1/model --samples 2000 --out one.json",
            ),
        ),
        Case(
            "density-compare",
            (
                f"density compare -m {backbone} -m ../fit-flow/model "
                f"-d {query} --bootstrap 200 --out models.json",
                f"density compare -d {IN}/torus4.csv -d {IN}/other4.csv --space torus --unit degrees "
                "--columns a,b,c,d --group who --permutations 99 --bootstrap 200 --out sets.json",
                f"density compare -d {IN}/sphere.csv -d {IN}/poles.csv --space sphere "
                "--permutations 99 --bootstrap 100 --seed 4 --out sphere.csv",
            ),
        ),
        Case(
            "density-cv",
            (
                f"density cv {IN}/torus1.csv --space torus --unit radians --parts mixture --folds 3 "
                "--against kernels --against uniform --bootstrap 200 --workers 2 --out run",
            ),
        ),
        Case(
            "density-batch",
            (
                f"density batch {IN}/tables --space torus --unit radians --parts mixture "
                "--workers 1 --out run",
            ),
        ),
        Case(
            "density-patches",
            (
                f"density patches {IN}/pixels.csv --no-header --unit degrees --out angles.csv",
                f"density patches {IN}/pixels.csv --no-header --farthest 0.8 --out near.csv",
            ),
        ),
        Case(
            "density-plot",
            (
                f"density plot --model {backbone} --data {IN}/backbone.csv --regions 0.5 "
                "--region-samples 1000 --dots --center 180,0 --out torus",
                f"density plot --model {sphere} --width single --format svg --projection mollweide "
                "--samples 200 --out sphere",
                "density plot --model ../fit-axes/model --projection schmidt --scale log "
                "--out axes.pdf",
                f"density plot --model {four} --samples 200 --out four",
            ),
        ),
    ]


def exports() -> list[Case]:
    """Return exports in each format, cut and preset."""
    pieces = "--cut pieces --area 200x150mm"
    lines = {
        "svg": "--tile-size 30mm --area 120x80mm --palette ochre --out a.svg",
        "svg-clip": "--tile-size 30mm --area 120x80mm --clip --cut skeleton --border "
        "--calibrate --out a.svg",
        "svg-pieces": f"{pieces} --kerf 0.2mm --clearance 0.1mm --out a.svg",
        "pdf": "--tile-size 30mm --area single --tile IH5 --out a.pdf",
        "dxf": "--cut skeleton --tile-size 50mm --out a.dxf",
        "dxf-pieces": f"{pieces} --copies 5 --bed 120x100mm --spacing 2mm --out a.dxf",
        "png": "--tile-size 30mm --area 90x60mm --dpi 150 --tile 3 --out a.png",
        "json": "--tile-size 3cm --tolerance 0.2mm --warn-neck 4mm --out a.json",
        "plotter": "--for plotter --area 200x150mm --out a.svg",
        "laser": "--for laser --area 200x150mm --out a.svg",
        "print": "--for print --area 100x80mm --out a.pdf",
        "paper": "--for paper --out a.pdf",
        "web": "--for web --area 100x80mm --out a.svg",
    }
    return [
        Case(f"export-{name}", (f"export ../search-likeness/run {line}",))
        for name, line in lines.items()
    ]


def artwork() -> list[Case]:
    """Return artwork and animations."""
    art = {
        "picture": f"../search-pins/run --picture {IN}/drawing.svg --size 600x400 --tile-size 180",
        "picture-overlap": f"../search-overlap/run --picture {IN}/squirrel.svg --size 500x300 "
        "--tile-size 150",
        "repeat": "../search-likeness/run --repeat --tile-size 120 --colour neighbour "
        "--outline 2 --tile IH4",
        "hatch": "../search-pins/run --engrave --strokes hatch --eye 600,150,20 --size 400x300 "
        "--tile-size 200",
        "feathers": "../search-likeness/run --engrave --strokes feathers --size 400x300 "
        "--tile-size 200",
        "echoes": "../search-overlap/run --engrave --strokes echoes --size 60x40mm --tile-size 25mm "
        "--dpi 150",
    }
    drawn = [Case(f"art-{name}", (f"art {line} --out a.png",)) for name, line in art.items()]
    svg = Case(
        "art-svg",
        (
            f"art ../search-pins/run --picture {IN}/drawing.svg --size 120x80mm --tile-size 40mm "
            "--palette lagoon --colour one --out a.svg",
        ),
    )
    animations = {
        "morph": "../search-likeness/run --kind morph --seconds 1 --fps 5 --size 200 --out a.gif",
        "bend": "../search-likeness/run --kind bend --seconds 1 --fps 5 --size 200 --out a.gif",
        "grow": "../search-overlap/run --kind grow --seconds 1 --fps 5 --size 200 --palette dusk "
        "--out a.gif",
        "morph-svg": "../search-likeness/run --kind morph --seconds 2 --size 300 --out a.svg",
        "bend-svg": "../search-pins/run --kind bend --seconds 2 --size 300 --out a.svg",
        "grow-svg": "../search-likeness/run --kind grow --seconds 2 --size 300 --tile 2 --out a.svg",
    }
    moving = [Case(f"animate-{name}", (f"animate {line}",)) for name, line in animations.items()]
    return [*drawn, svg, *moving]


def others() -> list[Case]:
    """Return a batch, the list of classes, and command lines that are refused."""
    refused = (
        "export ../search-likeness/run --tile-size 40 --out a.svg",
        "export ../search-likeness/run --tile IH28x --out a.svg",
        "export ../search-likeness/run --kerf 0.2mm --out a.svg",
        "export ../search-likeness/run --dpi 0 --out a.png",
        "export ../nowhere --out a.svg",
        "art ../search-likeness/run --eye 1 --out a.png",
        "art ../search-likeness/run --size 0x0 --out a.png",
        "animate ../search-likeness/run --fps 0 --out a.gif",
        f"escherize {IN}/nothing.png",
        f"escherize {IN}/squirrel.dat --classes IH8",
        f"escherize {IN}/squirrel.dat --method occupancy --objective likeness",
        f"escherize {IN}/squirrel.dat --turns 3",
        f"escherize {IN}/squirrel.dat --max-frequency 99 --objective overlap",
        f"density fit {IN}/backbone.csv --space torus --parts forests",
        f"density fit {IN}/backbone.csv --space sphere --detail 99",
        f"density fit {IN}/holes.csv --space torus --columns a,b",
        f"density score {IN}/torus1.csv --model ../fit-default/model",
        "density marginal --model ../fit-sphere/model --columns lat",
        "density conditional --model ../fit-default/model --given chi=3",
        "density region --model ../fit-default/model --mass 1.5",
        f"density compare -d {IN}/sphere.csv",
        f"density cv {IN}/torus1.csv --space torus --folds 1",
    )
    batch = (
        f"batch {IN}/silhouettes --classes IH4 --effort fast --match *.dat --workers 2 --out run"
    )
    return [
        Case("batch-three", (batch, batch)),  # the second has nothing left to do
        Case(
            "classes-drawn", ("classes --out classes.png",), said=r"IH\d+|\bp\w*\b|\d[=~>]\d|\do\b"
        ),
        Case("refused-all", refused, refused=True),
    ]
