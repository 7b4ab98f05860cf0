import datetime

from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Job(_message.Message):
    __slots__ = ("name", "display_name", "embed", "verify", "create_key", "state", "cancel_requested", "attempt", "max_attempts", "queue_position", "progress", "embed_result", "verify_result", "key_result", "failure", "create_time", "update_time", "start_time", "end_time", "retry_time", "priority", "waiting_reason")
    class State(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATE_UNSPECIFIED: _ClassVar[Job.State]
        STATE_QUEUED: _ClassVar[Job.State]
        STATE_RUNNING: _ClassVar[Job.State]
        STATE_SUCCEEDED: _ClassVar[Job.State]
        STATE_FAILED: _ClassVar[Job.State]
        STATE_CANCELLED: _ClassVar[Job.State]
    STATE_UNSPECIFIED: Job.State
    STATE_QUEUED: Job.State
    STATE_RUNNING: Job.State
    STATE_SUCCEEDED: Job.State
    STATE_FAILED: Job.State
    STATE_CANCELLED: Job.State
    NAME_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    EMBED_FIELD_NUMBER: _ClassVar[int]
    VERIFY_FIELD_NUMBER: _ClassVar[int]
    CREATE_KEY_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    CANCEL_REQUESTED_FIELD_NUMBER: _ClassVar[int]
    ATTEMPT_FIELD_NUMBER: _ClassVar[int]
    MAX_ATTEMPTS_FIELD_NUMBER: _ClassVar[int]
    QUEUE_POSITION_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    EMBED_RESULT_FIELD_NUMBER: _ClassVar[int]
    VERIFY_RESULT_FIELD_NUMBER: _ClassVar[int]
    KEY_RESULT_FIELD_NUMBER: _ClassVar[int]
    FAILURE_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    UPDATE_TIME_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    END_TIME_FIELD_NUMBER: _ClassVar[int]
    RETRY_TIME_FIELD_NUMBER: _ClassVar[int]
    PRIORITY_FIELD_NUMBER: _ClassVar[int]
    WAITING_REASON_FIELD_NUMBER: _ClassVar[int]
    name: str
    display_name: str
    embed: EmbedSpec
    verify: VerifySpec
    create_key: KeySpec
    state: Job.State
    cancel_requested: bool
    attempt: int
    max_attempts: int
    queue_position: int
    progress: Progress
    embed_result: EmbedResult
    verify_result: VerifyResult
    key_result: KeyResult
    failure: Failure
    create_time: _timestamp_pb2.Timestamp
    update_time: _timestamp_pb2.Timestamp
    start_time: _timestamp_pb2.Timestamp
    end_time: _timestamp_pb2.Timestamp
    retry_time: _timestamp_pb2.Timestamp
    priority: int
    waiting_reason: str
    def __init__(self, name: _Optional[str] = ..., display_name: _Optional[str] = ..., embed: _Optional[_Union[EmbedSpec, _Mapping]] = ..., verify: _Optional[_Union[VerifySpec, _Mapping]] = ..., create_key: _Optional[_Union[KeySpec, _Mapping]] = ..., state: _Optional[_Union[Job.State, str]] = ..., cancel_requested: bool = ..., attempt: _Optional[int] = ..., max_attempts: _Optional[int] = ..., queue_position: _Optional[int] = ..., progress: _Optional[_Union[Progress, _Mapping]] = ..., embed_result: _Optional[_Union[EmbedResult, _Mapping]] = ..., verify_result: _Optional[_Union[VerifyResult, _Mapping]] = ..., key_result: _Optional[_Union[KeyResult, _Mapping]] = ..., failure: _Optional[_Union[Failure, _Mapping]] = ..., create_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., update_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., start_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., retry_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., priority: _Optional[int] = ..., waiting_reason: _Optional[str] = ...) -> None: ...

class EmbedSpec(_message.Message):
    __slots__ = ("scene", "key", "message", "preset", "seed", "size", "force", "ignore_bad_rows", "asset", "robust_to", "cameras", "scene_kind", "credentials")
    class Preset(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        PRESET_UNSPECIFIED: _ClassVar[EmbedSpec.Preset]
        PRESET_DRAFT: _ClassVar[EmbedSpec.Preset]
        PRESET_STANDARD: _ClassVar[EmbedSpec.Preset]
        PRESET_PAPER: _ClassVar[EmbedSpec.Preset]
        PRESET_THOROUGH: _ClassVar[EmbedSpec.Preset]
        PRESET_ROBUST: _ClassVar[EmbedSpec.Preset]
    PRESET_UNSPECIFIED: EmbedSpec.Preset
    PRESET_DRAFT: EmbedSpec.Preset
    PRESET_STANDARD: EmbedSpec.Preset
    PRESET_PAPER: EmbedSpec.Preset
    PRESET_THOROUGH: EmbedSpec.Preset
    PRESET_ROBUST: EmbedSpec.Preset
    class Distortion(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        DISTORTION_UNSPECIFIED: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_CROP: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_SCALING: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_ROTATION: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_BRIGHTNESS: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_CONTRAST: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_JPEG: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_NOISE: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_BLUR: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_MASK: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_EIGHT_BIT: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_COMBINED: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_SH_NOISE: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_SH_TRUNCATION: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_SPZ: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_SOG: _ClassVar[EmbedSpec.Distortion]
        DISTORTION_PRUNING: _ClassVar[EmbedSpec.Distortion]
    DISTORTION_UNSPECIFIED: EmbedSpec.Distortion
    DISTORTION_CROP: EmbedSpec.Distortion
    DISTORTION_SCALING: EmbedSpec.Distortion
    DISTORTION_ROTATION: EmbedSpec.Distortion
    DISTORTION_BRIGHTNESS: EmbedSpec.Distortion
    DISTORTION_CONTRAST: EmbedSpec.Distortion
    DISTORTION_JPEG: EmbedSpec.Distortion
    DISTORTION_NOISE: EmbedSpec.Distortion
    DISTORTION_BLUR: EmbedSpec.Distortion
    DISTORTION_MASK: EmbedSpec.Distortion
    DISTORTION_EIGHT_BIT: EmbedSpec.Distortion
    DISTORTION_COMBINED: EmbedSpec.Distortion
    DISTORTION_SH_NOISE: EmbedSpec.Distortion
    DISTORTION_SH_TRUNCATION: EmbedSpec.Distortion
    DISTORTION_SPZ: EmbedSpec.Distortion
    DISTORTION_SOG: EmbedSpec.Distortion
    DISTORTION_PRUNING: EmbedSpec.Distortion
    class SceneKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        SCENE_KIND_UNSPECIFIED: _ClassVar[EmbedSpec.SceneKind]
        SCENE_KIND_OBJECT: _ClassVar[EmbedSpec.SceneKind]
        SCENE_KIND_ROOM: _ClassVar[EmbedSpec.SceneKind]
        SCENE_KIND_TERRAIN: _ClassVar[EmbedSpec.SceneKind]
        SCENE_KIND_FORWARD: _ClassVar[EmbedSpec.SceneKind]
        SCENE_KIND_UNBOUNDED: _ClassVar[EmbedSpec.SceneKind]
    SCENE_KIND_UNSPECIFIED: EmbedSpec.SceneKind
    SCENE_KIND_OBJECT: EmbedSpec.SceneKind
    SCENE_KIND_ROOM: EmbedSpec.SceneKind
    SCENE_KIND_TERRAIN: EmbedSpec.SceneKind
    SCENE_KIND_FORWARD: EmbedSpec.SceneKind
    SCENE_KIND_UNBOUNDED: EmbedSpec.SceneKind
    SCENE_FIELD_NUMBER: _ClassVar[int]
    KEY_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    PRESET_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    FORCE_FIELD_NUMBER: _ClassVar[int]
    IGNORE_BAD_ROWS_FIELD_NUMBER: _ClassVar[int]
    ASSET_FIELD_NUMBER: _ClassVar[int]
    ROBUST_TO_FIELD_NUMBER: _ClassVar[int]
    CAMERAS_FIELD_NUMBER: _ClassVar[int]
    SCENE_KIND_FIELD_NUMBER: _ClassVar[int]
    CREDENTIALS_FIELD_NUMBER: _ClassVar[int]
    scene: str
    key: str
    message: str
    preset: EmbedSpec.Preset
    seed: int
    size: int
    force: bool
    ignore_bad_rows: bool
    asset: str
    robust_to: _containers.RepeatedScalarFieldContainer[EmbedSpec.Distortion]
    cameras: str
    scene_kind: EmbedSpec.SceneKind
    credentials: bool
    def __init__(self, scene: _Optional[str] = ..., key: _Optional[str] = ..., message: _Optional[str] = ..., preset: _Optional[_Union[EmbedSpec.Preset, str]] = ..., seed: _Optional[int] = ..., size: _Optional[int] = ..., force: bool = ..., ignore_bad_rows: bool = ..., asset: _Optional[str] = ..., robust_to: _Optional[_Iterable[_Union[EmbedSpec.Distortion, str]]] = ..., cameras: _Optional[str] = ..., scene_kind: _Optional[_Union[EmbedSpec.SceneKind, str]] = ..., credentials: bool = ...) -> None: ...

class VerifySpec(_message.Message):
    __slots__ = ("suspects", "key", "message", "views", "size", "seed", "ignore_bad_rows", "asset", "owner", "search", "cameras", "scene_kind", "original")
    SUSPECTS_FIELD_NUMBER: _ClassVar[int]
    KEY_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    IGNORE_BAD_ROWS_FIELD_NUMBER: _ClassVar[int]
    ASSET_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    SEARCH_FIELD_NUMBER: _ClassVar[int]
    CAMERAS_FIELD_NUMBER: _ClassVar[int]
    SCENE_KIND_FIELD_NUMBER: _ClassVar[int]
    ORIGINAL_FIELD_NUMBER: _ClassVar[int]
    suspects: _containers.RepeatedScalarFieldContainer[str]
    key: str
    message: str
    views: int
    size: int
    seed: int
    ignore_bad_rows: bool
    asset: str
    owner: str
    search: bool
    cameras: str
    scene_kind: EmbedSpec.SceneKind
    original: str
    def __init__(self, suspects: _Optional[_Iterable[str]] = ..., key: _Optional[str] = ..., message: _Optional[str] = ..., views: _Optional[int] = ..., size: _Optional[int] = ..., seed: _Optional[int] = ..., ignore_bad_rows: bool = ..., asset: _Optional[str] = ..., owner: _Optional[str] = ..., search: bool = ..., cameras: _Optional[str] = ..., scene_kind: _Optional[_Union[EmbedSpec.SceneKind, str]] = ..., original: _Optional[str] = ...) -> None: ...

class KeySpec(_message.Message):
    __slots__ = ("bits", "seed", "seeded")
    BITS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SEEDED_FIELD_NUMBER: _ClassVar[int]
    bits: int
    seed: int
    seeded: bool
    def __init__(self, bits: _Optional[int] = ..., seed: _Optional[int] = ..., seeded: bool = ...) -> None: ...

class Progress(_message.Message):
    __slots__ = ("stage", "done", "total", "bit_accuracy", "psnr_db")
    class Stage(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STAGE_UNSPECIFIED: _ClassVar[Progress.Stage]
        STAGE_PREPARING: _ClassVar[Progress.Stage]
        STAGE_OPTIMISING: _ClassVar[Progress.Stage]
        STAGE_READING: _ClassVar[Progress.Stage]
        STAGE_STORING: _ClassVar[Progress.Stage]
    STAGE_UNSPECIFIED: Progress.Stage
    STAGE_PREPARING: Progress.Stage
    STAGE_OPTIMISING: Progress.Stage
    STAGE_READING: Progress.Stage
    STAGE_STORING: Progress.Stage
    STAGE_FIELD_NUMBER: _ClassVar[int]
    DONE_FIELD_NUMBER: _ClassVar[int]
    TOTAL_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_FIELD_NUMBER: _ClassVar[int]
    PSNR_DB_FIELD_NUMBER: _ClassVar[int]
    stage: Progress.Stage
    done: int
    total: int
    bit_accuracy: float
    psnr_db: float
    def __init__(self, stage: _Optional[_Union[Progress.Stage, str]] = ..., done: _Optional[int] = ..., total: _Optional[int] = ..., bit_accuracy: _Optional[float] = ..., psnr_db: _Optional[float] = ...) -> None: ...

class EmbedResult(_message.Message):
    __slots__ = ("scene", "comparison", "bit_accuracy", "bit_accuracy_worst_view", "message", "message_recovered", "psnr_db", "ssim", "lpips", "steps", "view_steps", "duration", "device", "clip", "target_missed", "gaussians", "changed_gaussians", "ignored_rows", "evidence_html", "evidence_json", "psnr_covered_db", "covered", "credentials")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    COMPARISON_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_WORST_VIEW_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_RECOVERED_FIELD_NUMBER: _ClassVar[int]
    PSNR_DB_FIELD_NUMBER: _ClassVar[int]
    SSIM_FIELD_NUMBER: _ClassVar[int]
    LPIPS_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    VIEW_STEPS_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    CLIP_FIELD_NUMBER: _ClassVar[int]
    TARGET_MISSED_FIELD_NUMBER: _ClassVar[int]
    GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    CHANGED_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    IGNORED_ROWS_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_HTML_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_JSON_FIELD_NUMBER: _ClassVar[int]
    PSNR_COVERED_DB_FIELD_NUMBER: _ClassVar[int]
    COVERED_FIELD_NUMBER: _ClassVar[int]
    CREDENTIALS_FIELD_NUMBER: _ClassVar[int]
    scene: str
    comparison: str
    bit_accuracy: float
    bit_accuracy_worst_view: float
    message: str
    message_recovered: bool
    psnr_db: float
    ssim: float
    lpips: float
    steps: int
    view_steps: int
    duration: _duration_pb2.Duration
    device: str
    clip: str
    target_missed: _containers.RepeatedScalarFieldContainer[str]
    gaussians: int
    changed_gaussians: int
    ignored_rows: int
    evidence_html: str
    evidence_json: str
    psnr_covered_db: float
    covered: float
    credentials: Credentials
    def __init__(self, scene: _Optional[str] = ..., comparison: _Optional[str] = ..., bit_accuracy: _Optional[float] = ..., bit_accuracy_worst_view: _Optional[float] = ..., message: _Optional[str] = ..., message_recovered: bool = ..., psnr_db: _Optional[float] = ..., ssim: _Optional[float] = ..., lpips: _Optional[float] = ..., steps: _Optional[int] = ..., view_steps: _Optional[int] = ..., duration: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., device: _Optional[str] = ..., clip: _Optional[str] = ..., target_missed: _Optional[_Iterable[str]] = ..., gaussians: _Optional[int] = ..., changed_gaussians: _Optional[int] = ..., ignored_rows: _Optional[int] = ..., evidence_html: _Optional[str] = ..., evidence_json: _Optional[str] = ..., psnr_covered_db: _Optional[float] = ..., covered: _Optional[float] = ..., credentials: _Optional[_Union[Credentials, _Mapping]] = ...) -> None: ...

class Credentials(_message.Message):
    __slots__ = ("artifact", "manifest", "soft_binding", "test_certificate", "job")
    ARTIFACT_FIELD_NUMBER: _ClassVar[int]
    MANIFEST_FIELD_NUMBER: _ClassVar[int]
    SOFT_BINDING_FIELD_NUMBER: _ClassVar[int]
    TEST_CERTIFICATE_FIELD_NUMBER: _ClassVar[int]
    JOB_FIELD_NUMBER: _ClassVar[int]
    artifact: str
    manifest: str
    soft_binding: str
    test_certificate: bool
    job: str
    def __init__(self, artifact: _Optional[str] = ..., manifest: _Optional[str] = ..., soft_binding: _Optional[str] = ..., test_certificate: bool = ..., job: _Optional[str] = ...) -> None: ...

class VerifyResult(_message.Message):
    __slots__ = ("verdict", "p_value", "threshold", "matched_bits", "needed_bits", "bits", "views", "message", "bit_accuracy", "bit_accuracy_worst_view", "mean_abs_logit", "view_agreement", "reason", "duration", "device", "clip", "ignored_rows", "hypotheses", "framings", "assets", "framing", "asset", "owner", "payload_number", "corrected_bits", "evidence_html", "evidence_json", "assets_paid", "readings_paid", "first_seen_time", "asset_commit_time", "asset_registered_later", "redacted", "credentials", "rank_sum", "needed_rank_sum", "explained_by_original")
    class Verdict(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        VERDICT_UNSPECIFIED: _ClassVar[VerifyResult.Verdict]
        VERDICT_MATCH: _ClassVar[VerifyResult.Verdict]
        VERDICT_NO_MATCH: _ClassVar[VerifyResult.Verdict]
        VERDICT_INCONCLUSIVE: _ClassVar[VerifyResult.Verdict]
        VERDICT_UNKNOWN_KEY: _ClassVar[VerifyResult.Verdict]
    VERDICT_UNSPECIFIED: VerifyResult.Verdict
    VERDICT_MATCH: VerifyResult.Verdict
    VERDICT_NO_MATCH: VerifyResult.Verdict
    VERDICT_INCONCLUSIVE: VerifyResult.Verdict
    VERDICT_UNKNOWN_KEY: VerifyResult.Verdict
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    P_VALUE_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    MATCHED_BITS_FIELD_NUMBER: _ClassVar[int]
    NEEDED_BITS_FIELD_NUMBER: _ClassVar[int]
    BITS_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_WORST_VIEW_FIELD_NUMBER: _ClassVar[int]
    MEAN_ABS_LOGIT_FIELD_NUMBER: _ClassVar[int]
    VIEW_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    CLIP_FIELD_NUMBER: _ClassVar[int]
    IGNORED_ROWS_FIELD_NUMBER: _ClassVar[int]
    HYPOTHESES_FIELD_NUMBER: _ClassVar[int]
    FRAMINGS_FIELD_NUMBER: _ClassVar[int]
    ASSETS_FIELD_NUMBER: _ClassVar[int]
    FRAMING_FIELD_NUMBER: _ClassVar[int]
    ASSET_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_NUMBER_FIELD_NUMBER: _ClassVar[int]
    CORRECTED_BITS_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_HTML_FIELD_NUMBER: _ClassVar[int]
    EVIDENCE_JSON_FIELD_NUMBER: _ClassVar[int]
    ASSETS_PAID_FIELD_NUMBER: _ClassVar[int]
    READINGS_PAID_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEEN_TIME_FIELD_NUMBER: _ClassVar[int]
    ASSET_COMMIT_TIME_FIELD_NUMBER: _ClassVar[int]
    ASSET_REGISTERED_LATER_FIELD_NUMBER: _ClassVar[int]
    REDACTED_FIELD_NUMBER: _ClassVar[int]
    CREDENTIALS_FIELD_NUMBER: _ClassVar[int]
    RANK_SUM_FIELD_NUMBER: _ClassVar[int]
    NEEDED_RANK_SUM_FIELD_NUMBER: _ClassVar[int]
    EXPLAINED_BY_ORIGINAL_FIELD_NUMBER: _ClassVar[int]
    verdict: VerifyResult.Verdict
    p_value: float
    threshold: float
    matched_bits: int
    needed_bits: int
    bits: int
    views: int
    message: str
    bit_accuracy: float
    bit_accuracy_worst_view: float
    mean_abs_logit: float
    view_agreement: float
    reason: str
    duration: _duration_pb2.Duration
    device: str
    clip: str
    ignored_rows: int
    hypotheses: int
    framings: int
    assets: int
    framing: str
    asset: str
    owner: str
    payload_number: int
    corrected_bits: int
    evidence_html: str
    evidence_json: str
    assets_paid: int
    readings_paid: int
    first_seen_time: _timestamp_pb2.Timestamp
    asset_commit_time: _timestamp_pb2.Timestamp
    asset_registered_later: bool
    redacted: bool
    credentials: _containers.RepeatedCompositeFieldContainer[Credentials]
    rank_sum: int
    needed_rank_sum: int
    explained_by_original: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, verdict: _Optional[_Union[VerifyResult.Verdict, str]] = ..., p_value: _Optional[float] = ..., threshold: _Optional[float] = ..., matched_bits: _Optional[int] = ..., needed_bits: _Optional[int] = ..., bits: _Optional[int] = ..., views: _Optional[int] = ..., message: _Optional[str] = ..., bit_accuracy: _Optional[float] = ..., bit_accuracy_worst_view: _Optional[float] = ..., mean_abs_logit: _Optional[float] = ..., view_agreement: _Optional[float] = ..., reason: _Optional[str] = ..., duration: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., device: _Optional[str] = ..., clip: _Optional[str] = ..., ignored_rows: _Optional[int] = ..., hypotheses: _Optional[int] = ..., framings: _Optional[int] = ..., assets: _Optional[int] = ..., framing: _Optional[str] = ..., asset: _Optional[str] = ..., owner: _Optional[str] = ..., payload_number: _Optional[int] = ..., corrected_bits: _Optional[int] = ..., evidence_html: _Optional[str] = ..., evidence_json: _Optional[str] = ..., assets_paid: _Optional[int] = ..., readings_paid: _Optional[int] = ..., first_seen_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., asset_commit_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., asset_registered_later: bool = ..., redacted: bool = ..., credentials: _Optional[_Iterable[_Union[Credentials, _Mapping]]] = ..., rank_sum: _Optional[int] = ..., needed_rank_sum: _Optional[int] = ..., explained_by_original: _Optional[_Iterable[float]] = ...) -> None: ...

class KeyResult(_message.Message):
    __slots__ = ("key", "bit_accuracy_unseen", "bit_accuracy_unseen_noisy", "duration", "device")
    KEY_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_UNSEEN_FIELD_NUMBER: _ClassVar[int]
    BIT_ACCURACY_UNSEEN_NOISY_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    key: str
    bit_accuracy_unseen: float
    bit_accuracy_unseen_noisy: float
    duration: _duration_pb2.Duration
    device: str
    def __init__(self, key: _Optional[str] = ..., bit_accuracy_unseen: _Optional[float] = ..., bit_accuracy_unseen_noisy: _Optional[float] = ..., duration: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., device: _Optional[str] = ...) -> None: ...

class Failure(_message.Message):
    __slots__ = ("reason", "message")
    class Reason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        REASON_UNSPECIFIED: _ClassVar[Failure.Reason]
        REASON_INVALID_INPUT: _ClassVar[Failure.Reason]
        REASON_TARGET_MISSED: _ClassVar[Failure.Reason]
        REASON_WORKER_LOST: _ClassVar[Failure.Reason]
        REASON_INTERNAL: _ClassVar[Failure.Reason]
        REASON_ATTEMPTS_EXHAUSTED: _ClassVar[Failure.Reason]
    REASON_UNSPECIFIED: Failure.Reason
    REASON_INVALID_INPUT: Failure.Reason
    REASON_TARGET_MISSED: Failure.Reason
    REASON_WORKER_LOST: Failure.Reason
    REASON_INTERNAL: Failure.Reason
    REASON_ATTEMPTS_EXHAUSTED: Failure.Reason
    REASON_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    reason: Failure.Reason
    message: str
    def __init__(self, reason: _Optional[_Union[Failure.Reason, str]] = ..., message: _Optional[str] = ...) -> None: ...
