"""The operations of orbiflow by name, and where each is: "module:function"."""
# ruff: noqa: E501 - a table with a line for each command

OPERATIONS = {
    "escherize": "orbiflow.tiles.operations:escherize",
    "batch": "orbiflow.tiles.batches:batch",
    "export": "orbiflow.tiles.operations:export",
    "art": "orbiflow.tiles.operations:art",
    "solid": "orbiflow.tiles.operations:solid",
    "animate": "orbiflow.tiles.operations:animate",
    "classes": "orbiflow.tiles.operations:classes",
    "density summary": "orbiflow.density.operations.summary:summary",
    "density fit": "orbiflow.density.operations.fitting:fit",
    "density score": "orbiflow.density.operations.queries:score",
    "density sample": "orbiflow.density.operations.queries:sample",
    "density marginal": "orbiflow.density.operations.queries:marginal",
    "density conditional": "orbiflow.density.operations.queries:conditional",
    "density plot": "orbiflow.density.operations.drawing:plot",
    "density compare": "orbiflow.density.operations.comparison:compare",
    "density region": "orbiflow.density.operations.drawing:region",
    "density cv": "orbiflow.density.cross_validation.operations:cross_validate",
    "density patches": "orbiflow.density.operations.drawing:patches",
    "density batch": "orbiflow.density.operations.fitting:batch",
    "studio": "orbiflow.studio.operations:studio",
}

SUMMARIES = {
    "escherize": "Find tiles that look like a silhouette and tile the plane, and prove it.",
    "batch": "Find tiles for every silhouette of a folder, here or on a Dask cluster.",
    "export": "Write a tiling in real size: to print, to cut with a laser, to draw, to put on a page.",
    "art": "Carry a picture of the silhouette onto its tile and repeat it over the plane.",
    "solid": "Make a solid to print in 3D: a tile, cookie cutter, stamp, mould or puzzle.",
    "animate": "Write an animation: a tiling becoming animals, a silhouette bending, a tiling that grows.",
    "classes": "List isohedral classes: their groups, the symmetry of their tiles, and how edges are identified.",
    "density summary": "Summarise angles, directions or axes: means with intervals, spread, correlations, tests.",
    "density fit": "Fit a density: angles (torus), lat,lon or x,y,z (sphere), axes (projective plane) or theta,phi.",
    "density score": "Add a column log_prob, in nats, to a table.",
    "density sample": "Draw samples in the units of the data.",
    "density marginal": "Find the density of some of a torus' angles, whatever the others are.",
    "density conditional": "Find the density of a torus' other angles where some are known.",
    "density plot": "Draw a density: density, flow, samples as PNG, PDF or SVG, and surface.html, to turn in 3-D.",
    "density compare": "Which model suits held-out rows better, or do two data sets differ? With its uncertainty.",
    "density region": "Find the smallest regions that hold a mass: threshold, size, and boundary as closed polygons.",
    "density cv": "Cross-validate: how well does a density predict rows that its fit has not seen?",
    "density patches": "Turn image patches into theta,phi on the Klein bottle, for `fit --space klein-bottle`.",
    "density batch": "Fit a density to every table of a folder, here or on a Dask cluster.",
    "studio": "Make tiles and densities in a browser: a web page that this very machine serves.",
}
"""The first sentence of each one's docstring, so that a list of all commands imports none of them."""

WORK = {
    "density fold": "orbiflow.density.cross_validation.operations:fold",
    "studio read": "orbiflow.studio.tasks:read",
    "studio open": "orbiflow.studio.tasks:open_file",
    "studio search": "orbiflow.studio.tasks:search",
    "studio space": "orbiflow.studio.tasks:space",
    "studio pull": "orbiflow.studio.tasks:pull",
    "studio take": "orbiflow.studio.tasks:take",
    "studio table": "orbiflow.studio.density_tasks:table",
    "studio density": "orbiflow.studio.density_tasks:density",
    "studio density map": "orbiflow.studio.density_tasks:density_map",
    "studio density take": "orbiflow.studio.density_tasks:take",
}
"""Operations that others give to workers, and that are no commands."""

RUN_FOLDERS = {
    "result.json": "orbiflow.tiles:written_files",
    "density.safetensors": "orbiflow.density:written_files",
}
"""The file that is read where the folder of a run is given, and the function, "module:function", that
returns the names of all files of the run in a folder."""
