// Files, to the server and from it, in parts: a connection that breaks off costs what was on its way, and no more.
import { bytesToHex, sha256 } from "./vendor/api.js";
import { artifacts, patiently, SOON } from "./calls.js";
import { Mistake, reason } from "./errors.js";

/** The most that the server takes at once. */
const PART = 1 << 20;
/** Parts of a download are put together so many bytes at a time, so that the browser can have them on disk. */
const HEAP = 16 << 20;
/** An upload that begins again so often never ends. */
const SETBACKS = 8;

async function part(file, at) {
    return new Uint8Array(await file.slice(at, at + PART).arrayBuffer());
}

async function digest(file, { progress, signal }) {
    const hash = sha256.create();
    for (let at = 0; at < file.size; at += PART) {
        signal?.throwIfAborted();
        hash.update(await part(file, at));
        progress("Reading the file", at / file.size);
    }
    return bytesToHex(hash.digest());
}

/**
 * Sends a file, and gives its artifact. `progress` is told what is being done and the share that is done, `note` what is
 * waited for.
 */
export async function upload(file, options) {
    const { progress, signal } = options;
    if (file.size === 0) throw new Mistake(`${file.name} is empty.`, "Choose another file.");
    const metadata = { displayName: file.name, sizeBytes: BigInt(file.size), sha256: await digest(file, options) };
    const call = { signal, timeoutMs: SOON };
    const begun = await patiently(() => artifacts.startUpload({ metadata, inParts: true }, call), options);
    let [at, setbacks] = [0, 0];
    for (;;) {
        if (at < file.size) {
            const chunk = await part(file, at);
            const next = { upload: begun.upload, offset: BigInt(at), chunk };
            const answer = await patiently(() => artifacts.appendUpload(next, call), options);
            const received = Number(answer.receivedBytes);
            if (received <= at && ++setbacks > SETBACKS) {
                throw new Mistake(
                    "The upload begins again and again.",
                    "If several servers are behind this address, all calls of a browser must reach the same one.",
                );
            }
            at = received;
            progress("Sending", at / file.size);
            continue;
        }
        try {
            // It takes as long as the store needs.
            return await patiently(() => artifacts.finishUpload({ upload: begun.upload }, { signal }), options);
        } catch (error) {
            // A server that began anew knows nothing of what had arrived.
            if (reason(error) !== "INVALID_FIELD" || ++setbacks > SETBACKS) throw error;
            const asked = { upload: begun.upload, offset: 0n };
            const there = await patiently(() => artifacts.appendUpload(asked, call), options);
            if (Number(there.receivedBytes) >= file.size) throw error;
            at = Number(there.receivedBytes);
        }
    }
}

/** Fetches an artifact, and gives it as a file that was found to be right. */
export async function download(name, options = {}) {
    const { progress = () => {}, signal } = options;
    const hash = sha256.create();
    const heaps = [];
    let [heap, waiting, at, artifact] = [[], 0, 0, null];
    await patiently(async (there) => {
        const call = { signal, onHeader: there };
        const stream = artifacts.downloadArtifact({ name, offset: BigInt(at) }, call);
        for await (const { payload } of stream) {
            if (payload.case === "artifact") artifact = payload.value;
            if (payload.case !== "chunk") continue;
            hash.update(payload.value);
            heap.push(payload.value);
            at += payload.value.length;
            waiting += payload.value.length;
            if (waiting >= HEAP) {
                heaps.push(new Blob(heap));
                [heap, waiting] = [[], 0];
            }
            progress("Fetching", at / Number(artifact.sizeBytes));
        }
    }, options);
    if (bytesToHex(hash.digest()) !== artifact.sha256) {
        throw new Mistake(`${artifact.displayName} arrived damaged.`, "Fetch it again.");
    }
    return new File([...heaps, ...heap], artifact.displayName);
}
