"""Each kind of process does its work with a role of its own, and can't do what is not its work."""

import re
from collections.abc import Iterator

import pytest
from sqlalchemy import make_url, text
from sqlalchemy.exc import IntegrityError, ProgrammingError
from support.paid_models import REGISTRY
from support.servers.live_api import api_client
from support.servers.run_servers import execute
from support.stages import work

from buildarena_backend.catalog.specs import SweepSpec
from buildarena_backend.database import tables
from buildarena_backend.database.database import Database
from buildarena_backend.database.rights import RIGHTS, ROLES
from buildarena_backend.database.roles import OWNER, RoleError, make_roles
from buildarena_backend.process.context import Context, open_context
from buildarena_backend.process.reaper import Reaper
from buildarena_backend.states import CONSTRUCT_QUEUE, Verdict, simulate_queue
from buildarena_backend.submission.submission import Submissions
from buildarena_worker.wiring import verifier

PROCESSES = ("api", "construct", "simulate")
SWEEP = {"tasks": ["lift-1"], "models": ["builtin/expert"], "simulator": "mujoco"}
PERMANENT = ("api_keys", "budgets", "names", "jobs", "sweeps", "tasks", "journal", "events")
"""What nobody removes rows from, but the owner."""


def url_of(database_url: str, role: str) -> str:
    """A login of this test worker's own: roles belong to the whole server."""
    name = f"{make_url(database_url).database}_{role}"
    url = make_url(database_url).set(username=name, password=f"secret of {role} %s '\"")
    return url.render_as_string(hide_password=False)


@pytest.fixture(scope="module")
def logins(database_url) -> Iterator[dict[str, str]]:
    """A URL for each role."""
    urls = {role: url_of(database_url, role) for role in ROLES}
    database = Database(database_url)
    make_roles(database, urls)
    database.migrate()
    yield urls
    with database.transaction() as connection:
        for url in urls.values():
            name = make_url(url).username
            connection.execute(text(f'DROP OWNED BY "{name}"'))
            connection.execute(text(f'DROP ROLE "{name}"'))
    database.close()


@pytest.fixture
def contexts(context, logins) -> Iterator[dict[str, Context]]:
    """The process of each role, on an empty database."""
    copy = context.settings.model_copy
    made = {role: open_context(copy(update={"database_url": url})) for role, url in logins.items()}
    yield made
    for each in made.values():
        each.close()


def allowed(context: Context, statement: str) -> bool:
    """Whether the role may run a statement; it changes nothing."""
    refused = ""
    with context.store.database.engine.connect() as connection:
        try:
            connection.execute(text(statement))
        except (ProgrammingError, IntegrityError) as error:
            refused = str(error)
    denied = any(words in refused for words in ("permission denied", "must be", "must have"))
    assert denied or not refused or "null value" in refused, refused
    return not denied


def test_a_job_goes_through_processes_with_roles_of_their_own(contexts) -> None:
    api = contexts["api"]
    with api_client(api) as client:
        limited = {**SWEEP, "samples": 1, "worlds": 1, "budget": {"max_requests": 1000}}
        made = client.post("/v1/sweeps", json=limited)
        assert made.status_code == 201, made.text
        (job,) = api.store.jobs.page(limit=10)
        for _ in range(6):
            work(contexts["construct"], queues=(CONSTRUCT_QUEUE,))
            work(contexts["simulate"], queues=(simulate_queue("mujoco"),))
        done = api.store.jobs.get(job.id)
        assert done.outcome == "success", done
        for name in PROCESSES:
            Reaper(contexts[name]).reap()
        for path in ("leaderboard", f"sweeps/{made.json()['id']}", "metrics"):
            assert client.get(f"/v1/{path}").status_code == 200, path
        key = client.post("/v1/keys", json={"name": "ada", "scopes": ["submit"]})
        assert key.status_code == 201, key.text
        assert client.post(f"/v1/jobs/{job.id}/verify").status_code == 201
    assert verifier(contexts["construct"]).verify(job.id).verdict == Verdict.VERIFIED
    with contexts["reader"].store.database.transaction() as connection:
        for table in tables.metadata.tables:
            connection.execute(text(f"SELECT count(*) FROM {table}"))


OWNERS_ALONE = (
    *("CREATE TABLE mine (a int)", "CREATE TEMPORARY TABLE mine (a int)", "DROP TABLE jobs"),
    *("TRUNCATE jobs", "ALTER TABLE jobs ADD COLUMN mine int", "CREATE ROLE mine"),
    "GRANT pg_read_server_files TO CURRENT_USER",
    "ALTER TABLE jobs DISABLE TRIGGER ALL",
    "CREATE FUNCTION mine() RETURNS int LANGUAGE sql AS 'SELECT 1'",
    "UPDATE alembic_version SET version_num = 'x'",
    *("COPY jobs TO PROGRAM 'cat'", "SELECT pg_read_file('/etc/passwd')"),
    *("SELECT rolpassword FROM pg_authid", "SET ROLE buildarena"),
    *(f"DELETE FROM {table}" for table in PERMANENT),
)
"""What no process may do, of the schema, the server and what results rest on."""
NEVER_REWRITTEN = tuple(f"UPDATE {table} SET job_id = job_id" for table in ("journal", "events"))
NOT_WORKERS = (
    *(f"SELECT {column} FROM api_keys" for column in ("secret_hash", "previous_hash", "scopes")),
    *("UPDATE api_keys SET revoked_at = NULL", "UPDATE api_keys SET secret_hash = 'x'"),
    *("SELECT 1 FROM names", "INSERT INTO api_keys (id) VALUES ('key_x')"),
    *("UPDATE budgets SET max_cost_usd = 1e6", "INSERT INTO budgets (id) VALUES ('key_x')"),
    *("INSERT INTO sweeps (id) VALUES ('sweep_x')", "INSERT INTO jobs (id) VALUES ('job_x')"),
    *("INSERT INTO tasks (name) VALUES ('x')", "UPDATE journal SET reply = '{}'"),
    *("UPDATE sweeps SET owner = 'key_x'", "UPDATE sweep_jobs SET claimed = false"),
    "UPDATE events SET kind = 'x'",
)
"""Workers read no keys and raise no limit."""
NOT_SIMULATORS = (
    *("SELECT reply FROM journal", "INSERT INTO journal (job_id) VALUES ('job_x')"),
    "UPDATE budgets SET spent_cost_usd = 0",
    "INSERT INTO reservations (job_id) VALUES ('job_x')",
    "UPDATE sweeps SET state = 'active'",
)
"""A simulation worker sees no replies and spends nothing."""
REFUSED = {
    "api": NEVER_REWRITTEN,
    "construct": NEVER_REWRITTEN + NOT_WORKERS,
    "simulate": NEVER_REWRITTEN + NOT_WORKERS + NOT_SIMULATORS,
    "reader": tuple(f"INSERT INTO {table} DEFAULT VALUES" for table in tables.metadata.tables),
}


def test_no_process_does_what_is_not_its_work(contexts) -> None:
    assert set(REFUSED) == set(ROLES)
    tried = [(role, one) for role, own in REFUSED.items() for one in (*OWNERS_ALONE, *own)]
    done = [(role, one) for role, one in tried if allowed(contexts[role], one)]
    assert done == []
    with contexts["api"].store.database.engine.connect() as connection:
        there = text("SELECT tablename FROM pg_tables WHERE schemaname = 'public'")
        found = set(connection.execute(there).scalars())
    assert found <= set(re.findall(r"\w+", RIGHTS.read_text("utf-8"))), "no table is forgotten"


def test_a_worker_stops_a_sweep_whose_budget_is_used_up(contexts) -> None:
    api = contexts["api"]
    spec = SweepSpec(**SWEEP | {"models": ["paid/expert"]}, samples=1, budget={"max_requests": 1})
    sweep = Submissions(api, REGISTRY).submit_sweep(spec).sweep.id
    work(contexts["construct"], queues=(CONSTRUCT_QUEUE,))
    assert api.store.sweeps.get(sweep).state == "budget_exhausted"


def test_a_login_has_one_role_and_new_rights_replace_old_ones(context, contexts, logins) -> None:
    owner = context.store.database
    name = make_url(logins["reader"]).username
    with owner.transaction() as connection:
        connection.execute(text(f'GRANT buildarena_api TO "{name}"'))
        connection.execute(text("GRANT DELETE ON jobs TO buildarena_reader"))
    assert allowed(contexts["reader"], "DELETE FROM jobs")
    make_roles(owner, {"reader": logins["reader"]})
    owner.migrate()
    assert not allowed(contexts["reader"], "DELETE FROM jobs")
    assert not allowed(contexts["reader"], "UPDATE jobs SET detail = ''")


def test_an_owner_who_is_no_superuser_takes_an_older_installation_over(database_url) -> None:
    """Its tables were made by a superuser, who signed every process in."""
    name = f"{make_url(database_url).database}_older"
    older = make_url(database_url).set(database=name).render_as_string(hide_password=False)
    url = url_of(older, OWNER)
    foreign = text(
        "SELECT count(*) FILTER (WHERE relowner <> current_user::regrole), count(*) > 20 "
        "FROM pg_class WHERE relkind IN ('r', 'S') AND relnamespace = 'public'::regnamespace"
    )
    may = text("SELECT rolsuper OR rolcreaterole FROM pg_roles WHERE rolname = current_user")
    execute(database_url, f"CREATE DATABASE {name}")
    database, owner = Database(older), Database(url)
    database.migrate()
    for _ in range(2):
        make_roles(database, {OWNER: url})
    owner.migrate()
    with owner.transaction() as connection:
        assert connection.execute(foreign).one() == (0, True)
        connection.execute(text("ALTER TABLE jobs ADD COLUMN further int"))
        connection.execute(text("DROP TRIGGER log_board_delete ON jobs"))
        assert not connection.execute(may).scalar()
    owner.close()
    database.close()
    execute(database_url, f"DROP DATABASE {name} WITH (FORCE)")
    execute(database_url, f'DROP ROLE "{make_url(url).username}"')


@pytest.fixture
def owned(context, logins, database_url) -> Iterator[dict[str, str]]:
    """Logins with the owner's, who has the tables once `make_roles` was called with them."""
    url = url_of(database_url, OWNER)
    yield {**logins, OWNER: url}
    with context.store.database.transaction() as connection:
        name = make_url(url).username
        connection.execute(text(f'REASSIGN OWNED BY "{name}" TO current_user'))
        connection.execute(text(f'DROP OWNED BY "{name}"'))
        connection.execute(text(f'DROP ROLE "{name}"'))


def test_roles_are_made_again_while_others_work(context, owned, database_url) -> None:
    """As each start of a service does it: none of the tables that others use is waited for."""
    make_roles(context.store.database, owned)
    impatient = Database(f"{database_url}?options=-c%20lock_timeout%3D1s")
    with context.store.database.transaction() as works:
        works.execute(text(f"LOCK TABLE {', '.join(tables.metadata.tables)} IN ROW SHARE MODE"))
        make_roles(impatient, owned)
    impatient.close()


def test_logins_that_are_none_or_may_too_much_are_refused(context, logins, postgres_url) -> None:
    superuser = context.store.database
    for role, url, message in [
        ("admin", "postgresql://a:b@h/d", "no role 'admin'; there are api"),
        ("api", "postgresql://a@h/d", "no user and password"),
        ("api", postgres_url, "superuser"),
    ]:
        with pytest.raises(RoleError, match=message):
            make_roles(superuser, {role: url})
    with pytest.raises(RoleError, match="its own login"):
        make_roles(superuser, {"api": logins["api"], OWNER: logins["api"]})
    name = f"{make_url(context.settings.database_url).database}_more"
    url = make_url(postgres_url).set(username=name, password="x")
    for right in ("CREATEROLE", "CREATEDB", "BYPASSRLS", "REPLICATION"):
        execute(postgres_url, f"CREATE ROLE {name} LOGIN PASSWORD 'x' {right}")
        try:
            with pytest.raises(RoleError, match="may do more than a process should"):
                make_roles(superuser, {"api": url.render_as_string(hide_password=False)})
        finally:
            execute(postgres_url, f"DROP ROLE {name}")
