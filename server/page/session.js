// Who is signed in: a token, which this tab keeps for as long as it is open, and which stands in no address.
const NAME = "guardsplat.token";

/** The token, or null. */
export function token() {
    return sessionStorage.getItem(NAME);
}

/** Keeps a token for this tab. */
export function keep(text) {
    sessionStorage.setItem(NAME, text);
}

/** Forgets it. */
export function forget() {
    sessionStorage.removeItem(NAME);
}
