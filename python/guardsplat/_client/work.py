"""What a client does with jobs, keys and the registry: steps for either driver."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .._progress import ProgressTo, listener
from ..errors import BadOption, JobCancelled, JobFailed, ServiceError
from ..v1 import job_pb2 as jobs
from ..v1 import job_service_pb2 as job_service
from ..v1 import key_service_pb2 as keys
from ..v1 import registry_service_pb2 as registry
from .calls import Calls
from .inputs import inputs_of, is_name
from .specs import (
    OTHER_FILES,
    WAITING,
    FileOrArtifact,
    Submission,
    Verify,
    embed_spec,
    key_spec,
    known,
    state_of,
    verify_spec,
)
from .specs import Embed as EmbedOptions
from .wire import Call, Close, Open, Read, Steps

_OVER = (jobs.Job.STATE_SUCCEEDED, jobs.Job.STATE_FAILED, jobs.Job.STATE_CANCELLED)
_LONGEST_NAME = 63


class Work(Calls):
    """Calls, and what is done with them."""

    # Jobs.

    def submit_key(self, bits: int, seed: int | None, options: dict[str, Any]) -> Steps[jobs.Job]:
        known(options, Submission)
        return (yield from self._create(jobs.Job(create_key=key_spec(bits, seed)), "", options))

    def submit_embed(self, scene: FileOrArtifact, options: dict[str, Any]) -> Steps[jobs.Job]:
        known(options, EmbedOptions)
        # What is wrong with options is told before anything is sent.
        embed_spec("", "", {}, options)
        key = yield from self.key(options["key"])

        def spec(names: list[str], files: dict[str, str]) -> jobs.Job:
            return jobs.Job(embed=embed_spec(names[0], key, files, options))

        return (yield from self._send_and_create([scene], options, spec))

    def submit_verify(self, suspects: Any, options: dict[str, Any]) -> Steps[jobs.Job]:
        known(options, Verify)
        verify_spec([], "", {}, options)
        inputs = inputs_of(suspects)
        key = yield from self.key(options["key"])
        if options.get("owner"):
            options = {**options, "owner": (yield from self.owner(options["owner"]))}

        def spec(names: list[str], files: dict[str, str]) -> jobs.Job:
            return jobs.Job(verify=verify_spec(list(dict.fromkeys(names)), key, files, options))

        return (yield from self._send_and_create(inputs, options, spec))

    def _send_and_create(self, inputs: list[FileOrArtifact], options: dict[str, Any], spec: Any) -> Steps[jobs.Job]:
        """Sends files, and queues the job that needs them; those that it does not need after all are deleted again."""
        sent: list[str] = []
        needed: set[str] = set()
        try:
            names = []
            for one in inputs:
                names.append((yield from self._sent(one, sent)))
            files = {}
            for field in OTHER_FILES:
                if (file := options.get(field)) is not None:
                    files[field] = yield from self._sent(file, sent)
            title = Path(os.fspath(inputs[0])).name
            job = yield from self._create(spec(names, files), title, options)
            # Of a request that was made before: what was sent then.
            read = job.embed if job.HasField("embed") else job.verify
            needed = {job.embed.scene, *job.verify.suspects}
            needed |= {getattr(read, field, "") for field in OTHER_FILES}
            return job
        finally:
            for name in sent:
                if name not in needed:
                    yield from self.discard(name)

    def _sent(self, one: FileOrArtifact, sent: list[str]) -> Steps[str]:
        """The artifact's name."""
        if isinstance(one, str) and is_name("artifacts", one):
            return one
        artifact = yield from self.upload(one)
        sent.append(artifact.name)
        return artifact.name

    def _create(self, job: jobs.Job, title: str, options: dict[str, Any]) -> Steps[jobs.Job]:
        printable = "".join(c for c in title if c.isprintable())
        job.display_name = options.get("display_name", printable[:_LONGEST_NAME])
        if (priority := options.get("priority")) is not None:
            job.priority = priority
        # The same for every try, so that a lost answer does not make two jobs.
        request_id = options.get("request_id") or str(uuid.uuid4())
        request = job_service.CreateJobRequest(job=job, request_id=request_id)
        return (yield from self.call("JobService.CreateJob", request))

    def wait(self, job: str | jobs.Job, progress: ProgressTo, cancel: bool) -> Steps[jobs.Job]:
        """Follows a job until it is over, however often the connection is lost; raises why it failed."""
        name = job if isinstance(job, str) else job.name
        hears = listener(progress)
        try:
            over = yield from self._follow(name, hears)
        except ServiceError:
            raise
        except BaseException:
            if cancel:
                try:
                    request = job_service.CancelJobRequest(name=name)
                    yield Call("JobService.CancelJob", request, self.timeout)
                except ServiceError:
                    # It is over meanwhile, or the server is; the interrupt is what is told.
                    pass
            raise
        finally:
            hears.close()
        if over.state == jobs.Job.STATE_SUCCEEDED:
            return over
        if over.state == jobs.Job.STATE_CANCELLED:
            raise JobCancelled(f"{name} was cancelled", job=name)
        reason = jobs.Failure.Reason.Name(over.failure.reason).removeprefix("REASON_")
        raise JobFailed(f"{name} failed: {over.failure.message} ({reason})", job=name, reason=reason)

    def _follow(self, name: str, hears: Any) -> Steps[jobs.Job]:
        cursor, patience = "", self.patience()
        while True:
            stream = None
            try:
                # A job in the queue has no news for hours; a vanished server is noticed by its missing signs of life.
                stream = yield Open("JobService.WatchJob", job_service.WatchJobRequest(name=name, cursor=cursor), None)
                while (message := (yield Read(stream))) is not None:
                    self.was_there = True
                    patience.heard()
                    cursor = message.cursor
                    _tell(hears, message.job)
                    if message.job.state in _OVER:
                        return message.job
                # A server that stops ends its streams; the job is not over.
                raise ServiceError("the server ended the stream", code="UNAVAILABLE")
            except ServiceError as error:
                yield patience.pause(error)
            finally:
                if stream is not None:
                    yield Close(stream)

    def list_jobs(self, states: Iterable[str], limit: int | None) -> Steps[list[jobs.Job]]:
        request = job_service.ListJobsRequest(states=[state_of(state) for state in states])
        return (yield from self.all("JobService.ListJobs", request, "jobs", limit))

    def embed(
        self,
        scene: FileOrArtifact,
        path: str | os.PathLike[str] | None,
        comparison: str | os.PathLike[str] | None,
        options: dict[str, Any],
    ) -> Steps[jobs.EmbedResult]:
        chosen, waiting = _apart(options)
        job = yield from self.submit_embed(scene, chosen)
        over = yield from self.wait(job, **waiting)
        for name, to in ((over.embed_result.scene, path), (over.embed_result.comparison, comparison)):
            if to is not None:
                yield from self.download(name, to)
        return over.embed_result

    def verify(self, suspects: Any, options: dict[str, Any]) -> Steps[jobs.VerifyResult]:
        chosen, waiting = _apart(options)
        job = yield from self.submit_verify(suspects, chosen)
        return (yield from self.wait(job, **waiting)).verify_result

    def create_key(self, bits: int, seed: int | None, options: dict[str, Any]) -> Steps[keys.Key]:
        chosen, waiting = _apart(options)
        job = yield from self.submit_key(bits, seed, chosen)
        over = yield from self.wait(job, **waiting)
        return (yield from self.call("KeyService.GetKey", keys.GetKeyRequest(name=over.key_result.key)))

    # Keys and the registry.

    def key(self, text: str) -> Steps[str]:
        """``keys/{key}`` from that, or from what people call it."""
        if is_name("keys", text):
            return text
        return (yield from self._called("key", text, self.list_keys()))

    def owner(self, text: str) -> Steps[str]:
        """``owners/{owner}`` from that, or from what people call it."""
        if is_name("owners", text):
            return text
        return (yield from self._called("owner", text, self.list_owners()))

    def _called(self, field: str, text: str, entries: Steps[list[Any]]) -> Steps[str]:
        found = [entry.name for entry in (yield from entries) if entry.display_name == text]
        if len(found) == 1:
            return found[0]
        limit = f"the name of one {field}"
        what = "none is" if not found else f"{', '.join(found)} are"
        raise BadOption(f"{field}: {what} called {text!r}, must be {limit}", field=field, limit=limit)

    def list_keys(self) -> Steps[list[keys.Key]]:
        return (yield from self.all("KeyService.ListKeys", keys.ListKeysRequest(), "keys", None))

    def list_owners(self) -> Steps[list[registry.Owner]]:
        return (yield from self.all("RegistryService.ListOwners", registry.ListOwnersRequest(), "owners", None))

    def create_owner(self, display_name: str, request_id: str | None) -> Steps[registry.Owner]:
        owner = registry.Owner(display_name=display_name)
        request = registry.CreateOwnerRequest(owner=owner, request_id=request_id or str(uuid.uuid4()))
        return (yield from self.call("RegistryService.CreateOwner", request))

    def assets(self, owner: str | None, key: str | None) -> Steps[list[registry.Asset]]:
        request = registry.ListAssetsRequest(
            owner="" if owner is None else (yield from self.owner(owner)),
            key="" if key is None else (yield from self.key(key)),
        )
        return (yield from self.all("RegistryService.ListAssets", request, "assets", None))

    def create_asset(
        self, original: FileOrArtifact, owner: str, key: str, display_name: str | None, request_id: str | None
    ) -> Steps[registry.Asset]:
        owner_name, key_name = (yield from self.owner(owner)), (yield from self.key(key))
        sent: list[str] = []
        try:
            asset = registry.Asset(
                artifact=(yield from self._sent(original, sent)),
                owner=owner_name,
                key=key_name,
                display_name=Path(original).name[:_LONGEST_NAME] if display_name is None else display_name,
            )
            request = registry.CreateAssetRequest(asset=asset, request_id=request_id or str(uuid.uuid4()))
            return (yield from self.call("RegistryService.CreateAsset", request))
        finally:
            # The server has taken its hash.
            for name in sent:
                yield from self.discard(name)

    def commitments(self) -> Steps[list[registry.Commitment]]:
        request = registry.ListCommitmentsRequest()
        return (yield from self.all("RegistryService.ListCommitments", request, "commitments", None))


def _apart(options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of the job, and those of the wait."""
    waiting = {"progress": options.get("progress"), "cancel": bool(options.get("cancel"))}
    return {name: value for name, value in options.items() if name not in WAITING}, waiting


def _tell(hears: Any, job: jobs.Job) -> None:
    if job.state != jobs.Job.STATE_RUNNING or not job.HasField("progress"):
        return
    progress = job.progress
    stage = jobs.Progress.Stage.Name(progress.stage).removeprefix("STAGE_").lower()
    figures = [getattr(progress, field) if progress.HasField(field) else None for field in ("bit_accuracy", "psnr_db")]
    hears(stage, progress.done, progress.total, *figures)
