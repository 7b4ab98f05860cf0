// Elements: made, filled, told of.

/** An element with properties and children. Names with a hyphen are attributes; texts become text and nothing else. */
export function element(tag, properties = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (name.includes("-") || name === "role") made.setAttribute(name, value);
        else made[name] = value;
    }
    made.append(...children.filter((child) => child !== null && child !== undefined));
    return made;
}

/** The element with an id. */
export const by = (id) => document.getElementById(id);

/** Says something to whoever listens to the page instead of looking at it. */
export function announce(text) {
    by("status").textContent = text;
}

/** Shows what went wrong in an alert, and what to do; nothing hides it. */
export function alertIn(box, told) {
    box.hidden = !told;
    box.replaceChildren();
    if (!told) return;
    box.append(element("p", {}, told.what));
    if (told.todo) box.append(element("p", { className: "todo" }, told.todo));
    box.scrollIntoView({ block: "nearest" });
}

/** Fills a select. `options` are pairs of value and text. */
export function fill(select, options, nothing) {
    const before = select.value;
    select.replaceChildren(...options.map(([value, text]) => element("option", { value }, text)));
    if (options.length === 0) select.append(element("option", { value: "" }, nothing));
    if (options.some(([value]) => value === before)) select.value = before;
}

/** Gives a button back after work, and the keyboard to it where that is nowhere else by now. */
export function release(button) {
    button.disabled = false;
    if (document.activeElement === document.body) button.focus({ preventScroll: true });
}

/** Keeps files that are dropped beside their place from being opened instead of the page, with all that goes on there. */
export function keepPage() {
    const files = (event) => event.dataTransfer?.types.includes("Files") && !event.defaultPrevented;
    addEventListener("dragover", (event) => {
        if (!files(event)) return;
        event.preventDefault();
        event.dataTransfer.dropEffect = "none";
    });
    addEventListener("drop", (event) => {
        if (files(event)) event.preventDefault();
    });
}

/** Lets files be dropped on a label with an input. */
export function droppable(label, input) {
    const over = (is) => (event) => {
        event.preventDefault();
        label.classList.toggle("over", is);
    };
    label.addEventListener("dragover", over(true));
    label.addEventListener("dragleave", over(false));
    label.addEventListener("drop", (event) => {
        over(false)(event);
        if (event.dataTransfer.files.length > 0) {
            input.files = event.dataTransfer.files;
            input.dispatchEvent(new Event("change"));
        }
    });
}

/** Shows, of parts with `data-for`, those that the chosen one of some radio buttons is for. */
export function choices(form, name, chosen = () => {}) {
    const update = () => {
        const value = form.elements[name].value;
        for (const part of form.querySelectorAll("[data-for]")) {
            part.hidden = part.dataset.for !== value;
        }
        chosen(value);
    };
    for (const radio of form.elements[name]) radio.addEventListener("change", update);
    update();
    return update;
}

/** Has the browser keep a file. */
export function save(blob, name) {
    const link = element("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Bytes in words. */
export function bytes(count) {
    const number = Number(count);
    if (number < 1000) return `${number} bytes`;
    const power = Math.min(Math.floor(Math.log10(number) / 3), 4);
    return `${(number / 1000 ** power).toPrecision(3)} ${["", "kB", "MB", "GB", "TB"][power]}`;
}

/** A moment of the API in words of whoever looks. */
export function moment(timestamp) {
    return timestamp ? new Date(Number(timestamp.seconds) * 1000).toLocaleString() : "";
}
