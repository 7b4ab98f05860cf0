// Jobs of the project: the queue, what failed and why, what came of the others; and the workers with what they have.
import { Outcome, State } from "./vendor/api.js";
import { jobs, patiently, SOON } from "./calls.js";
import { alertIn, announce, by, bytes, element, moment, release } from "./elements.js";
import { explain, reason } from "./errors.js";
import { isOver, standing } from "./jobs.js";
import { keepArtifact } from "./mark.js";
import { recall } from "./verify.js";

const STATES = { open: [State.QUEUED, State.RUNNING], failed: [State.FAILED], all: [] };
const KINDS = { embed: "Marking", verify: "Verifying", createKey: "Making a key" };
const PAGE = 25;

let next = "";
/** How often it was looked. The answer to a look is dropped once there is a later one, or jobs would stand there twice. */
let looks = 0;

function act(text, does) {
    const button = element("button", { type: "button", className: "second" }, text);
    button.addEventListener("click", async () => {
        button.disabled = true;
        alertIn(by("jobs-alert"), null);
        try {
            await does();
        } catch (error) {
            alertIn(by("jobs-alert"), explain(error));
        }
        // One whose list was made anew is gone.
        if (button.isConnected) release(button);
        else if (document.activeElement === document.body) by("jobs-title").focus();
    });
    return button;
}

/** Who had a job, and how that ended. */
async function attempts(job, box) {
    const answer = await patiently(() => jobs.listJobAttempts({ name: job.name }, { timeoutMs: SOON }));
    const ends = {
        [Outcome.SUCCEEDED]: "succeeded",
        [Outcome.CANCELLED]: "was cancelled",
        [Outcome.RELEASED]: "was handed back",
    };
    const texts = answer.attempts.map(({ number, worker, startTime, outcome, failure }) => {
        const end = outcome === Outcome.FAILED ? `failed: ${failure?.message ?? ""}` : (ends[outcome] ?? "has it now");
        return `Attempt ${number}, ${moment(startTime)}, worker ${worker}: ${end}`;
    });
    if (texts.length === 0) texts.push("No worker was given it yet.");
    box.replaceChildren(...texts.map((text) => element("li", {}, text)));
}

function item(job) {
    const kind = KINDS[job.spec.case] ?? "Job";
    const list = element("ul");
    const found = element("div", { className: "result", hidden: true });
    const row = element("div", { className: "row" }, act("Attempts", () => attempts(job, list)));
    if (!isOver(job)) {
        row.append(act("Cancel", async () => {
            await jobs.cancelJob({ name: job.name }, { timeoutMs: SOON });
            await open();
        }));
    }
    if (job.state === State.FAILED) {
        row.append(act("Queue it once more", async () => {
            await jobs.requeueJob({ name: job.name }, { timeoutMs: SOON });
            await open();
        }));
    }
    const { scene, verdict } = job.result.value ?? {};
    if (scene) row.append(act("Download the marked scene", () => keepArtifact(scene, by("jobs-alert"))));
    if (verdict) row.append(act("Show the verdict", () => recall(job, found)));
    return element(
        "li",
        {},
        element("p", {}, element("strong", {}, kind), job.displayName ? `: ${job.displayName}` : ""),
        element("p", {}, standing(job)),
        job.failure && isOver(job) ? element("p", {}, job.failure.message) : null,
        element("p", { className: "hint" }, `${job.name.replace("jobs/", "")}, asked for ${moment(job.createTime)}`),
        row,
        list,
        found,
    );
}

async function page() {
    const states = STATES[by("jobs-state").value];
    looks += 1;
    const look = looks;
    const answer = await patiently(() => jobs.listJobs({ pageSize: PAGE, pageToken: next, states }, { timeoutMs: SOON }));
    if (look !== looks) return;
    next = answer.nextPageToken;
    by("jobs-list").append(...answer.jobs.map(item));
    by("jobs-more").hidden = !next;
    const there = by("jobs-list").children.length;
    by("jobs-summary").textContent = there === 0 ? "There are none." : `${there}${next ? " and more" : ""}.`;
}

function worker({ name, device, version, memoryBytes, seenTime, busy, job, attempt, startTime }) {
    const own = job ? `Has attempt ${attempt} of ${job.replace("jobs/", "")}` : "Has a job of another project";
    const does = busy ? `${own}, since ${moment(startTime)}.` : "Waits for a job.";
    const what = [device, version && `version ${version}`, memoryBytes > 0n && `${bytes(memoryBytes)} for a job`];
    return element(
        "li",
        {},
        element("p", {}, element("strong", {}, name)),
        element("p", {}, does),
        element("p", { className: "hint" }, [...what, `last heard of ${moment(seenTime)}`].filter(Boolean).join(", ")),
    );
}

/** Those who carry jobs out, for who may see them. */
async function workers() {
    try {
        const answer = await patiently(() => jobs.listWorkers({}, { timeoutMs: SOON }));
        by("workers-list").replaceChildren(...answer.workers.map(worker));
        const free = answer.workers.filter(({ busy }) => !busy).length;
        const there = `${answer.workers.length} within the last hour, ${free} without a job.`;
        by("workers-summary").textContent = answer.workers.length === 0 ? "None asked for a job within the last hour." : there;
        by("workers").hidden = false;
    } catch (error) {
        if (reason(error) !== "SCOPE_MISSING") throw error;
        by("workers").hidden = true;
    }
}

/** Looks anew. */
export async function open() {
    next = "";
    by("jobs-list").replaceChildren();
    await page();
    await workers();
    announce(by("jobs-summary").textContent);
}

/** Connects the buttons, once. */
export function connect() {
    const looking = (does) => async () => {
        alertIn(by("jobs-alert"), null);
        try {
            await does();
        } catch (error) {
            alertIn(by("jobs-alert"), explain(error));
        }
    };
    by("jobs-state").addEventListener("change", looking(open));
    by("jobs-refresh").addEventListener("click", looking(open));
    by("jobs-more").addEventListener("click", looking(page));
}
