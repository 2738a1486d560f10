"""The socket of drives: somebody holds a machine's keys while it is simulated.

What is said over it is in docs/control.md.
"""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass
from typing import Final

import structlog
from fastapi import APIRouter, Request, WebSocket, WebSocketDisconnect
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool

from buildarena_api.driving.messages import FRAME, Ended, Hello, Keys, Ready, Refused
from buildarena_api.driving.process import DriveProcess
from buildarena_api.driving.wheel import Course
from buildarena_api.http.access import Caller, caller_of_socket
from buildarena_api.http.admission import address_of
from buildarena_api.http.concurrency import ConcurrencyLimits
from buildarena_api.http.problems import ProblemError
from buildarena_api.http.weights import HEAVIEST
from buildarena_api.machine_uploads import MAX_BYTES, refused, shared_checker
from buildarena_benchmark import ValidationIssue
from buildarena_geometry import KeyPress, Machine
from buildarena_geometry.machine_files import machine_bytes
from buildarena_pipeline.agents.driving import drivable_task, open_drive, submit_drive
from buildarena_pipeline.agents.sessions import SessionClosedError
from buildarena_pipeline.errors import SubmissionError
from buildarena_pipeline.runtime.context import Context
from buildarena_simulation import ENGINES, Scenario
from buildarena_simulation.scenario import Control

router = APIRouter()

PATH: Final = "/v1/drives"
HELLO_S: Final = 10.0
"""How long the first message may take."""
UNREAD_S: Final = 10.0
"""A page may leave a message unread for so long."""
HEAR_EVERY_S: Final = 0.005
"""Between two changes of keys that are passed on."""
FREE_GROUND: Final = Scenario(duration_s=120.0, control=Control(mode="agent"))
VIOLATION: Final = 1008

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """What a driver asked for, and may have.

    Attributes:
        machine: The machine.
        scenario: What it is put through.
        engine: Name of the engine.
        job: The job's id; None for practice.
    """

    machine: Machine
    scenario: Scenario
    engine: str
    job: str | None


@router.websocket(PATH)
async def drive(socket: WebSocket) -> None:
    """A drive, from its first message to its last."""
    await socket.accept()
    try:
        await _serve(socket)
    except WebSocketDisconnect:
        return
    except Exception as error:  # noqa: BLE001 - as any route's error it becomes a problem
        problem = await _problem(socket, error)
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await socket.send_text(problem)
            await socket.close(VIOLATION)


async def _serve(socket: WebSocket) -> None:
    hello = await _hello(socket)
    caller = await caller_of_socket(socket, hello.key, weight=HEAVIEST)
    limits: ConcurrencyLimits = socket.app.state.concurrency
    async with limits.drives.slot(caller.key_id or address_of(socket.scope)):
        context: Context = socket.app.state.context
        asked = await run_in_threadpool(_asked, context, hello, caller)
        try:
            ended = await _play(socket, asked)
        except BaseException:
            if asked.job is not None:
                await run_in_threadpool(_cancel, context, asked.job)
            raise
        ended = await run_in_threadpool(_settle, context, asked, ended)
        await socket.send_text(ended.model_dump_json())
        await socket.close()


async def _hello(socket: WebSocket) -> Hello:
    try:
        async with asyncio.timeout(HELLO_S):
            text = await socket.receive_text()
        if len(text) > MAX_BYTES:
            raise ProblemError(413, f"the first message has at most {MAX_BYTES:,} characters")
        return Hello.model_validate_json(text)
    except TimeoutError:
        raise ProblemError(408, f"no first message came within {HELLO_S:g} s") from None
    except (ValidationError, KeyError) as error:
        raise ProblemError(422, f"the first message is not understood: {error}") from None


def _asked(context: Context, hello: Hello, caller: Caller) -> _Asked:
    """Reads the machine and opens the job.

    Raises:
        ProblemError: The machine is not sound.
        SubmissionError: There is no such engine or task, or the machine breaks its rules.
    """
    if hello.simulator not in ENGINES:
        choices = tuple(sorted(ENGINES))
        message = f"{hello.simulator!r} cannot be driven live: choose {' or '.join(choices)}"
        raise SubmissionError([ValidationIssue(path="simulator", message=message, choices=choices)])
    upload = shared_checker().read(_document(hello))
    if upload.fault is not None:
        raise refused(upload.fault)
    machine, scenario, job = upload.content.machine, FREE_GROUND, None
    where = {"task": hello.task or "", "simulator": hello.simulator}
    if hello.driver is not None:
        opened = open_drive(
            context,
            machine,
            **where,
            driver=hello.driver,
            owner=caller.key_id,
            force=caller.is_admin,
        )
        scenario, job = opened.task.scenario, opened.job.id
    elif hello.task is not None:
        scenario = drivable_task(context, machine, **where).scenario
    return _Asked(machine=machine, scenario=scenario, engine=hello.simulator, job=job)


async def _play(socket: WebSocket, asked: _Asked) -> Ended:
    """Carries messages both ways until the drive has ended.

    Raises:
        ProblemError: The machine cannot be driven, or the process ended without a word.
    """
    document, scenario = machine_bytes(asked.machine), asked.scenario.model_dump_json()
    process = DriveProcess(Course(document=document, scenario=scenario, engine=asked.engine))
    hearing = None
    try:
        await process.start()
        hearing = asyncio.create_task(_hear(socket, process))
        while (message := await process.next()) is not None:
            body = message[1:]
            if message.startswith(FRAME):
                await _send(socket, body)
            elif b'"type":"ended"' in body[:20]:
                return _ended(Ended.model_validate_json(body), is_lost=hearing.done())
            elif b'"type":"refused"' in body[:20]:
                raise ProblemError(422, Refused.model_validate_json(body).detail)
            elif b'"type":"ready"' in body[:20]:
                ready = Ready.model_validate_json(body).model_copy(update={"job": asked.job})
                await _send(socket, ready.model_dump_json())
            else:
                await _send(socket, body.decode())
        raise ProblemError(500, "the drive's process ended; nothing was stored")
    finally:
        if hearing is not None:
            hearing.cancel()
        await process.close()


async def _hear(socket: WebSocket, process: DriveProcess) -> None:
    """Passes keys on; a page that is gone, or speaks nonsense, ends the drive."""
    try:
        while True:
            keys = Keys.model_validate_json(await socket.receive_text())
            process.hold(keys)
            if keys.end:
                await asyncio.Event().wait()  # what it says after that counts for nothing
            await asyncio.sleep(HEAR_EVERY_S)
    except (WebSocketDisconnect, ValidationError, KeyError, RuntimeError):
        process.hold(Keys(end=True))


async def _send(socket: WebSocket, message: str | bytes) -> None:
    """Sends something; the drive goes on without those who are gone, until they are noticed."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        async with asyncio.timeout(UNREAD_S):
            if isinstance(message, str):
                await socket.send_text(message)
            else:
                await socket.send_bytes(message)


def _ended(ended: Ended, *, is_lost: bool) -> Ended:
    return ended.model_copy(update={"why": "lost"}) if is_lost else ended


def _settle(context: Context, asked: _Asked, ended: Ended) -> Ended:
    """Hands in what was driven."""
    log.info("drive", job=asked.job, why=ended.why, seconds=ended.time_s)
    if asked.job is None:
        return ended
    presses = [KeyPress(**press.model_dump()) for press in ended.presses]
    with contextlib.suppress(SessionClosedError):  # somebody cancelled it meanwhile
        submit_drive(context, asked.job, asked.machine, presses)
    return ended.model_copy(update={"job": asked.job})


def _cancel(context: Context, job: str) -> None:
    context.store.lifecycle.cancel_job(job, owner=None, force=True)


def _document(hello: Hello) -> bytes:
    return hello.model_dump_json(include={"machine"})[len('{"machine":') : -1].encode()


async def _problem(socket: WebSocket, error: Exception) -> str:
    """An error in the words that a request would be answered with."""
    handlers = socket.app.exception_handlers
    handler = next(handlers[kind] for kind in type(error).__mro__ if kind in handlers)
    answer = await handler(Request({**socket.scope, "type": "http", "method": "GET"}), error)
    return f'{{"type":"problem","problem":{bytes(answer.body).decode()}}}'
