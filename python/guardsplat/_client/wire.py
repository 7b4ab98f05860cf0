"""Calls of the API, and the two ways to carry them out: waiting, or in an event loop.

What the client does is written once, as generators of steps; a driver carries out each and sends back what came of it.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import grpc
from google.protobuf import message_factory
from google.protobuf.message import Message
from google.rpc import error_details_pb2, status_pb2

from ..errors import ServiceError
from ..v1 import artifact_service_pb2, job_service_pb2, key_service_pb2, registry_service_pb2
from .target import Target

T = TypeVar("T")


@dataclass(frozen=True)
class Call:
    """A call with one answer; of a request, or of a stream of them."""

    method: str
    request: Message | Iterable[Message]
    timeout: float


@dataclass(frozen=True)
class Open:
    """A call with a stream of answers: the stream."""

    method: str
    request: Message
    timeout: float | None


@dataclass(frozen=True)
class Read:
    """The next answer of a stream; ``None`` at its end."""

    stream: Any


@dataclass(frozen=True)
class Close:
    """A stream that nobody reads any more."""

    stream: Any


@dataclass(frozen=True)
class Sleep:
    """A pause."""

    seconds: float


@dataclass(frozen=True)
class Work:
    """Work of this machine that may take a while: an event loop has it done by a thread."""

    function: Callable[[], Any]


Step = Call | Open | Read | Close | Sleep | Work
Steps = Generator[Step, Any, T]

_MODULES = (artifact_service_pb2, job_service_pb2, key_service_pb2, registry_service_pb2)
_SERVICES = {service.name: service for module in _MODULES for service in module.DESCRIPTOR.services_by_name.values()}


def error_of(error: Any) -> ServiceError:
    """What a failed call says, with the ``google.rpc`` details that came with it."""
    text = error.details() or "no reason given"
    named: dict[str, Any] = {"code": error.code().name}
    for key, value in error.trailing_metadata() or ():
        if key != "grpc-status-details-bin":
            continue
        for detail in status_pb2.Status.FromString(value).details:
            named.update(_named(detail))
    reason = named.get("reason")
    kind = named["code"] if reason in (None, named["code"]) else f"{named['code']}, {reason}"
    return ServiceError(f"{text} ({kind})", **named)


def _named(detail: Any) -> dict[str, Any]:
    info = error_details_pb2.ErrorInfo()
    bad = error_details_pb2.BadRequest()
    retry = error_details_pb2.RetryInfo()
    if detail.Unpack(info):
        return {"reason": info.reason, "metadata": dict(info.metadata)}
    if detail.Unpack(bad) and bad.field_violations:
        violations = {violation.field: violation.description for violation in bad.field_violations}
        return {"violations": violations, "field": bad.field_violations[0].field}
    if detail.Unpack(retry):
        return {"retry_after": retry.retry_delay.ToMilliseconds() / 1000}
    return {}


class _Methods:
    """The API's methods on a channel."""

    def __init__(self, channel: Any, metadata: list[tuple[str, str]]) -> None:
        self._channel = channel
        self._metadata = metadata
        self._made: dict[str, Any] = {}

    def start(self, method: str, request: Any, timeout: float | None) -> Any:
        """Begins a call."""
        if method not in self._made:
            service, name = method.split(".")
            found = _SERVICES[service].methods_by_name[name]
            answer = message_factory.GetMessageClass(found.output_type)
            kinds = ["stream" if stream else "unary" for stream in (found.client_streaming, found.server_streaming)]
            self._made[method] = getattr(self._channel, "_".join(kinds))(
                f"/{found.containing_service.full_name}/{name}",
                request_serializer=lambda message: message.SerializeToString(),
                response_deserializer=answer.FromString,
            )
        return self._made[method](request, timeout=timeout, metadata=self._metadata)


class Waiting:
    """Carries out steps one after the other, and waits for each."""

    def __init__(self, target: Target) -> None:
        self._channel = target.channel(grpc)
        self._methods = _Methods(self._channel, target.metadata())

    def run(self, steps: Steps[T]) -> T:
        """What the steps return."""
        answer: Any = None
        error: BaseException | None = None
        try:
            while True:
                step = steps.send(answer) if error is None else steps.throw(error)
                answer, error = None, None
                try:
                    answer = self._carry_out(step)
                except grpc.RpcError as refused:
                    error = error_of(refused)
                except BaseException as raised:  # steps put away what they have begun
                    error = raised
        except StopIteration as done:
            return done.value

    def _carry_out(self, step: Step) -> Any:
        if isinstance(step, (Call, Open)):
            return self._methods.start(step.method, step.request, step.timeout)
        if isinstance(step, Read):
            return next(step.stream, None)
        if isinstance(step, Close):
            return step.stream.cancel()
        if isinstance(step, Sleep):
            return time.sleep(step.seconds)
        return step.function()

    def close(self) -> None:
        """Ends the connection."""
        self._channel.close()


class Looping:
    """Carries out steps in an event loop."""

    def __init__(self, target: Target) -> None:
        self._target = target
        self._channel: Any = None
        self._methods: _Methods | None = None

    async def run(self, steps: Steps[T]) -> T:
        """What the steps return."""
        answer: Any = None
        error: BaseException | None = None
        try:
            while True:
                step = steps.send(answer) if error is None else steps.throw(error)
                answer, error = None, None
                try:
                    answer = await self._carry_out(step)
                except grpc.RpcError as refused:
                    error = error_of(refused)
                except BaseException as raised:  # steps put away what they have begun
                    error = raised
        except StopIteration as done:
            return done.value

    async def _carry_out(self, step: Step) -> Any:
        if self._methods is None:
            # A channel belongs to the loop that runs when it is made.
            self._channel = self._target.channel(grpc.aio)
            self._methods = _Methods(self._channel, self._target.metadata())
        if isinstance(step, Call):
            return await self._methods.start(step.method, step.request, step.timeout)
        if isinstance(step, Open):
            return self._methods.start(step.method, step.request, step.timeout)
        if isinstance(step, Read):
            answer = await step.stream.read()
            return None if answer is grpc.aio.EOF else answer
        if isinstance(step, Close):
            return step.stream.cancel()
        if isinstance(step, Sleep):
            return await asyncio.sleep(step.seconds)
        return await asyncio.to_thread(step.function)

    async def close(self) -> None:
        """Ends the connection."""
        if self._channel is not None:
            await self._channel.close()
