"""The operations of orbiflow by name, and where each is: "module:function"."""

OPERATIONS = {
    "escherize": "orbiflow.derived.tiles:escherize",
    "export": "orbiflow.derived.tiles:export",
    "density fit": "orbiflow.derived.density:fit",
}
