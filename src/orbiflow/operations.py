"""The operations of orbiflow by name, and where each is: "module:function"."""

OPERATIONS = {
    "escherize": "orbiflow.tiles.operations:escherize",
    "export": "orbiflow.tiles.operations:export",
    "art": "orbiflow.tiles.operations:art",
    "animate": "orbiflow.tiles.operations:animate",
    "classes": "orbiflow.tiles.operations:classes",
    "density fit": "orbiflow.derived.density:fit",
}

RUN_FOLDERS = {
    "result.json": "orbiflow.tiles:written_files",
    "density.safetensors": "orbiflow.density:written_files",
}
"""The file that is read where the folder of a run is given, and the function, "module:function", that
returns the names of all files of the run in a folder."""
