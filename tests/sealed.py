"""Files that were changed on purpose, with a checksum that fits: their content is checked as well."""

import hashlib
import json

from orbiflow.runtime.tensor_files import CHECKSUM

ZEROS = "0" * 64


def sealed(data: bytes) -> bytes:
    """The file with a checksum that fits its content, if it has a header of orbiflow's."""
    length = int.from_bytes(data[:8], "little")
    try:
        outer = json.loads(data[8 : 8 + length])
        (key, text), *_ = outer["__metadata__"].items()
        header = json.loads(text)
        rest = {name: value for name, value in header.items() if name != CHECKSUM}
    except (ValueError, KeyError, AttributeError, TypeError):
        return data
    outer["__metadata__"][key] = json.dumps({CHECKSUM: ZEROS, **rest})
    inner = json.dumps(outer, separators=(",", ":")).encode()
    inner += b" " * (-len(inner) % 8)
    whole = len(inner).to_bytes(8, "little") + inner + data[8 + length :]
    return whole.replace(ZEROS.encode(), hashlib.sha256(whole).hexdigest().encode(), 1)
