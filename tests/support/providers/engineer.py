"""A model that designs from nothing but the numbers in its prompts: an arm, and a winch of gears.

It knows how such machines are laid out, and takes every size, mass, speed and torque from what it
reads. Who can solve a task in this way was told what decides.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from buildarena_backend.journal.journal import Usage
from buildarena_worker.builtin.designs.drafting import (
    DOWN,
    EAST,
    NORTH,
    SOUTH,
    UP,
    WEST,
    Action,
    Draft,
)
from buildarena_worker.session.messages import Completion, Request, ToolCall

NUMBER = r"(-?[\d.]*\d)"
SURPLUS = 1.3
"""How much more torque there is than the load needs."""


@dataclass
class Told:
    """What a prompt says, by the words around each number."""

    text: str

    def numbers(self, pattern: str) -> tuple[float, ...]:
        """The numbers that stand where `pattern` has a `#`.

        Raises:
            LookupError: The prompt does not say it.
        """
        spaced = re.escape(pattern).replace(r"\ ", r"\s+").replace(r"\#", NUMBER)
        found = re.search(spaced, self.text)
        if found is None:
            raise LookupError(f"the prompt does not say {pattern!r}")
        return tuple(float(number) for number in found.groups())

    def number(self, pattern: str) -> float:
        """The one number of a pattern."""
        return self.numbers(pattern)[0]

    def module(self, name: str) -> Told:
        """The lines on a module."""
        found = re.search(rf"^- {re.escape(name)} \(.*\n(?:  .*\n)?", self.text, re.MULTILINE)
        if found is None:
            raise LookupError(f"the prompt does not list {name}")
        return Told(found.group())

    def mass(self, name: str) -> float:
        """A module's mass."""
        return self.module(name).number("mass #")


@dataclass
class Machine:
    """What it builds, and how it drives it."""

    actions: list[Action]
    bound: list[tuple[str, str, str]] = field(default_factory=list)
    pressed: list[tuple[float, str, float]] = field(default_factory=list)

    def control(self) -> str:
        """The controller's answer."""
        return json.dumps(
            {
                "control_design": "as computed",
                "control_config": [
                    {"block": block, "action": action, "keys": [key]}
                    for block, action, key in self.bound
                ],
                "control_sequence": [
                    {"time": time, "key": key, "hold_for": lasts}
                    for time, key, lasts in self.pressed
                ],
            }
        )


def arm(told: Told) -> Machine:
    """An arm that turns over the top of a post, from the cargo to its mark.

    The hand is as far from the post as cargo and mark are from their middle, and as high as what
    hangs from it is above the cargo.
    """
    west, north, _ = told.numbers("its underside at (#, #, #)")
    east, _, _ = told.numbers("The mark is at (#, #, #)")
    _, _, cargo_height = told.numbers("The cargo is a box of # x # x #")
    weight = told.number("weighs # mass units")
    driven = told.module("Steering Block")
    wood = told.mass("Small Wooden Block")
    reach = round((east - west) / 2)
    hanging = told.mass("Swivel") + wood + told.mass("Grabber")
    moment = (weight + hanging) * reach + wood * reach * reach / 2
    if moment > driven.number("torque up to #"):
        raise ValueError(f"a moment of {moment:g} is more than the motor holds")
    draft = Draft(modules="workshop")
    middle = draft.start()
    for side in (EAST, WEST):
        draft.row(middle, side, reach)
    back = draft.row(middle, SOUTH, 3)[-1]
    for side in (EAST, WEST):
        draft.row(back, side, 3)
    # Swivel, link and gripper reach 2.5 below the hand, and the post begins at 0.5.
    top = draft.row(middle, UP, round(cargo_height + 2.5 - 0.5))[-1]
    # Motor, root and swivel take 3 of the way north.
    for _ in range(round(north) - 3):
        top = draft.attach(top, NORTH)
    draft.row(middle, NORTH, 1)
    shoulder = draft.attach(top, NORTH, "Steering Block")
    hand = draft.row(draft.attach(shoulder, NORTH), WEST, reach)[-1]
    link = draft.attach(draft.attach(hand, NORTH, "Swivel"), DOWN)
    gripper = draft.attach(link, DOWN, "Grabber")
    half_turn = 180 / driven.number("rad/s (#°/s)")
    return Machine(
        actions=draft.actions,
        bound=[
            (shoulder, "turn_left", "LeftArrow"),
            (shoulder, "turn_right", "RightArrow"),
            (gripper, "release", "Alpha1"),
        ],
        pressed=[
            (1.0, "LeftArrow", round(half_turn * 0.99, 3)),
            (1.0 + 2 * half_turn, "Alpha1", 0.2),
            (2.0 + 2 * half_turn, "RightArrow", 0.5),
        ],
    )


def winch(told: Told) -> Machine:
    """An arm on a large gear wheel that powered ones drive, against a counterweight.

    The hand is above the cargo. Logs balance some of the load, and as many motors as it takes lift
    the rest, for a time that is integrated from torque, speed, inertia and load.
    """
    _, north, _ = told.numbers("its underside at (#, #, #)")
    _, _, cargo_height = told.numbers("The cargo is a box of # x # x #")
    weight = told.number("weighs # mass units")
    motor = told.module("Cog Medium Powered")
    ratio = told.module("Cog Large Unpowered").number("pitch radius #") / motor.number(
        "pitch radius #"
    )
    apart = round(motor.number("pitch radius #") * (1 + ratio))
    speed = motor.number("rpm (# rad/s")
    wood, log = told.mass("Small Wooden Block"), told.mass("Log")
    length, drop = round(north), 3
    least = told.number("succeeds if the height is at least #")
    if length <= least:
        raise ValueError(f"an arm of {length} does not lift it far enough")
    hub_height = round(cargo_height + drop + 1.5 - 0.5)  # blocks of the post below the hub
    draft = Draft(modules="workshop")
    hub, seats = _trestle(draft, length=length, hub_height=hub_height, apart=apart)
    wheel = draft.attach(hub, EAST, "Cog Large Unpowered")
    hung = weight + told.mass("Swivel") + drop * wood + told.mass("Grabber")
    balance = {4.0: 3, 5.0: 1}  # logs, by their distance from the axle
    load = hung * length + wood * (length**2 - 5**2) / 2
    load -= log * sum(at * count for at, count in balance.items())
    inertia = hung * length**2 + wood * (length**3 + 5**3) / 3
    inertia += log * sum(at**2 * count for at, count in balance.items())
    torque = motor.number("torque and brake up to #") * ratio
    count = math.ceil(SURPLUS * load / torque)
    if count > len(seats):
        raise ValueError(f"a load of {load:g} is more than {len(seats)} motors lift")
    motors = [draft.attach(seat, EAST, "Cog Medium Powered") for seat in seats[:count]]
    root = draft.attach(wheel, EAST)
    hand = draft.attach(draft.row(root, NORTH, length)[-1], EAST, "Swivel")
    draft.attach(draft.row(hand, DOWN, drop)[-1], DOWN, "Grabber")
    end = draft.row(root, SOUTH, 4)[-1]
    for way in (EAST, UP, DOWN):
        draft.attach(end, way, "Log")
    draft.attach(draft.attach(end, SOUTH), EAST, "Log")
    gravity = told.number("Gravity is # units")
    # Motors come to speed in a while, and push less until then.
    lasts = motor.number("after about # s") / 2 + _held_for(
        # Midway between high enough and the top, beyond which it would fall over.
        (math.asin(least / length) + math.pi / 2) / 2,
        inertia=inertia / gravity,
        torque=count * torque,
        load=load,
        fastest=speed / ratio,
    )
    let_go = told.number("At # s all keys are let go")
    return Machine(
        actions=draft.actions,
        bound=[(motor_block, "spinning_forward", "UpArrow") for motor_block in motors],
        pressed=[(round(let_go - 1.0 - lasts, 3), "UpArrow", round(lasts, 3))],
    )


def _trestle(
    draft: Draft, *, length: int, hub_height: int, apart: int
) -> tuple[str, tuple[str, ...]]:
    """Beams on both sides of the cargo, and a braced post with seats for a wheel and its motors.

    Args:
        draft: Where it is built.
        length: Of the arm, blocks.
        hub_height: Blocks of the post up to the wheel's.
        apart: Blocks from the wheel's seat to a motor's.

    Returns:
        The wheel's seat, and the motors'.
    """
    middle = draft.start()
    west = draft.row(middle, WEST, 3)
    foot, east = west[-1], draft.row(middle, EAST, 2)[-1]
    near, far = draft.row(foot, NORTH, length + 2), draft.row(east, NORTH, length + 2)
    back = draft.row(foot, SOUTH, 4)
    post = draft.row(foot, UP, hub_height + apart)
    hub = post[hub_height - 1]
    ahead, behind = draft.row(hub, NORTH, apart)[-1], draft.row(hub, SOUTH, apart)[-1]
    draft.connect(ahead, near[length - 1], NORTH, UP)
    draft.connect(behind, back[3], SOUTH, UP)
    for seat in (ahead, behind):
        draft.connect(post[-1], seat, NORTH if seat == ahead else SOUTH, UP)
    for k in (length + 1, length - 1, length - 3):
        draft.connect(near[k], far[k], EAST, WEST)
    draft.connect(west[0], post[0], UP, EAST)
    draft.connect(west[0], west[2], SOUTH, DOWN)
    draft.connect(west[1], west[2], NORTH, DOWN)
    draft.connect(west[0], near[1], NORTH, EAST)
    return hub, (post[hub_height - apart - 1], post[-1], ahead, behind)


def _held_for(angle: float, *, inertia: float, torque: float, load: float, fastest: float) -> float:
    """How long motors push a load on an arm until it can brake at an angle from level, seconds."""
    step, time, turned, rate = 0.001, 0.0, 0.0, 0.0
    while turned + rate**2 * inertia / (2 * (torque + load * math.cos(turned))) < angle:
        net = torque - load * math.cos(turned)
        rate = min(fastest, rate + step * net / inertia)
        turned += step * rate
        time += step
    return time


DESIGNS: Mapping[str, Callable[[Told], Machine]] = {"mechanisms-3": winch, "mechanisms-4": arm}


class Engineer:
    """Plays the workflow `builder`."""

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self._machine: Machine | None = None

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        self.requests.append(request)
        reply = self._reply(request)
        words = sum(len(message.text) for message in request.messages)
        usage = Usage(requests=1, input_tokens=words // 4, output_tokens=20)
        return Completion(text=reply.text, calls=reply.calls, usage=usage, latency_s=1.0)

    def _reply(self, request: Request) -> Completion:
        told = Told("\n".join(m.text for m in request.messages if m.role == "user"))
        if "# Role: controller" in request.messages[0].text:
            assert self._machine is not None
            return Completion(text=self._machine.control())
        if self._machine is None:
            named = re.search(r"^# Task: (\S+)", told.text, re.MULTILINE)
            assert named is not None
            self._machine = DESIGNS[named.group(1)](told)
        done = sum(len(m.calls) for m in request.messages if m.role == "assistant")
        if done >= len(self._machine.actions):
            return Completion(text="TERMINATE")
        name, arguments = self._machine.actions[done]
        call: Any = ToolCall(id=f"c{done}", name=name, arguments=dict(arguments))
        return Completion(text="", calls=(call,))
