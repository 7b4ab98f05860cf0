// One job: made once, followed to its end, through lost connections and servers that begin anew.
import { Reason, Stage, State } from "./vendor/api.js";
import { jobs, patiently, SOON, uuid } from "./calls.js";
import { announce, element } from "./elements.js";
import { Mistake } from "./errors.js";

const STAGES = {
    [Stage.PREPARING]: "Preparing",
    [Stage.OPTIMISING]: "Working on the colours",
    [Stage.READING]: "Reading pictures",
    [Stage.STORING]: "Storing",
};

const TODO = {
    [Reason.INVALID_INPUT]: "Look at the file and what was asked for, and try another.",
    [Reason.TARGET_MISSED]: "Try the preset thorough, or another key.",
    [Reason.WORKER_LOST]: "Try again. Where it happens again, tell whoever looks after this server.",
    [Reason.INTERNAL]: "Tell whoever looks after this server.",
    [Reason.ATTEMPTS_EXHAUSTED]: "Tell whoever looks after this server.",
};

/** Whether nothing of a job changes any more. */
export const isOver = (job) => [State.SUCCEEDED, State.FAILED, State.CANCELLED].includes(job.state);

/** Why a job failed, and what to do. */
export function failure(job) {
    if (job.state === State.CANCELLED) return new Mistake("The job was cancelled.");
    return new Mistake(`The job failed: ${job.failure?.message ?? "nobody said why"}.`, TODO[job.failure?.reason] ?? "");
}

/** How a job stands, in words. */
export function standing(job) {
    if (job.state === State.QUEUED) {
        const before = Number(job.queuePosition ?? 0);
        const place = before === 0 ? "It is next." : `${before} ${before === 1 ? "job is" : "jobs are"} before it.`;
        const why = job.waitingReason ? ` No worker can take it now: ${job.waitingReason}.` : "";
        const again = job.failure ? ` It is tried again, after: ${job.failure.message}.` : "";
        return `Waiting. ${place}${why}${again}`;
    }
    if (job.state === State.RUNNING) {
        if (job.cancelRequested) return "Being cancelled.";
        return STAGES[job.progress?.stage] ?? "A worker has it";
    }
    return { [State.SUCCEEDED]: "Done.", [State.FAILED]: "Failed.", [State.CANCELLED]: "Cancelled." }[job.state] ?? "";
}

/** Where work is shown: what is done, how far it is, and a way to stop it. */
export class Panel {
    #text = element("p");
    #note = element("p", { className: "hint" });
    #bar = element("progress", { max: 1, "aria-label": "Progress" });
    #stop = element("button", { type: "button", className: "second" }, "Stop");
    #said = "";

    constructor(box) {
        this.stopping = new AbortController();
        /** The job that is stopped with it, once there is one. */
        this.job = null;
        this.#stop.addEventListener("click", () => this.#cancel());
        box.replaceChildren(this.#text, this.#bar, this.#note, this.#stop);
        this.box = box;
    }

    /** For what does the work. */
    get options() {
        return {
            signal: this.stopping.signal,
            progress: (what, share) => this.show(what, share),
            note: (text) => this.note(text),
        };
    }

    show(what, share) {
        const known = share !== undefined && Number.isFinite(share);
        this.#text.textContent = known ? `${what}: ${Math.floor(100 * share)} %` : what;
        if (known) this.#bar.value = share;
        else this.#bar.removeAttribute("value");
        // Who listens hears of each stage and each quarter, not of every step.
        const said = known ? `${what}: ${25 * Math.floor(4 * share)} %` : what;
        if (said !== this.#said) announce((this.#said = said));
    }

    note(text) {
        this.#note.textContent = text ?? "";
    }

    end() {
        this.box.replaceChildren();
    }

    async #cancel() {
        this.#stop.disabled = true;
        if (!this.job) {
            this.stopping.abort(new DOMException("stopped", "AbortError"));
            return;
        }
        try {
            await jobs.cancelJob({ name: this.job }, { timeoutMs: SOON });
        } catch {
            // It is over already, or the server is away; what is shown goes on to say which.
            this.#stop.disabled = false;
        }
    }
}

/** Makes a job and follows it to its end; throws where it does not succeed. */
export async function run(spec, displayName, panel) {
    const request = { job: { displayName, spec }, requestId: uuid() };
    panel.show("Asking for the job");
    const made = await patiently(() => jobs.createJob(request, { timeoutMs: SOON }), panel.options);
    panel.job = made.name;
    // It was stopped while nobody knew yet what it is called.
    if (panel.stopping.signal.aborted) await jobs.cancelJob({ name: made.name }, { timeoutMs: SOON });
    const job = await follow(made, (now) => {
        const { done = 0n, total = 0n, bitAccuracy, psnrDb } = now.progress ?? {};
        const share = now.state === State.RUNNING && total > 0n ? Number(done) / Number(total) : undefined;
        panel.show(standing(now), share);
        const figures = [];
        if (bitAccuracy !== undefined) figures.push(`${(100 * bitAccuracy).toFixed(1)} % of bits right`);
        if (psnrDb !== undefined) figures.push(`PSNR ${psnrDb.toFixed(1)} dB`);
        panel.note(figures.join(", "));
    }, panel.options);
    if (job.state !== State.SUCCEEDED) throw failure(job);
    return job;
}

/** Tells of a job whenever it changes, until it is over. */
async function follow(job, tell, options) {
    let cursor = "";
    tell(job);
    while (!isOver(job)) {
        await patiently(async (there) => {
            const call = { signal: options.signal, onHeader: there };
            for await (const answer of jobs.watchJob({ name: job.name, cursor }, call)) {
                ({ job, cursor } = answer);
                tell(job);
            }
        }, options);
    }
    return job;
}
