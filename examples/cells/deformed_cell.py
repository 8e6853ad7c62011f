"""A cell that repeats, deformed by a flow that keeps its symmetry and its volumes, towards a goal.

    python examples/cells/deformed_cell.py --out out/cell

Square struts meet in the middle of a cube, a solid of the space group P 4 3 2. The fields of the
flow commute with that group and have no divergence, so every deformation is as symmetric, repeats as
the cell does and keeps the volume. Their parameters are found by descent for an objective of one's
own: here the area of the surface, which rounds the struts and fills their corners, as a film of soap
does around a given volume. Change `objective` for another goal.

Written are cell.stl and block.stl, 2 x 2 x 2 cells, both watertight, and cells.png, before and after.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from manifold3d import Manifold, Mesh64, OpType
from PIL import Image
from torch import Tensor

from orbiflow.drawing import ShadedPart, draw_solids, write_stl
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.symmetry import space_group

GROUP = space_group("P 4 3 2")
HALF_WIDTH, EDGE = 0.2, 0.05  # of the struts, and the longest edge of a triangle, in cells
FREQUENCY, SEGMENTS, STEPS = 4, 2, 6
ROUNDS = 20


def struts(cells: int) -> Manifold:
    """Return struts through the middle of each of so many cells along each axis."""
    bodies = list[Manifold]()
    for axis in range(3):
        for places in np.ndindex(cells, cells):
            low = np.insert(np.array(places) + 0.5 - HALF_WIDTH, axis, 0.0)
            high = np.insert(np.array(places) + 0.5 + HALF_WIDTH, axis, float(cells))
            bodies.append(Manifold.cube((high - low).tolist()).translate(low.tolist()))
    return Manifold.batch_boolean(bodies, OpType.Add).refine_to_length(EDGE)


def mesh_of(body: Manifold) -> tuple[Tensor, Tensor]:
    """Return the points (N, 3) and triangles (M, 3) of a body."""
    mesh = body.to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3]
    return torch.tensor(points), torch.tensor(np.asarray(mesh.tri_verts).astype(np.int64))


def objective(points: Tensor, triangles: Tensor) -> Tensor:
    """Return the area of the surface: put your own loss here."""
    a, b, c = points[triangles].unbind(dim=1)
    return torch.linalg.cross(b - a, c - a).norm(dim=1).sum() / 2


def volume(points: Tensor, triangles: Tensor) -> float:
    """Return the volume that triangles enclose."""
    a, b, c = points[triangles].unbind(dim=1)
    return float((a * torch.linalg.cross(b, c)).sum() / 6)


def descend(flow: Flow, points: Tensor, triangles: Tensor) -> None:
    """Lower the objective of the cell's own surface, without the ends of its struts."""
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(dim=1)
    surface = triangles[inside[triangles].any(dim=1)]
    optimizer = torch.optim.LBFGS(flow.parameters(), max_iter=ROUNDS, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = objective(flow(points), surface)
        loss.backward()
        return loss

    before = float(objective(points, surface))
    optimizer.step(closure)
    with torch.no_grad():
        after = float(objective(flow(points), surface))
    print(f"objective: {before:.5f} before, {after:.5f} after")


def measure(flow: Flow, points: Tensor, triangles: Tensor) -> None:
    """Print how far the deformed cell is from its volume and from its symmetry."""
    generator = torch.Generator().manual_seed(0)
    some = torch.rand(500, 3, dtype=torch.float64, generator=generator)
    # the map's own derivative: an integral of the divergence would be 0 whatever the steps do
    stretch = torch.linalg.det(torch.func.vmap(torch.func.jacrev(flow))(some)).detach()
    with torch.no_grad():
        moved, error = flow(some), 0.0
        for g in GROUP.cosets:
            linear, shift = torch.tensor(g.linear), torch.tensor(g.translation)
            error = max(
                error, float((flow(some @ linear.T + shift) - moved @ linear.T - shift).abs().max())
            )
        volumes = volume(points, triangles), volume(flow(points), triangles)
    print(f"largest change of volume at 500 points: {float((stretch - 1).abs().max()):.1e}")
    print(f"largest departure from the group: {error:.1e}")
    print(f"volume of the cell's mesh: {volumes[0]:.7f} before, {volumes[1]:.7f} after")


def deformed(flow: Flow, points: Tensor, triangles: Tensor) -> Manifold:
    """Return the deformed body; it is refused unless it is closed."""
    with torch.no_grad():
        moved = flow(points).numpy()
    body = Manifold(Mesh64(moved, triangles.numpy().astype(np.uint64)))
    if body.status().name != "NoError":
        raise SystemExit(f"the deformed mesh is not closed: {body.status()}")
    return body


def picture(body: Manifold) -> Image.Image:
    """Return a picture of a body, from above and the side."""
    points, triangles = mesh_of(body)
    part = ShadedPart.smooth(points.numpy(), triangles.numpy(), "#e8b04a", crease=40.0)
    return draw_solids([part], (700, 700), outlined=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out/cell"))
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(0)
    fields = [
        FourierField(GROUP, FREQUENCY, divergence_free=True, smoothness=1.0)
        for _ in range(SEGMENTS)
    ]
    flow = Flow(fields, steps=STEPS, warn=False)
    print(
        f"{SEGMENTS} fields with {fields[0].size} parameters each, group of {GROUP.order} elements"
    )
    one, block = mesh_of(struts(1)), mesh_of(struts(2))
    descend(flow, *one)
    fine = flow.with_steps(8 * STEPS)
    measure(fine, *one)
    for name, mesh in (("cell", one), ("block", block)):
        body = deformed(fine, *mesh)
        (out / f"{name}.stl").write_bytes(write_stl({name: body.scale((40.0, 40.0, 40.0))}))
        print(f"{name}.stl: watertight, genus {body.genus()}, {body.volume():.6f} cells of volume")
    sheet = Image.new("RGB", (1400, 700), "white")
    sheet.paste(picture(struts(2)), (0, 0))
    sheet.paste(picture(deformed(fine, *block)), (700, 0))
    sheet.save(out / "cells.png")


if __name__ == "__main__":
    main()
