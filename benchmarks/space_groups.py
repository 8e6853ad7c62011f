"""A field and a flow of each of the 230 space groups: do they commute with it, and in what time?

    python benchmarks/space_groups.py            # all 230; a minute or two on one core
    python benchmarks/space_groups.py --quick    # every 23rd

Each group is on its default cell. The field is a `FourierField` with random parameters and root mean
square 0.05; the flow integrates it by 2 steps. Errors are the largest over all coset representatives,
each also moved by a cell along each lattice vector, and over random points: of the field relative to
its root mean square, of the flow in units of a. "order" counts cosets of the primitive lattice, which
must be as many as gemmi's tables list. The exit status is 1 if a group is off.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Literal

import gemmi
import numpy as np
import torch

from orbiflow.fields import FourierField, VectorField
from orbiflow.flows import Flow
from orbiflow.symmetry import (
    CrystallographicGroup,
    EquivarianceError,
    assert_equivariant,
    space_group,
)

Kind = Literal["field", "map"]
RMS = 0.05
ALLOWED = 1e-10


def worst(function: VectorField, group: CrystallographicGroup, kind: Kind) -> float:
    """The largest deviation from the law of the kind, over 8 points in the cell."""
    unit = torch.rand(8, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    points = unit @ torch.tensor(np.array(group.lattice)).mT
    try:
        assert_equivariant(function, group, kind=kind, points=points, atol=-1.0, rtol=0.0)
    except EquivarianceError as error:
        return error.error
    raise AssertionError("no deviation is below -1")


def check(number: int, max_frequency: int) -> tuple[str, bool]:
    """A line of the table, and whether all is well."""
    start = time.process_time()
    group = space_group(number, origin=1)
    known = gemmi.find_spacegroup_by_number(number)
    assert known is not None
    listed = known.operations()
    field = FourierField(group, max_frequency)
    values = np.random.default_rng(number).normal(size=field.size)
    with torch.no_grad():
        field.parameters_.copy_(torch.tensor(values * RMS / np.linalg.norm(values)))
    of_field = worst(field, group, "field") / RMS
    of_flow = worst(Flow([field], steps=2), group, "map")
    seconds = time.process_time() - start
    fits = group.order == len(listed.sym_ops) and max(of_field, of_flow) < ALLOWED
    row = f"| {number} | {group.name} | {group.order} | {len(listed.cen_ops)} | {field.size} "
    return f"{row}| {of_field:.0e} | {of_flow:.0e} | {seconds:.1f} |{'' if fits else ' OFF'}", fits


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="every 23rd group alone")
    parser.add_argument("--max-frequency", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(1)
    print("| number | symbol | order | centring | parameters | field | flow | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    wrong = 0
    for number in range(1, 231, 23 if options.quick else 1):
        row, fits = check(number, options.max_frequency)
        wrong += not fits
        print(row, flush=True)
    print(f"\n{wrong} groups are off")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
