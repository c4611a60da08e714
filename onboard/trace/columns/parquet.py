"""A log as Parquet files, one table a message: for DuckDB, pandas and whatever else reads columns."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]  # it comes without types
import pyarrow.parquet as pq  # type: ignore[import-untyped]  # it comes without types

from onboard.core.site import Site
from onboard.trace.columns.block import FrameBlock
from onboard.trace.columns.signals import MessageColumns, SignalDecoder, type_of
from onboard.wire.dbc_file import MessageLayout, SignalLayout

#: Rows that wait in memory until they are written together, of each message: a reader skips whole groups of rows.
_GROUP_ROWS = 1 << 16
_YES_NO = ((0, "NO"), (1, "YES"))


class MessageTables:
    """Writes a table for each message that a log holds. A context manager; leaving it writes what waits.

    Each has ``time_us`` (since the epoch), ``channel``, ``sender`` (node-ID), with a site ``machine`` (its name), then
    the message's signals: numbers in the DBC's units, value tables by their names, yes and no as booleans.
    """

    def __init__(self, folder: Path, site: Site | None = None) -> None:
        """The folder is made where it is not there. Raises ``OSError``, ``FileExistsError`` where it holds tables."""
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.glob("*.parquet")):
            raise FileExistsError
        self.rows: dict[str, int] = {}
        self._folder = folder
        self._names = _names(site) if site is not None else None
        self._writers: dict[str, Any] = {}
        self._waiting: dict[str, list[Any]] = {}
        if site is not None:
            self._write_machines(site)

    def add(self, block: FrameBlock, messages: Iterable[MessageColumns]) -> None:
        """The messages of one block."""
        channels = np.array(block.channels, np.object_)
        for one in messages:
            name, rows = one.layout.name, one.rows
            columns = {
                "time_us": pa.array(block.time_us[rows]),
                "channel": pa.array(channels[block.channel[rows]], pa.string()),
                "sender": pa.array(one.sender),
            }
            if self._names is not None:
                columns["machine"] = pa.array(self._names[one.sender], pa.string())
            for signal in one.layout.signals:
                columns[signal.name] = _column(signal, one.values[signal.name])
            waiting = self._waiting.setdefault(name, [])
            waiting.append(pa.table(columns, schema=self._schema(one.layout)))
            self.rows[name] = self.rows.get(name, 0) + len(rows)
            if sum(len(table) for table in waiting) >= _GROUP_ROWS:
                self._write(name)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for name in list(self._waiting):
            self._write(name)
        for writer in self._writers.values():
            writer.close()

    def _write(self, name: str) -> None:
        tables = self._waiting.pop(name)
        writer = self._writers.get(name)
        if writer is None:
            path = self._folder / f"{name}.parquet"
            writer = self._writers[name] = pq.ParquetWriter(path, tables[0].schema, compression="zstd")
        writer.write_table(pa.concat_tables(tables))

    def _schema(self, layout: MessageLayout) -> Any:
        head = [pa.field("time_us", pa.int64()), pa.field("channel", pa.string()), pa.field("sender", pa.uint8())]
        named = [pa.field("machine", pa.string())] if self._names is not None else []
        return pa.schema([*head, *named, *(pa.field(one.name, _type(one)) for one in layout.signals)])

    def _write_machines(self, site: Site) -> None:
        machines = list(site.machines.values())
        table = pa.table(
            {
                "node": pa.array([one.node_id for one in machines], pa.uint8()),
                "name": pa.array([one.name for one in machines], pa.string()),
                "kind": pa.array([one.kind.name for one in machines], pa.string()),
            }
        )
        pq.write_table(table, self._folder / "machines.parquet")


def export(blocks: Iterable[FrameBlock], decoder: SignalDecoder, folder: Path, site: Site | None) -> dict[str, int]:
    """All tables of a log; rows by message. Raises as ``MessageTables`` does."""
    with MessageTables(folder, site) as tables:
        for block in blocks:
            tables.add(block, decoder.decode(block))
        return tables.rows


def _names(site: Site) -> Any:
    """Names by node-ID; None for who is not of the site."""
    names = np.full(256, None, np.object_)
    for machine in site.machines.values():
        names[machine.node_id] = machine.name
    return names


def _type(signal: SignalLayout) -> Any:
    if signal.choices == _YES_NO:
        return pa.bool_()
    return pa.string() if signal.choices else pa.from_numpy_dtype(type_of(signal))


def _column(signal: SignalLayout, values: Any) -> Any:
    if signal.choices == _YES_NO:
        return pa.array(values.astype(np.bool_))
    if not signal.choices:
        return pa.array(values)
    names = np.full(signal.maximum + 1, None, np.object_)
    for value, name in signal.choices:
        names[value] = name
    return pa.array(names[values], pa.string())
