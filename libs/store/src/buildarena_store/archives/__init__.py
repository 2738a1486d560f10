"""Archives: a whole sweep as one ZIP file, to be kept, passed on, or imported elsewhere.

It holds every row that belongs to the sweep's jobs as JSON lines and every artifact by its hash.
An import believes nothing of it: rows are checked as strictly as requests, and its scores stay out
of rankings until they were found again here. Jobs that already exist stay as they are.
"""

from buildarena_store.archives.members import ArchiveError
from buildarena_store.archives.reading import Imported, read_archive
from buildarena_store.archives.writing import write_archive

__all__ = ["ArchiveError", "Imported", "read_archive", "write_archive"]
