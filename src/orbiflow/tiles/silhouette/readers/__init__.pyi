from .masks import MaskReading as MaskReading
from .masks import read_mask as read_mask
from .outline import read_outline as read_outline
from .pictures import MAX_BYTES as MAX_BYTES
from .pictures import read_mask_array as read_mask_array
from .reading import FileContent as FileContent
from .reading import Reading as Reading
