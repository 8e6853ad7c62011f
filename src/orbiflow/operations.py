"""The operations of orbiflow by name, and where each is: "module:function"."""

OPERATIONS = {
    "escherize": "orbiflow.derived.tiles:escherize",
    "export": "orbiflow.derived.tiles:export",
    "density fit": "orbiflow.derived.density:fit",
    "density plot": "orbiflow.density.operations.drawing:plot",
    "density compare": "orbiflow.density.operations.comparison:compare",
    "density region": "orbiflow.density.operations.drawing:region",
    "density patches": "orbiflow.density.operations.drawing:patches",
}

RUN_FOLDERS = {
    "result.json": "orbiflow.tiles:written_files",
    "density.safetensors": "orbiflow.density:written_files",
}
"""The file that is read where the folder of a run is given, and the function, "module:function", that
returns the names of all files of the run in a folder."""
