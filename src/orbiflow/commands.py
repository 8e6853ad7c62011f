"""The operations of orbiflow by name, and where each is: "module:function"."""

OPERATIONS = {
    "escherize": "orbiflow.tiles.operations:escherize",
    "batch": "orbiflow.tiles.batches:batch",
    "export": "orbiflow.tiles.operations:export",
    "art": "orbiflow.tiles.operations:art",
    "solid": "orbiflow.tiles.operations:solid",
    "animate": "orbiflow.tiles.operations:animate",
    "classes": "orbiflow.tiles.operations:classes",
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
}

WORK = {"density fold": "orbiflow.density.cross_validation.operations:fold"}
"""Operations that others give to workers, and that are no commands."""

RUN_FOLDERS = {
    "result.json": "orbiflow.tiles:written_files",
    "density.safetensors": "orbiflow.density:written_files",
}
"""The file that is read where the folder of a run is given, and the function, "module:function", that
returns the names of all files of the run in a folder."""
