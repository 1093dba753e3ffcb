"""Estimates as a Parquet file with the columns of the CSV file; needs pyarrow."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from abs_service.api.estimate import Estimate
from abs_service.export import table

_TYPES = {"status": pa.string(), "reasons": pa.string(), "mesh_version": pa.int64(), "evaluations": pa.int64()}


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes a Parquet file and returns its number of rows; a cell is null where that of the CSV file is empty.

    Raises:
        OSError: the file cannot be written.
    """
    names, rows = table.rows(estimates)
    schema = pa.schema([(name, _TYPES.get(name, pa.float64())) for name in names])
    columns = [[row[i] for row in rows] for i in range(len(names))]
    parquet.write_table(pa.table(columns, schema=schema), path)
    return len(rows)
