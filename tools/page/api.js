// What the page's modules take from packages to talk to the server: bundled into server/page/vendor/api.js.
export { Code, ConnectError, createClient } from "@connectrpc/connect";
export { createGrpcWebTransport } from "@connectrpc/connect-web";
export { sha256 } from "@noble/hashes/sha2.js";
export { bytesToHex } from "@noble/hashes/utils.js";
export { ErrorInfoSchema, RetryInfoSchema } from "./generated/google/rpc/error_details_pb.js";
export { ArtifactService } from "./generated/guardsplat/v1/artifact_service_pb.js";
export {
    EmbedSpec_Preset as Preset,
    Failure_Reason as Reason,
    Job_State as State,
    Progress_Stage as Stage,
    VerifyResult_Verdict as Verdict,
} from "./generated/guardsplat/v1/job_pb.js";
export { JobAttempt_Outcome as Outcome, JobService } from "./generated/guardsplat/v1/job_service_pb.js";
export { Key_State as KeyState, KeyService } from "./generated/guardsplat/v1/key_service_pb.js";
export { RegistryService } from "./generated/guardsplat/v1/registry_service_pb.js";
