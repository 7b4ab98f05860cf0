// Marking: a scene goes up, a job marks it, and the marked scene is there to look at, to check and to keep.
import { KeyState, Preset } from "./vendor/api.js";
import { all, keys, patiently, registry, SOON, uuid } from "./calls.js";
import { alertIn, by, bytes, choices, droppable, element, fill, release, save } from "./elements.js";
import { explain, Mistake } from "./errors.js";
import { canShow } from "./formats.js";
import { Panel, run } from "./jobs.js";
import { download, upload } from "./transfer.js";
import { table } from "./verdict.js";
import { show } from "./viewer.js";

const PRESETS = {
    draft: Preset.DRAFT,
    standard: Preset.STANDARD,
    thorough: Preset.THOROUGH,
    robust: Preset.ROBUST,
    paper: Preset.PAPER,
};

/** Pixels between the pictures of a comparison, and rows of it that are shown. */
const GAP = 4;
const ROWS = 2;
/** Bits of keys that originals are registered for. */
const ASSET_BITS = 64;

let known = { keys: [], owners: [], assets: [] };
let chosen = "message";
let closeViewer = null;

const alert = () => by("mark-form").querySelector(".alert");
const key = () => known.keys.find(({ name }) => name === by("mark-key").value);

/** Name and bits of a key. */
export const titleOfKey = (key) => `${key.displayName || key.name.replace("keys/", "")} (${key.bits} bits)`;
/** Name and number of an asset. */
export const titleOfAsset = (asset) => `${asset.displayName || asset.sha256.slice(0, 12)} (number ${asset.payloadNumber})`;

/** Asks what keys, owners and originals the project has. */
export async function inventory() {
    const [found, owners, assets] = await Promise.all([
        all((page) => keys.listKeys(page, { timeoutMs: SOON }), "keys"),
        all((page) => registry.listOwners(page, { timeoutMs: SOON }), "owners"),
        all((page) => registry.listAssets(page, { timeoutMs: SOON }), "assets"),
    ]);
    return { keys: found.filter(({ state }) => state !== KeyState.REVOKED), owners, assets };
}

/** Fills in what may have changed since it was last seen. */
export async function open() {
    known = await inventory();
    known.keys = known.keys.filter(({ state }) => state === KeyState.ACTIVE);
    by("new-key").open ||= known.keys.length === 0;
    offer();
}

function offer() {
    const fitting = known.keys.filter(({ bits }) => chosen === "message" || bits === ASSET_BITS);
    const none = chosen === "message" ? "There is no key yet: make one" : "There is no key of 64 bits: make one";
    fill(by("mark-key"), fitting.map((key) => [key.name, titleOfKey(key)]), none);
    fill(by("mark-owner"), [["", "A new one"], ...known.owners.map((owner) => [owner.name, owner.displayName])], "");
    const assets = known.assets.filter((asset) => asset.key === by("mark-key").value);
    fill(by("mark-asset"), assets.map((asset) => [asset.name, titleOfAsset(asset)]), "None is registered for this key");
    by("mark-owner-name").disabled = by("mark-owner").value !== "";
    const digits = Math.ceil((key()?.bits ?? 32) / 4);
    const message = by("mark-message");
    message.maxLength = digits;
    by("mark-message-hint").textContent = `${digits} digits (0 to 9, a to f). Keep it: whoever verifies needs it.`;
    by("mark-message").required = chosen === "message";
}

/** A message as a key takes it, or a mistake that says what is wrong. */
export function message(text, key) {
    const digits = Math.ceil(key.bits / 4);
    const plain = text.trim().toLowerCase();
    if (!new RegExp(`^[0-9a-f]{${digits}}$`).test(plain)) {
        throw new Mistake(`The message must be ${digits} hexadecimal digits, for this key of ${key.bits} bits.`, `It has ${plain.length}.`);
    }
    return plain;
}

function draw() {
    const { bits } = key() ?? { bits: 32 };
    const random = crypto.getRandomValues(new Uint8Array(Math.ceil(bits / 8)));
    const hex = Array.from(random, (byte) => byte.toString(16).padStart(2, "0")).join("").slice(-Math.ceil(bits / 4));
    // What is over of the first digit is zero.
    const first = parseInt(hex[0], 16) & ((1 << (((bits - 1) % 4) + 1)) - 1);
    by("mark-message").value = first.toString(16) + hex.slice(1);
}

async function makeKey() {
    const panel = new Panel(by("key-job"));
    by("key-make").disabled = true;
    try {
        const spec = { case: "createKey", value: { bits: Number(by("key-bits").value) } };
        const job = await run(spec, by("key-name").value.trim(), panel);
        await open();
        by("mark-key").value = job.result.value.key;
        offer();
        by("new-key").open = false;
        by("mark-key").focus();
    } catch (error) {
        alertIn(alert(), explain(error));
    } finally {
        panel.end();
        release(by("key-make"));
    }
}

/** The asset to be marked with: the chosen one, or one that is registered now. */
async function asset(scene, file, panel) {
    if (chosen === "asset") return by("mark-asset").value;
    panel.show("Registering");
    const [ownerId, assetId] = [uuid(), uuid()];
    let owner = by("mark-owner").value;
    if (!owner) {
        const displayName = by("mark-owner-name").value.trim();
        const call = () => registry.createOwner({ owner: { displayName }, requestId: ownerId }, { timeoutMs: SOON });
        owner = (await patiently(call, panel.options)).name;
    }
    const original = { case: "artifact", value: scene };
    const registered = { owner, key: key().name, displayName: file.name.slice(0, 63), original };
    const call = () => registry.createAsset({ asset: registered, requestId: assetId }, { timeoutMs: SOON });
    return (await patiently(call, panel.options)).name;
}

function check() {
    const file = by("mark-file").files[0];
    if (!file) throw new Mistake("No scene is chosen.", "Drop a file, or choose one.");
    if (!key()) throw new Mistake("No key is chosen.", "Make one, under Make a new key.");
    if (chosen === "message") return { file, message: message(by("mark-message").value, key()) };
    if (chosen === "asset" && !by("mark-asset").value) {
        throw new Mistake("No original is registered for this key.", "Register the scene now.");
    }
    if (chosen === "register" && !by("mark-owner").value && !by("mark-owner-name").value.trim()) {
        throw new Mistake("The owner has no name.", "Give one, or choose an owner.");
    }
    return { file, message: "" };
}

async function submit(event, checkPicture) {
    event.preventDefault();
    alertIn(alert(), null);
    const result = by("mark-result");
    const send = event.target.querySelector("[type=submit]");
    let panel = null;
    try {
        const wanted = check();
        const with_ = key();
        send.disabled = true;
        result.hidden = true;
        closeViewer?.();
        closeViewer = null;
        panel = new Panel(by("mark-job"));
        const scene = await upload(wanted.file, panel.options);
        const of = chosen === "message" ? "" : await asset(scene.name, wanted.file, panel);
        const preset = PRESETS[by("mark-preset").value];
        const value = { scene: scene.name, key: with_.name, message: wanted.message, preset, asset: of };
        const job = await run({ case: "embed", value }, wanted.file.name.slice(0, 63), panel);
        panel.job = null;
        const made = job.result.value;
        const [marked, comparison] = [await download(made.scene, panel.options), await download(made.comparison, panel.options)];
        const claim = of ? { asset: of } : { message: wanted.message };
        await present(result, { made, marked, comparison, original: wanted.file }, (picture) => {
            checkPicture(picture, { key: with_.name, ...claim });
        });
    } catch (error) {
        alertIn(alert(), explain(error));
    } finally {
        panel?.end();
        release(send);
    }
}

function figures(made) {
    const rows = [
        ["Bits that one view reads right", `${(100 * made.bitAccuracy).toFixed(1)} %, in the worst ${(100 * made.bitAccuracyWorstView).toFixed(1)} %`],
        ["Likeness", `PSNR ${made.psnrDb === undefined ? "without end" : `${made.psnrDb.toFixed(1)} dB`}, SSIM ${made.ssim.toFixed(4)}`],
        ["Gaussians changed", `${made.changedGaussians.toLocaleString("en")} of ${made.gaussians.toLocaleString("en")}`],
        ["Time", `${Number(made.duration?.seconds ?? 0)} s, on ${made.device}`],
    ];
    if (made.targetMissed.length > 0) rows.push(["Misses its target", made.targetMissed.join("; ")]);
    return table(rows);
}

/** The three parts of a comparison, which lie side by side in one picture with gaps; of its rows, each a view, the first. */
async function parts(file) {
    const picture = await createImageBitmap(file);
    const width = Math.floor((picture.width - 2 * GAP) / 3);
    const height = Math.min(picture.height, ROWS * (width + GAP) - GAP);
    const names = ["Before", "After", "Difference, ten times"];
    const shown = names.map((name, index) => {
        const canvas = element("canvas", { width, height, role: "img", "aria-label": name });
        canvas.getContext("2d").drawImage(picture, -index * (width + GAP), 0);
        return element("figure", {}, canvas, element("figcaption", {}, name));
    });
    return element("div", { className: "pictures" }, ...shown);
}

async function present(box, { made, marked, comparison }, checkPicture) {
    const act = (text, does, className = "second") => {
        const button = element("button", { type: "button", className }, text);
        button.addEventListener("click", does);
        return button;
    };
    const head = element("h2", { tabIndex: -1 }, "The marked scene");
    const stage = element("div");
    const pictures = element("ul", { className: "files" });
    const trouble = element("div", { role: "alert", className: "alert", hidden: true });
    const keep = act(`Download ${marked.name} (${bytes(marked.size)})`, () => save(marked, marked.name), "");
    const taken = (picture) => {
        const item = element("li", {}, `${picture.name} (${bytes(picture.size)})`);
        const check = act("Check it", () => checkPicture(picture));
        item.append(element("div", { className: "row" }, act("Download it", () => save(picture, picture.name)), check));
        pictures.append(item);
        check.focus();
    };
    const turn = act("Turn it here", async () => {
        turn.disabled = true;
        try {
            closeViewer = await show(stage, marked, taken);
            stage.querySelector("canvas").focus();
        } catch (error) {
            alertIn(trouble, explain(error));
        }
    });
    if (!canShow(marked.name)) turn.hidden = true;
    box.replaceChildren(head, figures(made), await parts(comparison), element("div", { className: "row" }, keep, turn), trouble, stage, pictures);
    for (const [name, text] of [[made.evidenceHtml, "Evidence, a page"], [made.evidenceJson, "Evidence, JSON"]]) {
        if (name) keep.parentElement.append(act(text, () => keepArtifact(name, trouble)));
    }
    box.hidden = false;
    head.focus();
}

/** Fetches an artifact and has the browser keep it. */
export async function keepArtifact(name, trouble) {
    alertIn(trouble, null);
    try {
        const file = await download(name);
        save(file, file.name);
    } catch (error) {
        alertIn(trouble, explain(error));
    }
}

/** Connects the form, once. `checkPicture` gets pictures that are to be verified, and the claim. */
export function connect(checkPicture) {
    droppable(by("mark-drop"), by("mark-file"));
    choices(by("mark-form"), "mark-what", (value) => {
        chosen = value;
        offer();
    });
    by("mark-key").addEventListener("change", offer);
    by("mark-owner").addEventListener("change", offer);
    by("mark-random").addEventListener("click", draw);
    by("key-make").addEventListener("click", makeKey);
    by("mark-form").addEventListener("submit", (event) => submit(event, checkPicture));
}
