"""Trajectories as Arrow IPC streams, for pages that draw them.

One record batch, a row per instant. Several values per instant are a fixed-size list, block after
block, so that a reader has each column as one flat array. Everything that is not a series is JSON
in the schema's metadata under the key `buildarena.trajectory`, as in the Parquet file.
"""

import io
from typing import TYPE_CHECKING, Final

from buildarena_simulation.errors import TrajectoryFormatError

if TYPE_CHECKING:
    import pyarrow as pa

MEDIA_TYPE: Final = "application/vnd.apache.arrow.stream"
SERIES: Final = ("time_s", "cargo_mass")
"""Columns with one value per instant."""


def unpacked_bytes(data: bytes) -> int:
    """Return the unpacked size of the columns of a trajectory's file, as the file declares it.

    Raises:
        TrajectoryFormatError: The bytes are not a Parquet file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        metadata = pq.read_metadata(io.BytesIO(data))
    except (pa.ArrowException, OSError) as error:
        raise TrajectoryFormatError(f"these bytes are not a trajectory: {error}") from error
    groups = range(metadata.num_row_groups)
    return sum(int(metadata.row_group(k).total_byte_size) for k in groups)


def arrow_stream(data: bytes) -> bytes:
    """Return a trajectory's Parquet file as an Arrow IPC stream.

    Raises:
        TrajectoryFormatError: The bytes are not a trajectory.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(data))
        columns = {name: _flat(table.column(name), name) for name in table.column_names}
    except (pa.ArrowException, ValueError, OSError) as error:
        raise TrajectoryFormatError(f"these bytes are not a trajectory: {error}") from error
    present = {name: column for name, column in columns.items() if column is not None}
    flat = pa.table(present).replace_schema_metadata(table.schema.metadata)
    out = io.BytesIO()
    with pa.ipc.new_stream(out, flat.schema) as writer:
        writer.write_table(flat)
    return out.getvalue()


def _flat(column: "pa.ChunkedArray", name: str) -> "pa.Array | None":
    """Return a column as one array; None if it is empty, as for a machine without wheels."""
    import pyarrow as pa

    combined = column.combine_chunks()
    if name in SERIES or not len(combined):
        return combined
    values = combined.flatten()
    width, remainder = divmod(len(values), len(combined))
    if remainder:
        raise ValueError(f"{name} has rows of different lengths")
    return pa.FixedSizeListArray.from_arrays(values, width) if width else None
