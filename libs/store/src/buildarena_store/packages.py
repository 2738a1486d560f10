"""What people hand in to challenges: each package is checked once, whoever is killed meanwhile."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

from sqlalchemy import ColumnElement, Connection, and_, func, or_, select, text, update
from sqlalchemy.dialects.postgresql import distinct_on, insert

from buildarena_store.artifacts import ArtifactInfo
from buildarena_store.database import Database
from buildarena_store.errors import NotOwnedError, StoreError, TransitionError, UnknownIdError
from buildarena_store.ids import new_id
from buildarena_store.package_tables import package_changes, packages
from buildarena_store.package_values import (
    RANKED,
    UNCHECKED,
    Checked,
    PackageChange,
    PackageState,
    SeasonChange,
    StoredPackage,
)
from buildarena_store.rows import columns_of, value_of
from buildarena_store.tables import artifacts

MAX_LISTED: Final = 200
CLAIM_S: Final = 180.0
"""How long somebody may check a package before another does; longer than a check may take."""
_DAY: Final = timedelta(days=1)


class TooManyPackagesError(StoreError):
    """An owner handed in as many packages as a season takes in a day; nothing was changed."""

    def __init__(self, season: str, most: int) -> None:
        super().__init__(f"{season} takes {most} packages a day of one owner")


class Packages:
    """Takes packages in, hands them out to be checked, and keeps what was found and decided."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def receive(
        self,
        stored: ArtifactInfo,
        *,
        season: str,
        track: str,
        name: str,
        owner: str,
        most_a_day: int | None,
    ) -> tuple[StoredPackage, bool]:
        """Takes a package in whose bytes are stored; the same file twice is one package.

        Args:
            stored: The artifact.
            season: Name of its season.
            track: Name of its track.
            name: What its owner calls the entry.
            owner: Id of the API key that hands it in; "" for the operator.
            most_a_day: How many the season takes of one owner in a day; None for any number.

        Returns:
            The package, and whether it is new.

        Raises:
            TooManyPackagesError: The owner has handed in so many.
        """
        row = {"hash": stored.hash, "media_type": stored.media_type, "size": stored.size}
        with self._database.transaction() as connection:
            lock = text("SELECT pg_advisory_xact_lock(hashtextextended(:who, 0))")
            connection.execute(lock, {"who": f"packages {season} {owner}"})
            own = and_(packages.c.season == season, packages.c.owner == owner)
            query = select(*_COLUMNS).where(own, packages.c.hash == stored.hash)
            there = connection.execute(query).first()
            if there is not None:
                return value_of(StoredPackage, there), False
            recent = packages.c.created_at > func.clock_timestamp() - _DAY
            count = select(func.count()).select_from(packages).where(own, recent)
            if most_a_day is not None and connection.execute(count).scalar_one() >= most_a_day:
                raise TooManyPackagesError(season, most_a_day)
            connection.execute(insert(artifacts).values(**row).on_conflict_do_nothing())
            values = {
                "id": new_id("package"),
                "season": season,
                "track": track,
                "name": name,
                "owner": owner,
                "hash": stored.hash,
                "state": PackageState.RECEIVED,
            }
            made = connection.execute(insert(packages).values(**values).returning(*_COLUMNS)).one()
        return value_of(StoredPackage, made), True

    def claim(self) -> StoredPackage | None:
        """The package that waits longest to be checked; nobody else gets it for `CLAIM_S`.

        One whose checker was killed is handed out again after that.
        """
        stale = packages.c.claimed_at < func.clock_timestamp() - timedelta(seconds=CLAIM_S)
        waits = or_(
            packages.c.state == PackageState.RECEIVED,
            and_(packages.c.state == PackageState.CHECKING, stale),
        )
        first = (
            select(packages.c.id)
            .where(packages.c.state.in_(UNCHECKED), waits)
            .order_by(packages.c.created_at)
            .limit(1)
            .with_for_update(skip_locked=True)
            .scalar_subquery()
        )
        statement = (
            update(packages)
            .where(packages.c.id == first)
            .values(state=PackageState.CHECKING, claimed_at=func.clock_timestamp())
            .returning(*_COLUMNS)
        )
        with self._database.statement() as connection:
            row = connection.execute(statement).first()
        return None if row is None else value_of(StoredPackage, row)

    def hand_back(self, package: str) -> None:
        """Lets another check a package that was claimed and could not be read now."""
        statement = (
            update(packages)
            .where(packages.c.id == package, packages.c.state == PackageState.CHECKING)
            .values(state=PackageState.RECEIVED, claimed_at=None)
        )
        with self._database.transaction() as connection:
            connection.execute(statement)

    def finish(self, package: str, checked: Checked) -> bool:
        """Notes what a check found, unless somebody noted it before.

        Args:
            package: The package's id.
            checked: What was found.

        Returns:
            Whether it was noted.
        """
        state = PackageState.SCORED if checked.passed else PackageState.REFUSED
        statement = (
            update(packages)
            .where(packages.c.id == package, packages.c.state == PackageState.CHECKING)
            .values(
                state=state,
                reason=checked.reason or None,
                report=checked.report,
                rules=checked.rules,
                points=checked.points,
                cost=checked.cost,
                fingerprints=list(checked.fingerprints),
                checked_at=func.clock_timestamp(),
            )
        )
        with self._database.transaction() as connection:
            return connection.execute(statement).rowcount == 1

    def recheck(self, season: str, rules: str) -> int:
        """Has packages checked again that were checked by other rules; organisers' words stay.

        Args:
            season: Name of the season.
            rules: Hash of what it is now.

        Returns:
            How many.
        """
        decided = select(package_changes.c.package).where(
            package_changes.c.package == packages.c.id
        )
        statement = (
            update(packages)
            .where(
                packages.c.season == season,
                packages.c.state.in_((PackageState.SCORED, PackageState.REFUSED)),
                packages.c.rules != rules,
                ~decided.exists(),
            )
            .values(state=PackageState.RECEIVED, claimed_at=None)
        )
        with self._database.transaction() as connection:
            return connection.execute(statement).rowcount

    def decide(
        self,
        package: str,
        to: PackageState,
        *,
        reason: str,
        by: str,
        owner: str | None = None,
    ) -> StoredPackage:
        """Accepts, refuses or withdraws a package, and notes who did so and why.

        The same again changes nothing.

        Args:
            package: Its id.
            to: Where it is to be: accepted, refused or withdrawn.
            reason: Why.
            by: Id of the API key; "" for the operator.
            owner: Whose it must be; None for anybody's.

        Raises:
            UnknownIdError: There is no such package.
            NotOwnedError: It is somebody else's.
            TransitionError: It is not checked yet, or was withdrawn.
        """
        query = select(*_COLUMNS).where(packages.c.id == package).with_for_update()
        with self._database.transaction() as connection:
            row = connection.execute(query).first()
            if row is None:
                raise UnknownIdError("package", package)
            before = value_of(StoredPackage, row)
            if owner is not None and before.owner != owner:
                raise NotOwnedError("package", package)
            if (before.state, before.reason) == (to, reason):
                return before
            unchecked = before.state in UNCHECKED and to != PackageState.WITHDRAWN
            if unchecked or before.state == PackageState.WITHDRAWN:
                raise TransitionError("package", package, before.state, to)
            return _changed(connection, before, to, reason=reason, by=by)

    def show(self, package: str) -> StoredPackage:
        """One package.

        Raises:
            UnknownIdError: There is no such package.
        """
        query = select(*_COLUMNS).where(packages.c.id == package)
        with self._database.transaction() as connection:
            row = connection.execute(query).first()
        if row is None:
            raise UnknownIdError("package", package)
        return value_of(StoredPackage, row)

    def changes(self, package: str) -> list[PackageChange]:
        """Who changed a package, the first change first."""
        query = (
            select(*columns_of(PackageChange, package_changes))
            .where(package_changes.c.package == package)
            .order_by(package_changes.c.id)
        )
        with self._database.transaction() as connection:
            return [value_of(PackageChange, row) for row in connection.execute(query)]

    def season_changes(self, season: str) -> list[SeasonChange]:
        """Who changed packages of a season, the last change first, `MAX_LISTED` at most."""
        own = columns_of(PackageChange, package_changes)
        query = (
            select(*own, package_changes.c.package, packages.c.name)
            .join_from(package_changes, packages, packages.c.id == package_changes.c.package)
            .where(packages.c.season == season)
            .order_by(package_changes.c.id.desc())
            .limit(MAX_LISTED)
        )
        with self._database.transaction() as connection:
            return [value_of(SeasonChange, row) for row in connection.execute(query)]

    def listed(
        self, *, season: str | None = None, state: str | None = None, owner: str | None = None
    ) -> list[StoredPackage]:
        """The packages that were handed in last, the newest first, `MAX_LISTED` at most."""
        conditions: list[ColumnElement[bool]] = []
        for column, wanted in (
            (packages.c.season, season),
            (packages.c.state, state),
            (packages.c.owner, owner),
        ):
            if wanted is not None:
                conditions.append(column == wanted)
        query = select(*_COLUMNS).where(*conditions)
        query = query.order_by(packages.c.created_at.desc(), packages.c.id).limit(MAX_LISTED)
        with self._database.transaction() as connection:
            return [value_of(StoredPackage, row) for row in connection.execute(query)]

    def board(self, season: str, track: str) -> list[StoredPackage]:
        """The packages that stand on a track's board, the best first.

        Of entries of one name and owner the newest stands for all: it replaces those before it.
        """
        newest = (
            select(*_COLUMNS)
            .where(
                packages.c.season == season,
                packages.c.track == track,
                packages.c.state.in_(RANKED),
                packages.c.points.is_not(None),
            )
            .ext(distinct_on(packages.c.owner, packages.c.name))
            .order_by(packages.c.owner, packages.c.name, packages.c.created_at.desc())
            .subquery()
        )
        order = (newest.c.points.desc(), newest.c.cost, newest.c.created_at, newest.c.id)
        with self._database.transaction() as connection:
            rows = connection.execute(select(newest).order_by(*order).limit(MAX_LISTED))
            return [value_of(StoredPackage, row) for row in rows]

    def alike(self, package: StoredPackage) -> list[str]:
        """Ids of the season's packages of others that share a fingerprint with one."""
        query = (
            select(packages.c.id)
            .where(
                packages.c.season == package.season,
                packages.c.owner != package.owner,
                packages.c.fingerprints.overlap(list(package.fingerprints)),
            )
            .order_by(packages.c.created_at, packages.c.id)
            .limit(MAX_LISTED)
        )
        with self._database.transaction() as connection:
            return list(connection.execute(query).scalars())


def _changed(
    connection: Connection, before: StoredPackage, to: PackageState, *, reason: str, by: str
) -> StoredPackage:
    statement = (
        update(packages)
        .where(packages.c.id == before.id)
        .values(state=to, reason=reason)
        .returning(*_COLUMNS)
    )
    after = connection.execute(statement).one()
    note = {
        "package": before.id,
        "changed_by": by,
        "state_before": before.state,
        "state": to,
        "reason": reason,
    }
    connection.execute(insert(package_changes).values(**note))
    return value_of(StoredPackage, after)


_COLUMNS = columns_of(StoredPackage, packages)
