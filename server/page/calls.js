// Calls of the API as gRPC-Web, with the token of whoever is signed in, and patience for a server that goes away.
import {
    ArtifactService,
    createClient,
    createGrpcWebTransport,
    JobService,
    KeyService,
    RegistryService,
} from "./vendor/api.js";
import { announce } from "./elements.js";
import { explain, isTemporary, pauseOf } from "./errors.js";
import { token } from "./session.js";

const authorize = (next) => (request) => {
    const shown = token();
    if (shown) request.header.set("authorization", `Bearer ${shown}`);
    return next(request);
};
const transport = createGrpcWebTransport({ baseUrl: location.origin, interceptors: [authorize] });

export const artifacts = createClient(ArtifactService, transport);
export const jobs = createClient(JobService, transport);
export const keys = createClient(KeyService, transport);
export const registry = createClient(RegistryService, transport);

/** How long a call may take that is not a stream, in milliseconds. */
export const SOON = 30_000;
/** What is not there after so long is given up. */
const GIVE_UP = 15 * 60_000;

/** A UUID; `crypto.randomUUID` is not there without TLS. */
export function uuid() {
    const bytes = crypto.getRandomValues(new Uint8Array(16));
    bytes[6] = (bytes[6] & 15) | 64;
    bytes[8] = (bytes[8] & 63) | 128;
    const hex = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
    return hex.replace(/^(.{8})(.{4})(.{4})(.{4})/, "$1-$2-$3-$4-");
}

/** Waits, or until the network is back; throws when `signal` says stop. */
function rest(milliseconds, signal) {
    return new Promise((resolve, reject) => {
        const done = () => {
            clearTimeout(timer);
            removeEventListener("online", done);
            signal?.removeEventListener("abort", stop);
            resolve();
        };
        const stop = () => {
            done();
            reject(signal.reason);
        };
        const timer = setTimeout(done, milliseconds);
        addEventListener("online", done);
        if (signal?.aborted) stop();
        else signal?.addEventListener("abort", stop);
    });
}

/**
 * Does something again for as long as its failure is one that passes. `call` must be good for being made twice; a stream
 * says by what it is given that the server is there. `note` is told what is waited for, and null when it goes on.
 */
export async function patiently(call, { signal, note = () => {} } = {}) {
    let [pause, begun] = [500, performance.now()];
    const there = () => {
        if (pause > 500) note(null);
        [pause, begun] = [500, performance.now()];
    };
    for (;;) {
        try {
            const answer = await call(there);
            there();
            return answer;
        } catch (error) {
            signal?.throwIfAborted();
            if (!isTemporary(error) || performance.now() - begun > GIVE_UP) throw error;
            if (pause === 500) announce(explain(error).what);
            note(`${explain(error).what} Trying again.`);
            await rest(Math.max(pause, pauseOf(error)), signal);
            pause = Math.min(2 * pause, 10_000);
        }
    }
}

/** All of a list that comes in pages, at most `most`. */
export async function all(page, field, most = 2000) {
    const items = [];
    let pageToken = "";
    do {
        const answer = await patiently(() => page({ pageSize: 500, pageToken }));
        items.push(...answer[field]);
        pageToken = answer.nextPageToken;
    } while (pageToken && items.length < most);
    return items;
}
