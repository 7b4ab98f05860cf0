// Who is signed in: a token, which this tab keeps for as long as it is open, and which stands in no address.
const NAME = "guardsplat.token";
const TOLD = "guardsplat.told";

/** The token, or null. */
export function token() {
    return sessionStorage.getItem(NAME);
}

/** Keeps a token for this tab. */
export function keep(text) {
    sessionStorage.setItem(NAME, text);
}

/** Leaves word of why somebody was signed out, for the page as it is loaded next. */
export function leave(told) {
    if (told) sessionStorage.setItem(TOLD, JSON.stringify(told));
}

/** What was left, once. */
export function found() {
    const told = sessionStorage.getItem(TOLD);
    sessionStorage.removeItem(TOLD);
    return told && JSON.parse(told);
}

/** Forgets it. */
export function forget() {
    sessionStorage.removeItem(NAME);
}
