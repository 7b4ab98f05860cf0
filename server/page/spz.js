// SPZ of version 4 as one of version 3, which Spark reads: the same sections, in one gzip stream instead of one of zstd each.

/** "NGSP": files of earlier versions begin with the magic number of gzip. */
const MAGIC = 0x5053474e;
/** Bytes of the header of version 3, with which that of version 4 begins. */
const HEADER = 16;
/** Bytes of an entry of the table of contents: size compressed, size uncompressed. */
const ENTRY = 16;
/** Bytes of a Gaussian: its position, opacity, colour, scales and rotation. */
const SECTIONS = [9, 1, 3, 3, 4];
/** Spark has no bands above it. */
const MOST_DEGREE = 3;

const bytesOfHarmonics = (degree) => 3 * ((degree + 1) ** 2 - 1);

/** A file of version 4 as one of version 3; of another version it is as it was. */
export async function asVersion3(file) {
    const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
    if (view.getUint32(0, true) !== MAGIC) return file;
    const version = view.getUint32(4, true);
    if (version !== 4) throw new Error(`SPZ of version ${version}`);
    const [points, degree, flags] = [view.getUint32(8, true), file[12], file[14]];
    const shown = Math.min(degree, MOST_DEGREE);

    const header = file.slice(0, HEADER);
    // Of the flags, only that of antialiasing is of version 3.
    header.set([3, 0, 0, 0], 4);
    header.set([shown, file[13], flags & 1, 0], 12);
    const sections = await decompress(view, [...SECTIONS, bytesOfHarmonics(degree)].map((bytes) => bytes * points));
    sections[5] = firstOfRows(sections[5], points, bytesOfHarmonics(degree), bytesOfHarmonics(shown));
    const stream = new Blob([header, ...sections]).stream().pipeThrough(new CompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Sections of so many bytes; those of none have no stream in the file. */
async function decompress(view, sizes) {
    const { ZSTDDecoder } = await import("./vendor/splats.js");
    const zstd = new ZSTDDecoder();
    await zstd.init();
    let entry = view.getUint32(HEADER, true);
    let start = entry + ENTRY * sizes.filter((size) => size > 0).length;
    return sizes.map((size) => {
        if (size === 0) return new Uint8Array();
        const compressed = Number(view.getBigUint64(entry, true));
        const section = zstd.decode(new Uint8Array(view.buffer, view.byteOffset + start, compressed), size);
        if (section.length !== size) throw new Error(`a section of ${section.length} bytes instead of ${size}`);
        entry += ENTRY;
        start += compressed;
        return section;
    });
}

/** The first `kept` bytes of each row of `width`. */
function firstOfRows(section, rows, width, kept) {
    if (kept === width) return section;
    const first = new Uint8Array(rows * kept);
    for (let row = 0; row < rows; row++) first.set(section.subarray(row * width, row * width + kept), row * kept);
    return first;
}
