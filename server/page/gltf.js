// Splats of a glTF (KHR_gaussian_splatting): each primitive that its scene shows, as a PLY or the SPZ that it is, and where.
import { plyOf } from "./ply.js";
import { asVersion3 } from "./spz.js";

const EXTENSION = "KHR_gaussian_splatting";
/** Splats that are an SPZ in a buffer view; the second name is that of a draft, which files in use have. */
const COMPRESSIONS = [`${EXTENSION}_compression_spz`, `${EXTENSION}_compression_spz_2`];
const MAGIC = 0x46546c67;
/** Bytes of the header of a binary file, and of that of a chunk. */
const [HEADER, CHUNK] = [12, 8];
const MOST_DEGREE = 3;
const FLOAT = 5126;

/** Components by their numbers: how one is read, its bytes, and what stands for 1 where it is normalised. */
const COMPONENTS = {
    5120: [(view, at) => view.getInt8(at), 1, 127],
    5121: [(view, at) => view.getUint8(at), 1, 255],
    5122: [(view, at) => view.getInt16(at, true), 2, 32767],
    5123: [(view, at) => view.getUint16(at, true), 2, 65535],
    [FLOAT]: [(view, at) => view.getFloat32(at, true), 4, 1],
};
const WIDTHS = { SCALAR: 1, VEC3: 3, VEC4: 4 };

/** The splats of a file as parts that Spark reads, each with the matrix of its node. */
export async function partsOf(file) {
    const gltf = new Gltf(file);
    const parts = [];
    for (const { mesh, matrix } of await placed(gltf.json)) {
        for (const { attributes, extensions = {} } of gltf.json.meshes[mesh].primitives) {
            const splats = extensions[EXTENSION];
            if (!splats) continue;
            const compressed = COMPRESSIONS.map((name) => splats.extensions?.[name]).find(Boolean);
            const part = compressed ? await gltf.spz(compressed.bufferView) : gltf.ply(attributes);
            parts.push({ ...part, matrix });
        }
    }
    if (parts.length === 0) throw new Error("a glTF whose scene shows no splats");
    return parts;
}

/** A binary file, or a JSON with its buffers in it. */
class Gltf {
    constructor(file) {
        const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
        this.buffers = new Map();
        if (view.getUint32(0, true) !== MAGIC) {
            this.json = JSON.parse(new TextDecoder().decode(file));
            return;
        }
        const chunk = (at) => file.subarray(at + CHUNK, at + CHUNK + view.getUint32(at, true));
        const text = chunk(HEADER);
        this.json = JSON.parse(new TextDecoder().decode(text));
        const next = HEADER + CHUNK + text.length;
        if (next < file.length && this.json.buffers?.[0]?.uri === undefined) this.buffers.set(0, chunk(next));
    }

    buffer(index) {
        if (!this.buffers.has(index)) {
            const [, code] = /^data:[^,]*;base64,(.*)/is.exec(this.json.buffers[index].uri) ?? [];
            // The service takes scenes of one file, so that there is nothing beside it.
            if (code === undefined) throw new Error("a buffer in another file");
            this.buffers.set(index, Uint8Array.fromBase64(code));
        }
        return this.buffers.get(index);
    }

    bytes({ buffer, byteOffset = 0, byteLength, extensions }) {
        const compressed = Object.keys(extensions ?? {}).some((name) => name.endsWith("meshopt_compression"));
        if (compressed) throw new Error("a compressed buffer view");
        return this.buffer(buffer).subarray(byteOffset, byteOffset + byteLength);
    }

    async spz(view) {
        // A copy, since Spark takes away the whole buffer of what it is given.
        const stream = this.bytes(this.json.bufferViews[view]).slice();
        return { type: "spz", bytes: await asVersion3(stream) };
    }

    ply(attributes) {
        const own = (name) => this.elements(attributes[`${EXTENSION}:${name}`]);
        const coefficients = [];
        for (let degree = 0; degree <= MOST_DEGREE; degree++) {
            if (degree > 0 && attributes[`${EXTENSION}:SH_DEGREE_${degree}_COEF_0`] === undefined) break;
            for (let i = 0; i <= 2 * degree; i++) coefficients.push(own(`SH_DEGREE_${degree}_COEF_${i}`));
        }
        const { count } = this.json.accessors[attributes.POSITION];
        const [position, rotation] = [this.elements(attributes.POSITION), own("ROTATION")];
        const [scale, opacity] = [own("SCALE"), own("OPACITY")];
        return { type: "ply", bytes: plyOf({ count, position, rotation, scale, opacity, coefficients }) };
    }

    /** Component `i` of element `row` of an accessor. */
    elements(index) {
        const { bufferView, byteOffset = 0, componentType, normalized, type, sparse } = this.json.accessors[index];
        if (sparse) throw new Error("a sparse accessor");
        const [read, size, most] = COMPONENTS[componentType];
        const { byteStride: stride = size * WIDTHS[type], ...place } = this.json.bufferViews[bufferView];
        const bytes = this.bytes(place);
        const view = new DataView(bytes.buffer, bytes.byteOffset + byteOffset, bytes.byteLength - byteOffset);
        if (!normalized || componentType === FLOAT) return (row, i) => read(view, row * stride + i * size);
        // The most negative integer stands for -1 too.
        return (row, i) => Math.max(read(view, row * stride + i * size) / most, -1);
    }
}

/** The meshes that the scene shows, each with the matrix that takes it from its node to the world. */
async function placed({ scene = 0, scenes, nodes = [] }) {
    const { Matrix4, Quaternion, Vector3 } = await import("./vendor/splats.js");
    const children = new Set(nodes.flatMap((node) => node.children ?? []));
    const roots = scenes ? (scenes[scene].nodes ?? []) : [...nodes.keys()].filter((node) => !children.has(node));
    const own = ({ matrix, translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) =>
        matrix
            ? new Matrix4().fromArray(matrix)
            : new Matrix4().compose(new Vector3(...translation), new Quaternion(...rotation), new Vector3(...scale));
    const found = [];
    const open = roots.map((node) => [node, new Matrix4()]);
    // In a tree there are no more than all of them.
    for (let visits = nodes.length; open.length > 0 && visits > 0; visits--) {
        const [index, parent] = open.pop();
        const node = nodes[index];
        const matrix = parent.clone().multiply(own(node));
        open.push(...(node.children ?? []).map((child) => [child, matrix]));
        if (node.mesh !== undefined) found.push({ mesh: node.mesh, matrix });
    }
    return found;
}
