"""Bags of ROS 2 in SQLite (.db3).

A database can hold more than tables: views, triggers, virtual tables, columns that are computed
when they are read, pages that belong to two tables. Only plain tables are read.
"""

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from holdfast.errors import RecordingError
from holdfast.io.safe_reading import ReadBudget
from holdfast_ros.bag_storage import MAX_BAG_CONNECTIONS, BagConnection, check_number

STEP_SIZE = 100
"""Number of instructions of SQLite that count as a step of work."""
MAX_TABLES = 64
"""Maximum number of tables and indexes; a bag has six."""

_N_PAGES = slice(28, 32)
"""Place of the number of pages in the header of a database."""
_EXPRESSION = -2
"""Number that SQLite gives a column of an index that is an expression."""


class SqliteBag:
    """Reader of a bag in SQLite; see `open_sqlite`."""

    def __init__(self, database: sqlite3.Connection, budget: ReadBudget, *, complete: bool) -> None:
        self.complete = complete
        self._database = database
        self._budget = budget
        self._refusal: RecordingError | None = None
        database.set_progress_handler(self._step, STEP_SIZE)

    def check(self) -> None:
        """Check that there are plain tables only, and that no page is in two of them.

        Raises:
            ValueError: there is something else.
        """
        # The schema of an unknown file must not call functions that have effects.
        self._rows("PRAGMA trusted_schema = OFF")
        # A CHECK is an expression of the file, which `quick_check` would evaluate.
        self._rows("PRAGMA ignore_check_constraints = ON")
        items = self._rows("SELECT type, name, rootpage FROM sqlite_master", MAX_TABLES)
        for kind, name, page in items:
            if kind not in ("table", "index") or not page or not isinstance(name, str):
                raise ValueError(f"tables of a ROS 2 bag expected, {str(kind)[:20]} {name!r} given")
            quoted = name.replace('"', '""')
            if kind == "table":
                # Field 6 is 0 for a stored column, field 1 of an index the number of its column.
                hidden = [row[1] for row in self._rows(f'PRAGMA table_xinfo("{quoted}")') if row[6]]
            else:
                columns = self._rows(f'PRAGMA index_xinfo("{quoted}")')
                hidden = [row[2] for row in columns if row[1] == _EXPRESSION]
            if hidden:
                raise ValueError(f"{name!r} has a computed column; only stored columns are read")
        names = {name for _, name, _ in items}
        if missing := {"topics", "messages"} - names:
            raise ValueError(f"no table {min(missing)!r}; the tables of a ROS 2 bag expected")
        if self.complete and (problem := self._rows("PRAGMA quick_check(1)")) != [("ok",)]:
            raise ValueError(f"damaged pages: {str(problem[0][0])[:100]}")

    @property
    def connections(self) -> list[BagConnection]:
        """All connections."""
        topics = self._rows("SELECT id, name, type FROM topics ORDER BY id", MAX_BAG_CONNECTIONS)
        if len({number for number, _, _ in topics}) < len(topics):
            raise ValueError("two topics with the same number")
        query = "SELECT topic_id, count(*) FROM messages GROUP BY topic_id"
        counts = dict(self._rows(query)) if self.complete else {}
        definitions: dict[str, str] = {}
        if self._rows("PRAGMA table_info(message_definitions)"):  # older bags have none
            rows = self._rows(
                "SELECT topic_type, encoded_message_definition FROM message_definitions "
                "WHERE encoding = 'ros2msg'",
                MAX_BAG_CONNECTIONS,
            )
            definitions = {str(kind): str(text) for kind, text in rows}
        return [
            BagConnection(
                int(number), str(name), str(kind), definitions.get(kind, ""), counts.get(number, 0)
            )
            for number, name, kind in topics
        ]

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield connection, time [ns] and bytes of each message of connections, by time."""
        places = ",".join("?" for _ in numbers)
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places})"
        if self.complete:
            yield from self._messages(f"{query} ORDER BY timestamp", numbers)
            return
        found: list[tuple[int, int, bytes]] = []
        with suppress(sqlite3.DatabaseError):  # the first page that is cut off
            for message in self._messages(f"{query} ORDER BY id", numbers):
                self._budget.keep(len(message[2]), 1)
                found.append(message)
        yield from sorted(found, key=lambda message: message[1])

    def _messages(self, query: str, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        with self._refusals():
            for number, time, data in self._database.execute(query, tuple(numbers)):
                if not isinstance(time, int) or not isinstance(data, bytes):
                    raise ValueError("a message without a time or without bytes")
                yield number, time, data

    def _rows(self, query: str, max_rows: int | None = None) -> list[tuple[Any, ...]]:
        """Return the rows of a query, which count in the budget."""
        rows: list[tuple[Any, ...]] = []
        with self._refusals():
            for row in self._database.execute(query):
                self._budget.keep(sum(len(v) for v in row if isinstance(v, str | bytes)), 1)
                rows.append(row)
                if max_rows is not None:
                    check_number(len(rows) - max_rows + MAX_BAG_CONNECTIONS)
        return rows

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Raise the error of the budget in place of SQLite's, which is "interrupted"."""
        try:
            yield
        except sqlite3.Error:
            if self._refusal is not None:
                raise self._refusal from None
            raise

    def _step(self) -> int:
        """Count instructions of SQLite; return 1 to interrupt it."""
        try:
            self._budget.step()
        except RecordingError as refusal:
            self._refusal = refusal
        return int(self._refusal is not None)


@contextmanager
def open_sqlite(path: Path, budget: ReadBudget) -> Iterator[SqliteBag]:
    """Open a bag in SQLite for reading; nothing beside the file is read or written.

    Raises:
        ValueError: it holds something else than plain tables.
        sqlite3.Error: it is damaged.
    """
    with ExitStack() as stack:
        with path.open("rb") as file:
            head = file.read(100)
        # Places in the header of a database; the size 65536 does not fit and is stored as 1.
        page_size, n_pages = int.from_bytes(head[16:18]), int.from_bytes(head[_N_PAGES])
        page_size = 65536 if page_size == 1 else page_size
        complete = path.stat().st_size >= n_pages * page_size
        if not complete and page_size:
            # SQLite reads what is missing of a page as zeros, and so does it with the pages of a
            # long message: the copy has whole pages only, and states how many.
            path = Path(copyfile(path, Path(stack.enter_context(TemporaryDirectory())) / "cut.db3"))
            with path.open("r+b") as file:
                n_pages = path.stat().st_size // page_size
                file.truncate(n_pages * page_size)
                file.seek(_N_PAGES.start)
                file.write(n_pages.to_bytes(4))
        # `immutable`: no lock, journal or other file is made or read beside the bag.
        address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
        database = stack.enter_context(closing(sqlite3.connect(address, uri=True)))
        # A text that is no UTF-8 becomes part of a message, not an error of its own.
        database.text_factory = lambda data: data.decode(errors="replace")
        bag = SqliteBag(database, budget, complete=complete)
        bag.check()
        yield bag
