// The page: signing in and out, and which of its parts is seen.
import { keys, SOON } from "./calls.js";
import { alertIn, announce, by, keepPage } from "./elements.js";
import { explain, isSignedOut } from "./errors.js";
import * as mark from "./mark.js";
import * as operate from "./operate.js";
import { forget, found, keep, leave, token } from "./session.js";
import * as verify from "./verify.js";

const PARTS = { mark, verify, jobs: operate };
const ALERTS = { mark: () => by("mark-form"), verify: () => by("verify-form"), jobs: () => by("jobs") };

/** Shows a part, and has it ask for what it shows. */
async function go(name, { focus = true } = {}) {
    const part = token() ? (name in PARTS ? name : "mark") : "sign-in";
    for (const section of document.querySelectorAll("main > section")) section.hidden = section.id !== part;
    for (const link of by("nav").querySelectorAll("a")) {
        if (link.hash === `#${part}`) link.setAttribute("aria-current", "page");
        else link.removeAttribute("aria-current");
    }
    by("nav").hidden = by("sign-out").hidden = part === "sign-in";
    const title = by(`${part}-title`);
    document.title = `${title.textContent} – GuardSplat`;
    if (focus) title.focus();
    if (part === "sign-in") return;
    try {
        await PARTS[part].open();
    } catch (error) {
        if (isSignedOut(error)) {
            signOut(explain(error));
            return;
        }
        alertIn(ALERTS[part]().querySelector(".alert"), explain(error));
    }
}

/** Forgets the token, and loads the page anew, so that nothing of the project stays on it. */
function signOut(told) {
    forget();
    leave(told);
    location.replace(location.pathname);
}

async function signIn(event) {
    event.preventDefault();
    const [box, field] = [by("sign-in-form").querySelector(".alert"), by("token")];
    alertIn(box, null);
    keep(field.value.trim());
    try {
        await keys.listKeys({ pageSize: 1 }, { timeoutMs: SOON });
        field.value = "";
        announce("You are signed in.");
        await go(location.hash.slice(1));
    } catch (error) {
        forget();
        alertIn(box, explain(error));
        field.focus();
    }
}

by("sign-in-form").addEventListener("submit", signIn);
by("sign-out").addEventListener("click", () => signOut());
mark.connect(async (picture, claim) => {
    location.hash = "#verify";
    await verify.begin(picture, claim);
});
verify.connect();
operate.connect();
keepPage();
addEventListener("hashchange", () => go(location.hash.slice(1)));
go(location.hash.slice(1), { focus: false });
alertIn(by("sign-in-form").querySelector(".alert"), found());
