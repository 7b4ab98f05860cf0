// What of a scene file the viewer draws: parts in formats that Spark reads.
import { partsOf } from "./gltf.js";
import { asVersion3 } from "./spz.js";

/** Formats that are drawn, by how names end: how Spark calls them, or what makes parts of a file. */
const FORMATS = {
    ply: "ply",
    splat: "splat",
    ksplat: "ksplat",
    sog: "pcsogszip",
    spz: async (bytes) => [{ type: "spz", bytes: await asVersion3(bytes) }],
    gltf: partsOf,
    glb: partsOf,
};

const ending = (name) => name.split(".").pop().toLowerCase();

/** Whether the viewer can show a file, by its name. */
export function canShow(name) {
    return Object.hasOwn(FORMATS, ending(name));
}

/**
 * The parts of a file: bytes of their own, the type that Spark has for them, and a matrix where one of them stands
 * somewhere else.
 */
export async function parts(file) {
    const format = FORMATS[ending(file.name)];
    const bytes = new Uint8Array(await file.arrayBuffer());
    return typeof format === "function" ? await format(bytes) : [{ type: format, bytes }];
}
