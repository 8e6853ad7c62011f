from .files import read_outline as read_outline
from .pictures import ImageChannel as ImageChannel
from .pictures import read_mask as read_mask
from .pictures import read_mask_array as read_mask_array
from .reading import MAX_BYTES as MAX_BYTES
from .reading import FileContent as FileContent
from .reading import Reading as Reading
