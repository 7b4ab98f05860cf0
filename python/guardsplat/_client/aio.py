"""The client in an event loop."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

from .._progress import ProgressTo
from ..v1 import artifact_service_pb2 as artifacts
from ..v1 import job_pb2 as jobs
from ..v1 import job_service_pb2 as job_service
from ..v1 import key_service_pb2 as keys
from ..v1 import registry_service_pb2 as registry
from .specs import Embed, EmbedAndWait, FileOrArtifact, KeyAndWait, Submission, Verify, VerifyAndWait
from .target import Target
from .wire import Looping
from .work import Work

if TYPE_CHECKING:
    from typing_extensions import Self, Unpack


class AsyncClient:
    """A client of a server: every call is a coroutine, all in the loop of the first.

    Args:
        url: ``http://HOST:PORT``, or ``https://`` with TLS; ``$GUARDSPLAT_SERVER`` unless given, else port 50051 of this machine.
        token: what the server knows the caller by; ``$GUARDSPLAT_TOKEN``, or the file ``$GUARDSPLAT_TOKEN_FILE``, unless given.
        ca: file of the certificates that the server's is checked with; public authorities unless given.
        certificate: file of the certificate to show, where the server asks for one.
        certificate_key: file of its key.
        timeout: seconds that a silent or lost server is waited for. A server that is not there at first is told at once.

    Answers are messages of ``guardsplat.v1``. Calls that the server refuses raise :class:`guardsplat.errors.ServiceError`.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        token: str | None = None,
        ca: str | os.PathLike[str] | None = None,
        certificate: str | os.PathLike[str] | None = None,
        certificate_key: str | os.PathLike[str] | None = None,
        timeout: float = 60.0,
    ) -> None:
        target = Target.of(url, token, ca, certificate, certificate_key)
        self._driver = Looping(target)
        self._work = Work(target.url, timeout)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends the connection. Jobs go on."""
        await self._driver.close()

    async def create_key(self, bits: int = 32, *, seed: int | None = None, **options: Unpack[KeyAndWait]) -> keys.Key:
        """Makes a key, which never leaves the server, and waits for it."""
        return await self._driver.run(self._work.create_key(bits, seed, dict(options)))

    async def embed(
        self,
        scene: FileOrArtifact,
        path: str | os.PathLike[str] | None,
        *,
        comparison: str | os.PathLike[str] | None = None,
        **options: Unpack[EmbedAndWait],
    ) -> jobs.EmbedResult:
        """Sends a scene, has it marked, and fetches what came out into ``path``.

        ``comparison`` is a file for a picture of original, marked and ten times their difference. With the same
        ``request_id`` it is one job, however often it is called.
        """
        return await self._driver.run(self._work.embed(scene, path, comparison, dict(options)))

    async def verify(
        self, suspects: FileOrArtifact | Iterable[FileOrArtifact], **options: Unpack[VerifyAndWait]
    ) -> jobs.VerifyResult:
        """Sends scenes, pictures and folders of pictures of one suspect, and says whether a mark is there."""
        return await self._driver.run(self._work.verify(suspects, dict(options)))

    async def submit_key(self, bits: int = 32, *, seed: int | None = None, **options: Unpack[Submission]) -> jobs.Job:
        """Queues the making of a key."""
        return await self._driver.run(self._work.submit_key(bits, seed, dict(options)))

    async def submit_embed(self, scene: FileOrArtifact, **options: Unpack[Embed]) -> jobs.Job:
        """Sends a scene and queues its marking."""
        return await self._driver.run(self._work.submit_embed(scene, dict(options)))

    async def submit_verify(
        self, suspects: FileOrArtifact | Iterable[FileOrArtifact], **options: Unpack[Verify]
    ) -> jobs.Job:
        """Sends scenes and pictures of one suspect and queues their verification."""
        return await self._driver.run(self._work.submit_verify(suspects, dict(options)))

    async def wait(self, job: str | jobs.Job, *, progress: ProgressTo = None, cancel: bool = False) -> jobs.Job:
        """Waits until a job is over, however often the connection is lost.

        ``cancel`` cancels it where the wait is interrupted. Raises :class:`guardsplat.errors.JobFailed` or
        :class:`guardsplat.errors.JobCancelled` where it did not succeed.
        """
        return await self._driver.run(self._work.wait(job, progress, cancel))

    async def get_job(self, name: str) -> jobs.Job:
        """A job as it stands."""
        return await self._driver.run(self._work.call("JobService.GetJob", job_service.GetJobRequest(name=name)))

    async def list_jobs(self, *, states: Iterable[str] = (), limit: int | None = None) -> list[jobs.Job]:
        """Jobs, newest first; only those in these states (``queued``, ``running``, ``succeeded``, ``failed``, ``cancelled``)."""
        return await self._driver.run(self._work.list_jobs(states, limit))

    async def cancel_job(self, name: str) -> jobs.Job:
        """Ends a job."""
        return await self._driver.run(self._work.call("JobService.CancelJob", job_service.CancelJobRequest(name=name)))

    async def upload(
        self, source: str | os.PathLike[str] | bytes, *, display_name: str | None = None
    ) -> artifacts.Artifact:
        """Sends a file, or bytes."""
        return await self._driver.run(self._work.upload(source, display_name))

    async def download(self, artifact: str, path: str | os.PathLike[str]) -> artifacts.Artifact:
        """Fetches an artifact into a file, whole or not at all."""
        return await self._driver.run(self._work.download(artifact, path))

    async def delete_artifact(self, name: str) -> None:
        """Deletes an artifact."""
        await self._driver.run(
            self._work.call("ArtifactService.DeleteArtifact", artifacts.DeleteArtifactRequest(name=name))
        )

    async def list_keys(self) -> list[keys.Key]:
        """Keys, newest first."""
        return await self._driver.run(self._work.list_keys())

    async def get_key(self, name: str) -> keys.Key:
        """A key, without its secret."""
        return await self._driver.run(self._work.call("KeyService.GetKey", keys.GetKeyRequest(name=name)))

    async def create_owner(self, display_name: str, *, request_id: str | None = None) -> registry.Owner:
        """Registers an owner of originals."""
        return await self._driver.run(self._work.create_owner(display_name, request_id))

    async def list_owners(self) -> list[registry.Owner]:
        """Owners, newest first."""
        return await self._driver.run(self._work.list_owners())

    async def create_asset(
        self,
        original: FileOrArtifact,
        *,
        owner: str,
        key: str,
        display_name: str | None = None,
        request_id: str | None = None,
    ) -> registry.Asset:
        """Registers an original of an owner, to be marked with a key of 64 bits; it is sent and only its hash is kept."""
        return await self._driver.run(self._work.create_asset(original, owner, key, display_name, request_id))

    async def list_assets(self, *, owner: str | None = None, key: str | None = None) -> list[registry.Asset]:
        """Assets, newest first; only those of an owner, or of a key."""
        return await self._driver.run(self._work.assets(owner, key))

    async def list_commitments(self) -> list[registry.Commitment]:
        """What was signed of assets, in the order of the chain."""
        return await self._driver.run(self._work.commitments())

    async def public_key(self) -> registry.PublicKey:
        """What signatures of commitments are checked with."""
        return await self._driver.run(self._work.call("RegistryService.GetPublicKey", registry.GetPublicKeyRequest()))
