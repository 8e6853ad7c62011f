"""Make the coastlines that come with orbiflow, from `npm pack world-atlas@2.0.2`.

    python benchmarks/density_coastlines.py package/land-110m.json

Natural Earth's land at 1:110 million, in the public domain, is TopoJSON there: arcs of whole numbers,
each but the first the difference from the one before. Written are hundredths of degrees, latitude
first, with a latitude of 100 degrees after each line.
"""

import json
import sys
from pathlib import Path

import numpy as np

from orbiflow.density.pictures.coastlines import without_cuts

OUT = Path(__file__).parents[1] / "src/orbiflow/density/pictures/coastlines.npy"

topology = json.loads(Path(sys.argv[1]).read_bytes())
scale, shift = (np.array(topology["transform"][name]) for name in ("scale", "translate"))
rows = []
for arc in topology["arcs"]:
    ring = (np.cumsum(arc, axis=0) * scale + shift)[:, ::-1]
    for line in without_cuts(ring):
        if len(line) > 1:
            rows += [np.round(100 * line), [[10_000, 0]]]
table = np.concatenate(rows).astype(np.int16)
np.save(OUT, table)
print(f"{len(table)} rows, {OUT.stat().st_size} bytes")
