// A PLY in memory, as Spark reads it, of splats that are given as glTF has them.

/**
 * The file of `count` splats. Each attribute is a function of row and component: rotations are x, y, z, w, scales and
 * opacities themselves and not their logarithms and logits, coefficients one attribute each, band after band.
 */
export function plyOf({ count, position, rotation, scale, opacity, coefficients }) {
    const [constant, ...rest] = coefficients;
    const numbered = (name, length) => Array.from({ length }, (_, i) => `${name}_${i}`);
    const names = ["x", "y", "z", ...numbered("f_dc", 3), ...numbered("f_rest", 3 * rest.length), "opacity"];
    names.push(...numbered("scale", 3), ...numbered("rot", 4));
    const properties = names.map((name) => `property float ${name}\n`).join("");
    const header = new TextEncoder().encode(
        `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${properties}end_header\n`,
    );
    const bytes = new Uint8Array(header.length + 4 * names.length * count);
    bytes.set(header);
    const view = new DataView(bytes.buffer);
    let at = header.length;
    const put = (value) => {
        view.setFloat32(at, value, true);
        at += 4;
    };
    for (let row = 0; row < count; row++) {
        for (let axis = 0; axis < 3; axis++) put(position(row, axis));
        for (let channel = 0; channel < 3; channel++) put(constant(row, channel));
        for (let channel = 0; channel < 3; channel++) {
            for (const coefficient of rest) put(coefficient(row, channel));
        }
        const share = opacity(row, 0);
        put(Math.log(share / (1 - share)));
        for (let axis = 0; axis < 3; axis++) put(Math.log(scale(row, axis)));
        for (const i of [3, 0, 1, 2]) put(rotation(row, i));
    }
    return bytes;
}
