"""The operations of orbiflow by name, and where each is: "module:function"."""

OPERATIONS = {
    "escherize": "orbiflow.tiles.finding:escherize",
    "batch": "orbiflow.tiles.batches:batch",
    "export": "orbiflow.tiles.operations:export",
    "art": "orbiflow.tiles.operations:art",
    "solid": "orbiflow.tiles.operations:solid",
    "animate": "orbiflow.tiles.operations:animate",
    "classes": "orbiflow.tiles.finding:classes",
    "fill": "orbiflow.solids.operations:fill",
    "build": "orbiflow.solids.operations:build",
    "density summary": "orbiflow.density.operations.summary:summary",
    "density fit": "orbiflow.density.operations.fitting:fit",
    "density score": "orbiflow.density.operations.queries:score",
    "density sample": "orbiflow.density.operations.queries:sample",
    "density marginal": "orbiflow.density.operations.queries:marginal",
    "density conditional": "orbiflow.density.operations.queries:conditional",
    "density trend": "orbiflow.density.operations.trends:trend",
    "density plot": "orbiflow.density.operations.drawing:plot",
    "density compare": "orbiflow.density.operations.comparison:compare",
    "density compare-data": "orbiflow.density.operations.comparison:compare_data",
    "density test": "orbiflow.density.operations.comparison:sample_tests",
    "density region": "orbiflow.density.operations.drawing:region",
    "density cv": "orbiflow.density.cross_validation.operations:cross_validate_table",
    "density batch": "orbiflow.density.operations.fitting:batch",
    "studio": "orbiflow.studio.operations:studio",
}

WORK = {
    "density fold": "orbiflow.density.cross_validation.operations:fold",
    "studio read": "orbiflow.studio.tasks:read",
    "studio open": "orbiflow.studio.tasks:open_file",
    "studio search": "orbiflow.studio.tasks:search",
    "studio space": "orbiflow.studio.tasks:space",
    "studio pull": "orbiflow.studio.tasks:pull",
    "studio class": "orbiflow.studio.tasks:lay_in_class",
    "studio take": "orbiflow.studio.taking:take",
    "studio preview": "orbiflow.studio.taking:preview",
    "studio table": "orbiflow.studio.density_tasks:table",
    "studio mesh": "orbiflow.studio.solid_tasks:mesh",
    "studio fill": "orbiflow.studio.solid_tasks:fill",
    "studio film": "orbiflow.studio.solid_tasks:film",
    "studio density": "orbiflow.studio.density_tasks:density",
    "studio density map": "orbiflow.studio.density_tasks:density_map",
    "studio density take": "orbiflow.studio.density_tasks:take",
}
"""Operations that others give to workers, and that are no commands."""

RUN_FOLDERS = {
    "result.json": "orbiflow.tiles:written_files",
    "density.safetensors": "orbiflow.density:written_files",
    "solids.json": "orbiflow.solids:written_files",
}
"""The file that is read where the folder of a run is given, and the function, "module:function", that
returns the names of all files of the run in a folder."""
