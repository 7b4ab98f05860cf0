// What went wrong, in words: what it is, and what to do about it.
import { Code, ConnectError, ErrorInfoSchema, RetryInfoSchema } from "./vendor/api.js";

/** By the reason that the server gives. */
const TODO = {
    TOKEN_MISSING: "Sign in again.",
    TOKEN_UNKNOWN: "Look whether all of the token was copied. Whoever looks after this server can make another.",
    TOKEN_EXPIRED: "Ask whoever looks after this server for a new token, and sign in with it.",
    TOKEN_REVOKED: "Ask whoever looks after this server for a new token, and sign in with it.",
    QUEUE_FULL: "Try again in a few minutes. What was sent is there, and is not sent again.",
    QUOTA_USED_UP: "Wait until jobs of your project are done, or delete artifacts that are not needed.",
    TOO_MANY_CALLS: "Wait a little, then try again.",
    TOO_MANY_TRANSFERS: "Wait until other uploads and downloads are done, or close other tabs.",
    TOO_MANY_WATCHES: "Close other tabs that follow jobs.",
    NO_SPACE: "Tell whoever looks after this server that its disk is full.",
    SCENE_DOES_NOT_FIT: "Mark a smaller scene, or ask for a higher limit (max_job_memory_mebibytes).",
    KEY_NOT_ACTIVE: "Choose another key.",
    KEY_REVOKED: "Choose another key.",
    PAYLOADS_USED_UP: "Make another key of 64 bits.",
    ARTIFACT_IN_USE: "Wait until the job is done.",
    NOT_FOUND: "It may have been deleted, or belongs to another project.",
    INTERNAL: "Tell whoever looks after this server; its log has the cause.",
};

/** Words for scopes that a token may lack. */
const SCOPES = {
    embed: "marking scenes",
    verify: "verifying",
    admin: "what only admins of the project may do",
    worker: "workers",
};

/** A mistake that the page itself finds. */
export class Mistake extends Error {
    constructor(what, todo = "") {
        super(what);
        this.todo = todo;
    }
}

/** The reason that the server gives, or an empty text. */
export function reason(error) {
    return info(error)?.reason ?? "";
}

/** Whether the server can't be reached, or is about to be back. */
export function isAway(error) {
    if (!(error instanceof ConnectError)) return false;
    const lost = error.cause instanceof TypeError || error.cause?.name === "NetworkError";
    return lost || error.code === Code.Unavailable || error.code === Code.DeadlineExceeded;
}

/** Whether the same call may do in a while. */
export function isTemporary(error) {
    return isAway(error) || ["TOO_MANY_CALLS", "TOO_MANY_TRANSFERS", "TOO_MANY_WATCHES"].includes(reason(error));
}

/** When the server says that it can be tried again, in milliseconds. */
export function pauseOf(error) {
    const retry = error instanceof ConnectError ? error.findDetails(RetryInfoSchema)[0]?.retryDelay : undefined;
    return retry ? Number(retry.seconds) * 1000 + retry.nanos / 1e6 : 0;
}

/** Whether the token is not good any more. */
export function isSignedOut(error) {
    return error instanceof ConnectError && error.code === Code.Unauthenticated;
}

/** What happened, and what to do. */
export function explain(error) {
    if (error instanceof Mistake) return { what: error.message, todo: error.todo };
    if (error?.name === "AbortError") return { what: "Stopped.", todo: "" };
    if (error?.name === "NotReadableError" || error?.name === "NotFoundError") {
        return { what: "The file can't be read.", todo: "It may have been moved or changed: choose it again." };
    }
    if (!(error instanceof ConnectError)) return { what: `${error?.message ?? error}`, todo: "" };
    if (error.cause?.name === "AbortError" || error.code === Code.Canceled) return { what: "Stopped.", todo: "" };
    if (isAway(error)) {
        return {
            what: "The server can't be reached.",
            todo: "Look whether you are online. Jobs go on without this page, and are under Jobs when the server is back.",
        };
    }
    const why = info(error);
    if (why?.reason === "SCOPE_MISSING") {
        const scopes = (why.metadata.scopes ?? "").split(",").map((scope) => SCOPES[scope] ?? scope);
        return {
            what: `This token is not for that: ${error.rawMessage}.`,
            todo: `Ask whoever looks after this server for a token that is good for ${scopes.join(" or ")}.`,
        };
    }
    return { what: sentence(error.rawMessage), todo: TODO[why?.reason] ?? "" };
}

function info(error) {
    return error instanceof ConnectError ? error.findDetails(ErrorInfoSchema)[0] : undefined;
}

/** Fields have names of the API that mean nothing here. */
function sentence(text) {
    const plain = text
        .replaceAll(/(^|; )job\.(embed|verify|create_key)\./g, "$1")
        .replaceAll(/(^|; )metadata\.size_bytes: /g, "$1the file: ");
    const end = /[.!?]$/.test(plain) ? "" : ".";
    return plain.charAt(0).toUpperCase() + plain.slice(1) + end;
}
