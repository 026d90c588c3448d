"""Which program wrote a .blf whose header is python-can's: python-can itself, or canid up to 0.2, whose start is UTC.

python-can fills each container but the last to its end, through the middle of an object. canid begins another one where
an object does not fit, and at each checkpoint of a recording. A file of one container does not tell.
"""

from __future__ import annotations

import zlib
from typing import BinaryIO

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_object_chain import Broken, chain

# of python-can's containers, and the largest of canid's
_CONTAINER_BYTES = 128 * 1024


def is_of_canid(file: BinaryIO) -> bool:
    """Whether canid wrote a file with python-can's header; False where that does not show.

    `file`: at any place; it is left where it was.
    """
    place = file.tell()
    file.seek(blf.FILE_HEADER_SIZE)
    head = file.read(blf.CONTAINER_HEAD_SIZE)
    # of the end of the container the next signature may stand up to three bytes away
    packed = file.read(2 * _CONTAINER_BYTES)
    file.seek(place)
    if len(head) < blf.CONTAINER_HEAD_SIZE:
        return False
    signature, _, _, size, kind = blf.OBJECT.unpack_from(head)
    method, inflated = blf.CONTAINER.unpack_from(head, blf.OBJECT.size)
    end = size - blf.CONTAINER_HEAD_SIZE
    if signature != blf.SIGNATURE or kind != blf.LOG_CONTAINER or method != blf.DEFLATED or end < 0:
        return False
    if inflated >= _CONTAINER_BYTES or blf.SIGNATURE not in packed[end : end + blf.MAX_PADDING_BYTES]:
        return False
    try:
        data = zlib.decompressobj().decompress(packed[:end], inflated + 1)
        objects = chain(data, 0)
    except (zlib.error, Broken):
        return False
    last = int(objects.begin[-1] + objects.size[-1]) if len(objects.begin) else 0
    return len(data) == inflated and 0 <= inflated - last < blf.MAX_PADDING_BYTES and last > 0
