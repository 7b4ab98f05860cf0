// Verifying: pictures or a scene go up, a job reads them, and the verdict is told with what it rests on.
import { alertIn, announce, by, bytes, choices, droppable, element, fill, release } from "./elements.js";
import { explain, Mistake } from "./errors.js";
import { Panel, run } from "./jobs.js";
import { inventory, keepArtifact, message, titleOfAsset, titleOfKey } from "./mark.js";
import { upload } from "./transfer.js";
import { verdict } from "./verdict.js";

/** The most suspects that the server reads together. */
const MOST_FILES = 1000;

let known = { keys: [], owners: [], assets: [] };
let chosen = "message";
let files = [];
let update = () => {};

const alert = () => by("verify-form").querySelector(".alert");
const key = () => known.keys.find(({ name }) => name === by("verify-key").value);

/** Fills in what may have changed since it was last seen. */
export async function open() {
    known = await inventory();
    offer();
}

function offer() {
    fill(by("verify-key"), known.keys.map((key) => [key.name, titleOfKey(key)]), "There is no key yet");
    const assets = known.assets.filter((asset) => asset.key === by("verify-key").value);
    fill(by("verify-asset"), assets.map((asset) => [asset.name, titleOfAsset(asset)]), "None is registered for this key");
    fill(by("verify-owner"), known.owners.map((owner) => [owner.name, owner.displayName]), "Nobody is registered");
    by("verify-message").required = chosen === "message";
}

function take(list) {
    files = [...list];
    by("verify-files").required = files.length === 0;
    by("verify-list").replaceChildren(...files.slice(0, 20).map((file) => element("li", {}, `${file.name} (${bytes(file.size)})`)));
    if (files.length > 20) by("verify-list").append(element("li", {}, `and ${files.length - 20} more`));
}

/** Begins with a picture and a claim: what the viewer's pictures are checked with. */
export async function begin(picture, claim) {
    take([picture]);
    await open();
    by("verify-key").value = claim.key;
    by("verify-form").elements["verify-what"].value = claim.asset ? "asset" : "message";
    update();
    if (claim.asset) by("verify-asset").value = claim.asset;
    else by("verify-message").value = claim.message;
    announce(`${picture.name} is ready to be verified.`);
}

/** The claim as the API has it, and in words. */
function claim() {
    if (!key()) throw new Mistake("No key is chosen.", "Keys are made where scenes are marked.");
    const text = (select) => by(select).selectedOptions[0]?.textContent ?? "";
    switch (chosen) {
        case "message": {
            const told = message(by("verify-message").value, key());
            return [{ message: told }, `It says the message ${told}`];
        }
        case "asset":
            if (!by("verify-asset").value) throw new Mistake("No original is registered for this key.", "Choose another key, or compare with a message.");
            return [{ asset: by("verify-asset").value }, `It is the original ${text("verify-asset")}`];
        case "owner":
            if (!by("verify-owner").value) throw new Mistake("Nobody is registered.", "Compare with a message.");
            return [{ owner: by("verify-owner").value }, `It is one of the originals of ${text("verify-owner")}`];
        default:
            return [{ search: true }, "It is any registered original of this key"];
    }
}

async function submit(event) {
    event.preventDefault();
    alertIn(alert(), null);
    const box = by("verify-result");
    const send = event.target.querySelector("[type=submit]");
    let panel = null;
    try {
        if (files.length === 0) throw new Mistake("No file is chosen.", "Drop pictures or a scene, or choose them.");
        if (files.length > MOST_FILES) throw new Mistake(`${files.length} files are more than ${MOST_FILES}.`, "Choose fewer.");
        const [spec, words] = claim();
        const title = titleOfKey(key());
        const value = { ...spec, key: key().name, suspects: [] };
        send.disabled = true;
        box.hidden = true;
        panel = new Panel(by("verify-job"));
        for (const [index, file] of files.entries()) {
            const of = files.length > 1 ? ` file ${index + 1} of ${files.length}` : "";
            const progress = (what, share) => panel.show(what + of, share);
            const { name } = await upload(file, { ...panel.options, progress });
            value.suspects.push(name);
        }
        const name = files.length === 1 ? files[0].name : `${files.length} files, ${files[0].name} first`;
        const job = await run({ case: "verify", value }, name.slice(0, 63), panel);
        present(box, job.result.value, { files: name, key: title, claim: words });
    } catch (error) {
        alertIn(alert(), explain(error));
    } finally {
        panel?.end();
        release(send);
    }
}

function evidence(result) {
    const trouble = element("div", { role: "alert", className: "alert", hidden: true });
    const act = (text, name) => {
        const button = element("button", { type: "button", className: "second" }, text);
        button.addEventListener("click", () => keepArtifact(name, trouble));
        return button;
    };
    return [
        element("h3", {}, "Evidence"),
        element("p", {}, "A signed report of all that was read and tried. To keep it, keep the files of the suspect too. It needs a token that is good for admins."),
        element("div", { className: "row" }, act("Download evidence.html", result.evidenceHtml), act("Download evidence.json", result.evidenceJson)),
        trouble,
        element("p", {}, "Whoever is given it checks the signature with the server's public key, and no server:"),
        element("pre", { tabIndex: 0 }, element("code", {}, "guardsplat report key > guardsplat.pem\nguardsplat report check evidence.html --public-key guardsplat.pem")),
    ];
}

function present(box, result, asked) {
    const asset = known.assets.find(({ name }) => name === result.asset);
    const owner = known.owners.find(({ name }) => name === result.owner);
    const found = result.asset && `${asset ? titleOfAsset(asset) : result.asset}${owner ? `, of ${owner.displayName}` : ""}`;
    box.replaceChildren(...verdict(result, { ...asked, found }), ...(result.evidenceHtml ? evidence(result) : []));
    box.hidden = false;
    const head = box.querySelector("h2");
    head.focus();
    announce(head.textContent);
}

/** Tells in `box` what a job found that is over. */
export async function recall(job, box) {
    known = await inventory();
    const { key, message, asset, owner } = job.spec.value;
    const title = (list, name, words) => {
        const found = list.find((one) => one.name === name);
        return found ? words(found) : name;
    };
    let claim = "It is any registered original of this key";
    if (message) claim = `It says the message ${message}`;
    if (asset) claim = `It is the original ${title(known.assets, asset, titleOfAsset)}`;
    if (owner) claim = `It is one of the originals of ${title(known.owners, owner, ({ displayName }) => displayName)}`;
    present(box, job.result.value, { files: job.displayName, key: title(known.keys, key, titleOfKey), claim });
}

/** Connects the form, once. */
export function connect() {
    const input = by("verify-files");
    droppable(by("verify-drop"), input);
    input.addEventListener("change", () => take(input.files));
    update = choices(by("verify-form"), "verify-what", (value) => {
        chosen = value;
        offer();
    });
    by("verify-key").addEventListener("change", offer);
    by("verify-form").addEventListener("submit", submit);
}
