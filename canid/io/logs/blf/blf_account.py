"""The objects that were read of a .blf against those that its header counts; of joined files, the sums."""

from __future__ import annotations

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.damage import DamagedSpans
from canid.values.types import Damage


class Account:
    """The account of one file after the other."""

    def __init__(self) -> None:
        """Begin with the first file."""
        self.objects = 0  # of this file so far
        self.inflated = blf.FILE_HEADER_SIZE  # bytes, as the file's header counts them
        self._begin = 0  # of this file, and how much damage there was before it
        self._damaged = 0
        self._read = 0  # objects of all files
        self._total = 0  # that their headers count; -1: nobody knows

    def close(self, header: blf.FileHeader | None, end: int, damaged: DamagedSpans, *, at_end: bool) -> None:
        """A file ends at byte `end`: compare it with its header; adds to `damaged`.

        `at_end`: no other file follows.
        """
        total, size = -1, end - self._begin
        if header is not None:
            # A killed writer leaves the counts of its last checkpoint, or none. A flipped bit can leave anything.
            plausible = self.objects <= header.objects and (
                header.objects * blf.OBJECT.size <= header.uncompressed_size
            )
            total = header.objects if plausible else -1
            why = "" if damaged.count > self._damaged else self._contradiction(header, size, total)
            if why:
                early = size < header.file_size and self.objects != total
                damaged.add(end, self._begin + header.file_size if early and at_end else 0, why)
        self._read += self.objects
        self._total = -1 if -1 in (total, self._total) else self._total + total
        self.objects, self.inflated = 0, blf.FILE_HEADER_SIZE
        self._begin, self._damaged = end, damaged.count

    def _contradiction(self, header: blf.FileHeader, size: int, total: int) -> str:
        """What the header says that the file does not hold; "": nothing."""
        if self.objects != total and size < header.file_size:
            return f"the file ends here, {header.file_size - size} bytes early"
        # a larger count is damage only where the header's size includes all these bytes
        if self.objects < total and self.inflated <= header.uncompressed_size:
            return f"the file's header counts {total - self.objects} more"
        # a header with exactly these sizes was written after them
        knows = (header.file_size, header.uncompressed_size) == (size, self.inflated)
        if knows and self.objects != header.objects:
            return f"the file's header counts {header.objects} objects"
        return ""

    def damage(self, damaged: DamagedSpans) -> Damage | None:
        """What could not be read; None: all could."""
        if not damaged:
            return None
        says = damaged.sentence("objects", self._read, self._total)
        return Damage(says, self._read, self._total, damaged.spans)
